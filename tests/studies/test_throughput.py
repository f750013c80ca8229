"""The speed study counts all robots and writes its results. No test asserts a speed, which depends on the machine."""

import csv
import json
import re

import numpy as np
import pytest

from hubs import TEN
from seastar_gym import Numerics, Scene, Seastar, der
from studies.command import main
from studies.speed import history, process, strokes, throughput
from studies.speed.kernels import PARTS, part_seconds
from studies.speed.operations import count_operations, flops


def test_exponent_of_a_linear_cost_is_one():
    nodes = np.array([5, 10, 20, 40])
    assert strokes.exponent([(n, 3.0 * (5 * n - 4)) for n in nodes]) == pytest.approx(1.0)


def test_real_time_factor_counts_all_robots():
    one = strokes.real_time_factors(Scene(), 1, 1, 0.02)
    assert all(factor > 0 for factor in one)
    assert len(one) >= 5


def test_a_robot_is_small_and_a_stroke_leaves_nothing_behind():
    held, left = process.memory_per_robot(Scene())
    assert held < 64.0  # KiB
    assert left < 8.0  # B: less than one number per robot


@pytest.mark.parametrize("unwrapped", [False, True])
def test_a_step_of_one_environment_is_its_kernels_and_the_rest(unwrapped):
    beyond, kernels = process.step_of_one("SeastarSwimTimedModerate-v0", 3, unwrapped)
    assert beyond > 0.0 and kernels > 0.0


def test_table_csv_and_picture_are_written(tmp_path):
    figures = [throughput.median("a", "x", [1.0, 2.0, 3.0]), throughput.Figure("b", 4.0, "s")]
    curves = {
        "batch, 1 thread": [(n, 1000.0) for n in throughput.BATCHES],
        "batch, 2 threads": [(n, 1900.0) for n in throughput.BATCHES],
        "us per step over N": [(n, 0.03 * n) for n in strokes.NODES_PER_LIMB],
    }
    throughput.write_csv(figures, curves, tmp_path / "t.csv")
    throughput.draw(curves, tmp_path / "t.png")
    rows = list(csv.DictReader((tmp_path / "t.csv").read_text().splitlines()))
    assert rows[0] == {"what": "a", "x": "", "value": "2.0", "unit": "x", "quartile_1": "1.5", "quartile_3": "2.5"}
    assert len(rows) == 2 + sum(map(len, curves.values()))
    assert (tmp_path / "t.png").stat().st_size > 10_000
    assert len(throughput.as_table(figures).splitlines()) == 4


def test_ten_things_are_timed_in_units_of_a_fixed_loop(monkeypatch):
    assert len(history.things()) == 10
    assert history.stroke_of(Scene.preset("fast"), 1)() > 0.0 and history.unit() > 0.0
    monkeypatch.setattr(history, "unit", iter([1.0, 3.0, 4.0, 4.0, 1.0, 1.0]).__next__)
    assert history.ratio(iter([4.0, 4.0, 9.0]).__next__, 3) == 2.0


def test_the_history_keeps_what_was_timed_before(monkeypatch, tmp_path):
    monkeypatch.setattr(history, "unit", lambda: 0.5)
    for day, seconds in ("2026-01-01 10:00", 2.0), ("2026-01-02 10:00", 1.0):
        monkeypatch.setattr(history, "things", lambda seconds=seconds: {"a stroke": (1, lambda: lambda: seconds)})
        monkeypatch.setattr(history.time, "strftime", lambda _, day=day: day)
        assert main(["speed.history", "--out", str(tmp_path)]) == 0
    runs = json.loads((tmp_path / "speed_history.json").read_text())["runs"]
    assert [(day, row["ratios"]) for day, row in runs.items()] == [
        ("2026-01-01 10:00", {"a stroke": 4.0}), ("2026-01-02 10:00", {"a stroke": 2.0}),
    ]  # fmt: skip
    assert all(row["machine"] and row["versions"]["numba"] for row in runs.values())
    assert history.table({"runs": runs}).endswith("| a stroke | 4 | 2 | 0.50 |")
    assert (tmp_path / "speed_history.png").stat().st_size > 10_000


def test_every_part_of_an_iteration_is_timed():
    durations = part_seconds(Scene(), seconds=0.0)
    assert set(durations) == set(PARTS)
    assert all(min(of_part) > 0.0 for of_part in durations.values())


# The operations of a Newton iteration grow in proportion to the nodes and stay below a bound.


THE_CHAPTERS = Seastar(discretisation="chapter")


def iteration_flops(**robot):
    return flops(count_operations(Scene(robot=Seastar(**robot)))["iteration"])


@pytest.mark.parametrize(
    ("robot", "iteration", "divisions", "roots", "step"),
    [(THE_CHAPTERS, 11_600, 227, 91, 1_300), (TEN, 13_720, 276, 137, 1_310)],
    ids=["chapter", "continuum"],
)
def test_an_iteration_costs_no_more_than_when_it_was_tuned(robot, iteration, divisions, roots, step):
    # These bounds show on any machine when kernels become slower. Lower them when kernels become faster.
    parts = count_operations(Scene(robot, numerics=Numerics.preset("chapter")))
    assert flops(parts["iteration"]) <= iteration
    assert parts["iteration"]["divide"] <= divisions
    assert parts["iteration"]["root"] <= roots
    assert flops(parts["step"]) <= step


def test_parts_add_up_to_the_iteration():
    parts = count_operations(Scene())
    names = ("hub hinges", "limbs", "ring", "substitution")
    assert sum(flops(parts[name]) for name in names) == flops(parts["iteration"])


def test_every_node_of_a_limb_costs_the_same():
    counts = [iteration_flops(nodes_per_limb=n) for n in (10, 20, 40)]
    assert counts[2] - counts[1] == 2 * (counts[1] - counts[0])


def test_every_limb_costs_the_same():
    counts = [iteration_flops(n_limbs=n, nodes_per_limb=4) for n in (4, 6, 8)]
    assert counts[2] - counts[1] == counts[1] - counts[0]


def test_a_count_does_not_depend_on_the_scenes_numbers():
    assert iteration_flops(youngs_modulus=1e4, limb_length=0.2) == iteration_flops()


@pytest.mark.parametrize("fluid_scene", [Scene(), Scene(fluid=None)], ids=["water", "vacuum"])
def test_counting_leaves_the_real_kernels_as_they_are(fluid_scene):
    import seastar_gym.der.potential as potential

    before = potential.factorise
    count_operations(fluid_scene)
    import seastar_gym.der.potential as again

    assert again.factorise is before
    assert np.isfinite(flops(count_operations(fluid_scene)["iteration"]))


def test_the_table_of_the_rods_says_what_is_counted():
    parts = count_operations(Scene(THE_CHAPTERS, numerics=Numerics.preset("chapter")))
    for part in ("hub hinges", "limbs", "ring", "substitution"):
        (kflop,) = re.findall(rf"^{part} +([\d.]+) ", der.__doc__, flags=re.MULTILINE)
        assert float(kflop) == round(flops(parts[part]) / 1e3, 1)
    nodes = 45
    per_node = [round(parts["limbs"][kind] / nodes) for kind in ("multiply", "fused", "add")]
    per_node += [round(parts["limbs"][kind] / nodes, 1) for kind in ("divide", "root")]
    kinds = ("products", "fused products", "sums", "divisions", "roots")
    said = [re.search(rf"([\d.]+) {kind}", der.__doc__.partition("A node of a limb")[2]) for kind in kinds]
    assert [float(number[1]) for number in said] == per_node
    assert f"{flops(parts['limbs']) / nodes:.0f} flop per node" in der.__doc__
