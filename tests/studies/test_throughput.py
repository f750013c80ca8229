"""The speed study counts all robots and writes its results. No test asserts a speed, which depends on the machine."""

import csv
import json

import numpy as np
import pytest

from seastar_gym import Scene
from studies.command import main
from studies.speed import history, process, strokes, throughput
from studies.speed.parts import PARTS, part_seconds


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
    assert throughput.as_table(figures).row_count == 2


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
