"""The studies of robots on a GPU, as far as they go without one."""

import numpy as np
import pytest

from seastar_gym import Scene
from seastar_gym.model.rods import make_rods
from studies import gpu, gpu_code
from studies.frame import DOCS
from studies.pages import numbers
from studies.speed.terms import THE_CHAPTERS, as_table, in_ten_nodes, measure, scenes

TOLD = """ptxas info    : 0 bytes gmem
ptxas info    : Compiling entry function 'swim_robots' for 'sm_90'
ptxas info    : Function properties for swim_robots
    600 bytes stack frame, 724 bytes spill stores, 1156 bytes spill loads
ptxas info    : Used 255 registers, used 0 barriers, 600 bytes cumulative stack size
"""


def test_all_scenes_and_environments_had_the_bits_of_the_processor_on_the_gpu():
    results = numbers(DOCS, gpu.STUDY)
    bits, observations = results["bits"], results["observations"]
    assert set(bits) == set(gpu.scenes()) and len(bits) >= 40
    assert set(observations) == set(gpu.environments())
    assert all(found["same"] for found in (*bits.values(), *observations.values()))
    assert not any(found["failed"] for found in bits.values())


def test_the_share_of_bandwidth_is_that_of_the_numbers_that_kernels_move():
    row = {"1024": {"steps_per_second": 5e6, "iterations_per_step": 1.5}}
    results = {
        "speed": {"fast": {"cuda": row}},
        "traffic": {"fast": {"iteration": 2e4, "step": 1e4}},
        "bandwidth": 1e12,
    }
    assert gpu.share_of_bandwidth(results, "fast", "1024") == pytest.approx(0.2)


def test_traffic_is_linear_in_the_nodes():
    few, more, most = (gpu.traffic(preset) for preset in ("fast", "balanced", "reference"))
    for part in ("iteration", "step"):
        assert (most[part] - more[part]) / (more[part] - few[part]) == (37 - 12) / (12 - 7)


def test_what_the_assembler_tells_is_read():
    assert gpu_code.facts(TOLD) == {"stack": 600, "spill_stores": 724, "spill_loads": 1156, "registers": 255}
    with pytest.raises(ValueError, match="ptxas tells no registers: nothing"):
        gpu_code.facts("nothing")


needs_assembler = pytest.mark.skipif(
    gpu_code.assembler() is None, reason="NVIDIA's assembler is not here: the extra gpu-check has it"
)


@needs_assembler
@pytest.mark.parametrize("architecture", gpu_code.ARCHITECTURES)
def test_the_code_of_observations_spills_nothing(architecture):
    code = gpu_code.code_of_observations(gpu.scenes()["preset fast"])
    found = gpu_code.needs(code, architecture, gpu_code.assembler())
    assert found["stack"] == found["spill_stores"] == found["spill_loads"] == 0 < found["registers"] < 128


@needs_assembler
@pytest.mark.parametrize(
    "name", ["the chapter's scene", *(pytest.param(name, marks=pytest.mark.slow) for name in gpu_code.NAMES[1:])]
)
def test_the_code_spills_no_more_than_before(name):
    code = gpu_code.code_of(gpu.scenes()[name])
    for architecture, before in numbers(DOCS, gpu_code.STUDY)["needs"][name].items():
        now = gpu_code.needs(code, architecture, gpu_code.assembler())
        for what, number in now.items():
            assert number <= 1.1 * before[what] + 64, (architecture, what)


# The study of the cost of terms compares scenes with one more term each, in the same round.


def test_costs_are_relative_to_the_first_scene():
    costs = measure({"this": Scene(), "the same": Scene()}, rounds=3)
    assert [cost.name for cost in costs] == ["this", "the same"]
    assert costs[0].per_iteration == costs[0].per_stroke == 1.0
    assert costs[1].iterations == costs[0].iterations >= 1.0
    assert costs[1].quartiles[0] <= costs[1].per_iteration <= costs[1].quartiles[1]
    assert len(as_table(costs).splitlines()) == 4


def test_every_scene_has_terms_of_its_own():
    compared = scenes()
    assert next(iter(compared)) == THE_CHAPTERS and compared[THE_CHAPTERS] == in_ten_nodes(Scene())
    assert len({hash(scene) for scene in compared.values()}) == len(compared)
    assert np.isfinite([make_rods(scene).stretching.EA[0] for scene in compared.values()]).all()
