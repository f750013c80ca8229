"""The chapter's statements stand beside computed numbers, and the atlas of stability counts what failed."""

import json
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Numerics, Seastar
from seastar_gym.gaits import STRAIGHT
from studies import chapter as study
from studies import stability
from studies.chapter import SETTINGS, Setting
from studies.command import main
from studies.frame import DOCS
from studies.stability import SWEEPS

COARSE = replace(SETTINGS[0], numerics=Numerics("implicit-euler", 10e-3))
CONVERGED = [replace(each, numerics=replace(each.numerics, step=1e-3)) for each in SETTINGS[1:]]
"""With the chapter's ten nodes and in the continuum, nearly converged in time."""
PAIRS = np.tile(list(study.PAIRS.values()), (10, 1, 1))


def values(rows, quantity):
    (found,) = [row.values for row in rows if row.quantity == quantity]
    return np.asarray(found)


def test_the_straight_swim_goes_forward_long_after_the_heating_and_then_far_back():
    """The chapter states: forward during the actuating phase, slightly backward while cooling. The swim differs."""
    rows = study.straight_statements([study.swim(each, np.tile(STRAIGHT, (10, 1, 1)), 100) for each in CONVERGED])
    names = ("forward while heated, 10th stroke", "forward after that", "backward", "turns back at")
    moves = np.array([values(rows, name) for name in names])
    np.testing.assert_allclose(moves[:, 0], [3.50, 11.11, 10.89, 0.44], atol=0.03)  # with the chapter's ten nodes
    np.testing.assert_allclose(moves[:, 1], [2.87, 11.09, 10.67, 0.44], atol=0.03)  # in the continuum
    assert values(rows, "largest |y|").max() < 1e-6


def test_pairs_go_along_their_bisectors_1_4_farthest_and_1_2_least():
    """1 and 5 go farther than 1 and 3 with the chapter's ten nodes only, whatever the step. docs/ has the limit."""
    few = Setting("37 nodes", Seastar(nodes_per_limb=37), Numerics("implicit-midpoint", 1e-3))
    rows = study.pair_statements([study.swim(each, PAIRS, 1) for each in (COARSE, *CONVERGED, few)])
    distances = np.array([values(rows, f"distance of {name}") for name in study.PAIRS]).T
    assert [list(np.argsort(row)) for row in distances[1:3]] == [[0, 1, 3, 2], [0, 3, 1, 2]]
    assert values(rows, "largest angle off it").max() < 1e-6
    kept = json.loads((DOCS / "results" / study.STUDY.file).read_text(encoding="utf-8"))["pairs_mm"]
    np.testing.assert_allclose(kept[study.LIMIT.label], [28.19, 34.36, 39.36, 32.29], atol=0.01)
    np.testing.assert_allclose(distances[3], kept[study.LIMIT.label], rtol=2e-3)


@pytest.mark.parametrize("robot", [study.THE_CHAPTERS, Seastar()], ids=["chapter", "continuum"])
def test_newtons_matrix_becomes_indefinite_where_the_chapter_meets_numerical_issues(robot):
    cost = study.measure_cost(robot, np.array([3e-3, 10e-3, 20e-3]), 0.0)
    assert cost.regularised.tolist() == [False, False, True] and min(*cost.alone, *cost.in_batch) > 0.0
    rows = study.cost_statements([cost, cost])
    assert values(rows, "real-time factor at 3 ms, one robot alone")[0] == pytest.approx(1.0 / cost.alone[0])
    assert values(rows, "smallest h at which Newton's matrix is indefinite")[0] == pytest.approx(20.0)


# The atlas of stability


@pytest.fixture(scope="module")
def cells():
    grid = {"Young's modulus": (1e2, 1e6, 1e11), "drag coefficient": (None, 1.0), "random velocities of nodes": (10.0,),
            "peak angle, all 243 commands": (36.0, 179.0)}  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stability, "REFERENCE_STEPS", 1000)
        sweeps = [each._replace(values=grid[each.label]) for each in SWEEPS if each.label in grid]
        return sweeps, stability.atlas(sweeps, (3e-3, 2e-2, 0.3))


def test_no_robot_fails_and_no_energy_grows_at_the_extremes_and_the_summary_counts_it(cells):
    sweeps, found = cells
    assert all(np.isfinite(cell.iterations) for cell in found)
    assert any(cell.halvings for cell in found) and any(cell.backtracks for cell in found)
    rows = stability.summarise(found, sweeps)
    columns = [dict(zip(stability.SUMMARY, row, strict=True)) for row in rows]
    assert [row["cells"] for row in columns] == ["9", "6", "3", "6", "24"]
    assert all((row["failed"], row["energy grew"]) == ("0", "nowhere") for row in columns)
    assert columns[0]["strokes"] == "72" and columns[3]["strokes"] == "1458"
    worse = stability.summarise([replace(found[0], failed=2, growth=1.0), *found[1:]], sweeps)
    assert [row[3] for row in worse] == ["2", "0", "0", "0", "2"] and worse[0][6] == worse[-1][6] == "1 cells"
    errors = {cell.step: cell.error for cell in found if cell.value == 1e6}
    assert 0.005 < errors[3e-3] < 0.03 < errors[2e-2] < 0.15 < errors[0.3]


@pytest.mark.parametrize("name", ["chapter", "stability"])
def test_the_shortest_form_writes_numbers_and_pictures(name, tmp_path, monkeypatch):
    monkeypatch.setattr(stability, "REFERENCE_STEPS", 100)
    monkeypatch.setattr(study, "STEPS", np.array([3.0, 20.0, 40.0, 3.0, 20.0, 40.0]) * 1e-3)
    assert main([name, "--quick", "--out", str(tmp_path)]) == 0
    pictures = {file.name for file in (DOCS / "results" / name).glob("*.png")}
    assert pictures <= {file.name for file in tmp_path.glob("*.png")} and (tmp_path / f"{name}.json").is_file()
