"""The study of error bars: its shares against closed forms, and its page."""

from types import SimpleNamespace

import numpy as np
import pytest

from seastar_gym.accuracy.commands import CLASSES, STROKES
from seastar_gym.scene.numerics import Numerics
from studies.accuracy import error_bars as study
from studies.accuracy import timed_error_bars as timed
from studies.accuracy.error_bars import FIDELITIES
from studies.accuracy.timed import PERIODS, Plan

N = 2 * len(CLASSES)


def test_a_row_has_the_share_of_covered_strokes_and_the_class_with_the_lowest():
    true, estimate = np.full((STROKES, N), 1e-5), np.full((STROKES, N), 3e-5)
    true[:5, 6:8] = 4e-5  # two sequences of the fourth class
    row = study.judged("a robot", "fast", 1.5, true, estimate)
    assert row.coverage == pytest.approx(1.0 - 10 / true.size)
    assert (row.lowest, row.lowest_class) == (0.5, list(CLASSES)[3])
    assert row.sharpness == pytest.approx(3.0) and row.error == pytest.approx(1e-5)


def test_a_robot_whose_solver_fails_is_not_covered(monkeypatch):
    hub = np.zeros((STROKES, N, 2))
    swum = SimpleNamespace(hub=hub, error_estimate=np.full((STROKES, N), np.nan))
    monkeypatch.setattr(study, "swim", lambda scene, commands, error_bars: swum)
    true, estimate = study.true_and_estimated(None, None, hub + 1e-5)
    assert study.judged("a robot", "fast", np.inf, true, estimate).coverage == 0.0


def test_the_tables_and_the_picture_show_every_robot(tmp_path):
    pytest.importorskip("matplotlib")
    rows = [
        study.Row(robot, setting, 2.0, 0.97, 0.8, "small", 3.0, 1e-5)
        for robot in study.ROBOTS for setting in study.SETTINGS
    ]  # fmt: skip
    results = {"samples": 6, "costs": dict.fromkeys(study.SETTINGS, 4.0), "rows": [row._asdict() for row in rows]}
    assert study.rows_of(results) == rows
    for robot in study.ROBOTS:
        assert study.of_robots(results).count(f"| {robot} |") == len(study.FIDELITIES)
    for setting in study.SETTINGS:
        assert f"| {setting} | " in study.of_settings(results)
    study.draw(rows, tmp_path / "error_bars.png")
    assert (tmp_path / "error_bars.png").stat().st_size > 10_000


@pytest.mark.slow
def test_error_bars_of_the_chapters_robot_cover_fresh_sequences():
    for row in study.measure(("the chapter's",), 2, (51, 52)):
        assert row.coverage >= 0.9 and 1.0 < row.sharpness < 8.0


# Error bars of wires that are commanded several times a second.


def test_a_table_has_the_coverage_of_every_preset():
    lines = timed.table({0.5: dict.fromkeys(FIDELITIES, (0.998, 4.75)), 0.2: dict.fromkeys(FIDELITIES, (1.0, 5.0))})
    assert lines.splitlines()[0] == "| preset | 0.5 s | 0.2 s |"
    assert "| `fast` | 99.8 %, 4.8 | 100.0 %, 5.0 |" in lines


@pytest.mark.slow
@pytest.mark.parametrize("period", PERIODS)
def test_error_bars_cover_decisions_in_time_and_are_not_vacuous(period):
    true = timed.TRUE._replace(nodes_per_limb=55, numerics=Numerics("implicit-midpoint", 0.5e-3, 1e-9))
    for coverage, sharpness in timed.measure(period, Plan(samples=2, seconds=5), true, seed=11).values():
        assert coverage >= 0.9 and 1.0 < sharpness < 8.0
