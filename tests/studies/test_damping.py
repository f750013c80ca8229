"""The damping study: a damped robot rings less and converges with longer steps."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from seastar_gym.gaits import PAIRS
from studies.scenes import damping
from studies.scenes.damping import MATERIALS, Plan, Row, Study, as_table, good_enough, rows_of, study

DOCS = Path(__file__).resolve().parents[2] / "docs"
TINY = Plan(n_random=1, converged=(("sdirk3", 1e-3), ("implicit-midpoint", 1e-3)), shortest=10.0, nodes=10)


@pytest.fixture(scope="module")
def found() -> Study:
    return study(TINY, progress=False)


def row(step: float, path_error: float) -> Row:
    return Row("silicone", "sdirk2", step, path_error, 1000.0)


def test_a_step_is_good_enough_if_all_shorter_ones_are():
    """Errors of opposite sign may cancel at one step, so a small error at one step alone does not count."""
    rows = [row(0.02, 0.005), row(0.01, 0.02), row(0.005, 0.009), row(0.002, 0.001)]
    assert good_enough(rows) == rows[2]
    assert good_enough(rows[:2]) is None


def test_damped_swims_converge_where_undamped_ones_ring(found):
    assert found.agreement["silicone"] < 0.1 * found.agreement["undamped"]
    for scheme in ("sdirk2", "sdirk3", "implicit-midpoint"):
        damped, undamped = (rows_of(found.rows, material, scheme) for material in ("silicone", "undamped"))
        assert [each.step for each in damped] == [0.02, 0.01]
        assert damped[-1].path_error < 0.3 * undamped[-1].path_error
    assert all(found.pairs[material].shape == (len(PAIRS),) for material in MATERIALS)
    assert np.all(np.abs(found.pairs["silicone"] / found.pairs["undamped"] - 1.0) < 0.2)


def test_the_page_quotes_the_committed_change_of_the_pairs():
    """With 73 nodes: with ten, {1-,2+} swims 2.4 % farther."""
    kept = damping.from_data(json.loads((DOCS / "damping.json").read_text(encoding="utf-8")))
    change = 100.0 * (kept.pairs["silicone"] / kept.pairs["undamped"] - 1.0)
    said = " ".join((DOCS / "accuracy.md").read_text(encoding="utf-8").split())
    for name, part in zip(PAIRS, change, strict=True):
        assert f"{abs(part):.1f} % {'farther' if part > 0.0 else 'less far'} ({name})".replace("  ", " ") in said


def test_the_study_writes_its_table_and_picture(found, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(damping, "study", lambda plan: found)
    monkeypatch.setattr("sys.argv", ["damping", "--quick", "--out", str(tmp_path)])
    damping.main()
    with (tmp_path / "damping.csv").open() as stream:
        assert len(list(csv.DictReader(stream))) == len(found.rows)
    kept = damping.from_data(json.loads((tmp_path / "damping.json").read_text(encoding="utf-8")))
    assert kept.rows == found.rows and kept.agreement == found.agreement
    for material in MATERIALS:
        np.testing.assert_allclose(kept.ringing[material], found.ringing[material], rtol=1e-3)
    assert (tmp_path / "damping.png").stat().st_size > 10_000
    assert "Damping changes the distances that the pairs of Fig. 13.8 swim by" in capsys.readouterr().out
    assert as_table(found).row_count == 4


def test_the_page_has_the_step_that_keeps_the_error(found):
    lines = damping.as_markdown(found).splitlines()
    assert lines[0].count("longest step") == len(MATERIALS) and len(lines) == 2 + len(damping.STEPS)
    row = good_enough(rows_of(found.rows, "silicone", "sdirk3"))
    assert row is not None and f"| {1e3 * row.step:g} ms | " in lines[4]
    assert good_enough(rows_of(found.rows, "undamped", "implicit-euler")) is None and "| below 0.5 ms |  |" in lines[2]
