"""A device with a thread for each robot swims to the processor's bits: its twin "scalar" always, "cuda" with a GPU. Its
code is that of one mesh, so there are few scenes here and in test_bits.py: `python -m studies.gpu` has all others."""

import pickle
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from unittest.mock import Mock

import numba
import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, StrokeReport
from seastar_gym.envs.observation import observing
from seastar_gym.envs.vector import Buffers
from seastar_gym.lanes import cuda
from seastar_gym.lanes.compile import kept_code
from seastar_gym.lanes.device import Program
from seastar_gym.simulator.device import DEVICES, DeviceBatch
from seastar_gym.sweep.command import main as sweep_command
from strokes import assert_same, finished
from studies.gpu import EVERYTHING, NOT_ON_DEVICES, batch_on, compared, environments, observed, on_processor, scenes

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="devices have compiled code alone")

SMALL = Scene(Seastar(nodes_per_limb=4), actuator=SmaPulse(0.4), numerics=Numerics.preset("fast"))
OF_EACH = replace(SMALL, robot=replace(SMALL.robot, youngs_modulus=np.linspace(0.8e6, 1.2e6, 35)))
AT_FAST = ("pairs", "continuous", "headings", "camera")
"""Environments of the same scene, whose code is compiled once."""
ENVS = environments()
N_ROBOTS = 35
"""Robots of a batch: more than one group of a device or a processor, the last of which is not full."""


def require_gpu() -> None:
    """Skip where there is none."""
    try:
        cuda.arrays()
    except ValueError as no_gpu:
        pytest.skip(str(no_gpu))


@pytest.fixture(params=["scalar", "cuda"])
def device(request):
    if request.param == "cuda":
        require_gpu()
    return request.param


def commands_of(n_strokes: int, n_robots: int = N_ROBOTS, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (n_strokes, n_robots, 5))


def pair(scene: Scene, device: str, **options) -> tuple[Simulator, Simulator]:
    """On the processor and on the device; with work, so that few codes are compiled."""
    options["effort"] = True
    return Simulator(scene, N_ROBOTS, **options), Simulator(scene, N_ROBOTS, device=device, **options)


def assert_same_reports(one: StrokeReport, other: StrokeReport) -> None:
    for name, a, b in zip(StrokeReport._fields, one, other, strict=True):
        if name != NOT_ON_DEVICES:
            np.testing.assert_array_equal(a, b, err_msg=name)


# The same bits


@pytest.mark.slow
@pytest.mark.parametrize("which", ["everything", "each alone"])
def test_every_term_scheme_and_actuator_has_the_bits_of_the_processor(which):
    names = [f"sdirk2, {EVERYTHING}"] if which == "everything" else scenes()
    assert [name for name in names if not compared(name, "scalar")["same"]] == []


def test_whatever_is_done_between_strokes_reaches_the_device(device):
    """Resets, strengths, numbers of each robot, states, copies; one robot fails, alike and alone."""
    both, commands = pair(SMALL, device, error_bars=True), commands_of(4)
    mask, heading = np.arange(N_ROBOTS) % 3 == 0, np.linspace(0.0, 1.0, N_ROBOTS)
    for simulator in both:
        simulator.stroke(commands[0])
        simulator.reset(mask, heading)
        simulator.set_limb_strengths(0.7)
        state = simulator.get_state()
        state.velocities[7] = 1e200
        simulator.set_state(state)
        report = simulator.stroke(commands[1])
        assert report.status[7] > 0 and not np.delete(report.status, 7).any()
        simulator.set_scene(OF_EACH, ~mask)
        simulator.stroke(commands[2])
        simulator.reset(mask)
    assert_same(*both)
    for name in ("positions", "velocities"):
        there = both[1].on_device(name)
        assert isinstance(there, np.ndarray) == (device == "scalar")
        np.testing.assert_array_equal(on_processor(there), getattr(both[0], name))
    other = pickle.loads(pickle.dumps(both[1]))
    assert other.device == device
    other.set_state(both[0].get_state())
    both[0].set_state(both[0].get_state())
    both[1].set_state(both[0].get_state())
    assert_same_reports(*(simulator.stroke(commands[3]) for simulator in both))
    other.stroke(commands[3])
    assert_same(*both)
    assert_same(both[0], other)


def test_parts_of_a_stroke_are_the_whole_and_one_that_is_dropped_is_undone(device):
    (whole, parted), (first, second) = pair(SMALL, device), commands_of(2)
    for simulator in (whole, parted):
        simulator.stroke(first)
    for _ in range(2):  # with the state on the device, and after somebody has looked at it
        dropped = parted.stroke_in_parts(second, 3)
        next(dropped)
        dropped.close()
        assert_same(whole, parted)
    report = whole.stroke(second)
    seen, last = finished(parted.stroke_in_parts(second, 3), lambda _: parted.hub_position())
    assert_same_reports(report, last)
    assert_same(whole, parted)
    assert len({hub.tobytes() for hub in seen}) == 3


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=[pytest.mark.slow] * (each.partition(", ")[2] not in AT_FAST)) for each in ENVS]
)
def test_environments_observe_and_are_rewarded_alike(device, name):
    assert observed(name, device)["same"]


def test_states_and_observations_stay_on_the_device_where_torch_takes_them(device, monkeypatch):
    batch = batch_on(device, 5, on_device=True)
    observations, _ = batch.reset(seed=0)
    actions = batch.action_space.sample()
    batch.step(actions)
    monkeypatch.setattr(DeviceBatch, "_fetched", Mock(side_effect=AssertionError))
    batch.step(actions)
    torch = pytest.importorskip("torch")
    there = torch.from_dlpack(observations)
    assert there.shape == (5, 186) and there.dtype == torch.float32 and there.is_cuda == (device == "cuda")
    observations[0, 0] = 7.0
    assert there[0, 0] == 7.0


def test_first_strokes_in_two_threads_do_not_meet(device, monkeypatch):
    monkeypatch.setattr(DEVICES[device], "_LOADED", {})
    (commands,), whole = commands_of(1), Simulator(SMALL, N_ROBOTS, effort=True)
    whole.stroke(commands)
    others = [Simulator(SMALL, N_ROBOTS, effort=True, device=device) for _ in range(2)]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda simulator: simulator.stroke(commands), others))
    for other in others:
        assert_same(whole, other)


def test_a_broken_off_read_and_a_full_memory_lose_nothing(device, monkeypatch):
    both, commands = pair(SMALL, device), commands_of(3)
    for simulator in both:
        simulator.stroke(commands[0])
    with monkeypatch.context() as full:
        full.setattr(DeviceBatch, "_read_device", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            both[1].positions  # noqa: B018
    assert_same(*both)
    for simulator in both:
        simulator.stroke(commands[1])
        simulator.set_scene(OF_EACH)
    with monkeypatch.context() as full:
        full.setattr(both[1]._batch, "_arrays", Mock(zeros=Mock(side_effect=MemoryError)))
        with pytest.raises(MemoryError):
            both[1].stroke(commands[2])
    assert_same(*both)
    for simulator in both:
        simulator.stroke(commands[2])
    assert_same(*both)


# Refusals


def test_a_gpu_that_is_not_there_is_refused_in_one_sentence(tmp_path, capsys):
    try:
        cuda.arrays()
    except ValueError:
        for make in (lambda: Simulator(SMALL, device="cuda"), lambda: batch_on("cuda", 5, on_device=True)):
            with pytest.raises(ValueError, match=r'^device="cuda" (needs CuPy|finds no NVIDIA GPU).*\.$'):
                make()
        assert sweep_command(["robot.n_limbs=3", "--device", "cuda", "--out", str(tmp_path)]) == 2
        assert capsys.readouterr().err.startswith('device="cuda" ')
    else:
        assert Simulator(SMALL, device="cuda").device == "cuda"


def test_observations_on_a_device_are_refused_where_those_of_the_processor_are_needed():
    with assert_refused("on_device must be True or False, not 'cuda'"):
        batch_on("cpu", 5, on_device="cuda")
    batch = batch_on("scalar", 5, on_device=True)
    observations, _ = batch.reset(seed=0)
    flags = np.zeros(5, bool)
    with assert_refused("out takes observations of the processor: make the batch without on_device"):
        batch.step(np.zeros((5, 5)), out=Buffers(observations, np.zeros(5), flags, flags))


# The code for GPUs, without one

OF_DOUBLES = re.compile(r"^\s+(?:@%p\d+\s+)?([a-z0-9.]*\.f64)\b", re.MULTILINE)
ROUNDED_TO_NEAREST = {f"{operation}.rn.f64" for operation in ("add", "sub", "mul", "div", "rcp", "fma", "sqrt")}
EXACT = re.compile(r"(neg|abs|mov|selp|min|max|setp\.\w+|cvt\.(rmi|rzi)(\.s64|\.f64)?|cvt\.rn)\.f64")
"""Whole numbers become floating-point ones without rounding: none is above 2^53."""


def kept(program: Program) -> str:
    return kept_code(f"{program.key}-{cuda.ARCHITECTURE}.ptx", lambda: cuda.ptx_of(program).encode()).decode()


def code_of_observations(scene: Scene) -> str:
    batch = DeviceBatch(scene, 1, "scalar", effort=False)
    return kept(batch.filling(*observing(batch.coefficients, scene.robot, np.zeros((1, 4)))))


def code_of_swims(scene: Scene) -> str:
    """For limbs that all turn alike."""
    return kept(DeviceBatch(scene, scene.n_robots or 1, "scalar", effort=False).program(0))


CODES = {scheme: replace(SMALL, numerics=Numerics(scheme, 0.005)) for scheme in ("implicit-midpoint", "sdirk2")}


OBSERVED = "three limbs", "eight limbs in contact", "limbs in a row on a body"


@pytest.mark.parametrize("name", [*CODES, *OBSERVED, pytest.param(f"sdirk2, {EVERYTHING}", marks=pytest.mark.slow)])
def test_the_code_for_gpus_rounds_every_operation_by_itself_and_calls_nothing(name):
    code_of = code_of_observations if name in OBSERVED else code_of_swims
    code = code_of(CODES.get(name) or scenes()[name])
    found = set(OF_DOUBLES.findall(code))
    assert {"add.rn.f64", "mul.rn.f64", "fma.rn.f64", "div.rn.f64", "sqrt.rn.f64"} <= found
    assert {name for name in found - ROUNDED_TO_NEAREST if not EXACT.fullmatch(name)} == set()
    assert "call" not in code and ".func" not in code and ".target sm_70" in code
