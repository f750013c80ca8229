"""The atlas of stability on a tiny grid: every cell converges or says why it was refused, and the files agree."""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from studies.command import main
from studies.frame import as_json
from studies.stability import cells as stability_cells
from studies.stability import study as stability
from studies.stability.cases import SWEEPS, format_step, format_value

STEPS = (3e-3, 2e-2, 0.3)
VALUES = {"youngs_modulus": (1e2, 1e6, 1e11), "drag_coefficient": (None, 1.0), "speed": (0.0, 10.0),
          "peak_angle": (36.0, 179.0)}  # fmt: skip
GRID = tuple(replace(sweep, values=VALUES[sweep.name]) for sweep in SWEEPS if sweep.name in VALUES)


@pytest.fixture(scope="module")
def cells():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stability_cells, "REFERENCE_STEPS", 1000)
        return stability.atlas(GRID, STEPS, workers=1)


@pytest.fixture(scope="module")
def results(cells):
    """Plain data of a run."""
    return json.loads(as_json(stability.as_data(cells, "implicit-euler")))


@pytest.fixture(scope="module")
def folder(cells, results, tmp_path_factory):
    """Folder of the files that a run writes."""
    out = tmp_path_factory.mktemp("stability")
    stability.write_csv(cells, out / "cells.csv")
    stability.STUDY.write(results, out)
    return out


def test_the_grid_covers_every_range():
    ends = {sweep.name: (sweep.values[0], sweep.values[-1]) for sweep in SWEEPS}
    assert ends == {
        "youngs_modulus": (1e2, 1e11), "rod_radius": (0.01, 20.0), "nodes_per_limb": (2, 640),
        "drag_coefficient": (None, 1e4), "density_ratio": (0.1, 100.0), "speed": (0.0, 100.0), "shift": (0.0, 30.0),
        "peak_angle": (9.0, 179.0),
    }  # fmt: skip
    assert (stability.STEPS[0], stability.STEPS[-1]) == (1e-5, 1.0)


def test_every_cell_has_finite_numbers_and_none_is_refused(cells):
    assert len(cells) == len(STEPS) * sum(len(sweep.values) for sweep in GRID)
    for cell in cells:
        assert not cell.refused
        assert cell.failed == 0 and cell.robots == (243 if cell.sweep == "peak_angle" else 8)
        assert all(math.isfinite(x) for x in (cell.iterations, cell.strain, cell.speed, cell.opening_angle))
        assert max(cell.growth, cell.growth_in_vacuum) < stability.GROWTH_ROUNDING
        assert cell.gain < stability.GROWTH_ROUNDING
    assert any(cell.halvings for cell in cells) and any(cell.backtracks for cell in cells)


def test_error_at_the_chapters_setting_grows_with_the_step(cells):
    errors = {cell.step: cell.error for cell in cells if (cell.sweep, cell.value) == ("youngs_modulus", 1e6)}
    assert 0.005 < errors[3e-3] < 0.03 < errors[2e-2] < 0.15 < errors[0.3]


def test_the_csv_has_every_cell_and_the_summary_counts_it(cells, folder):
    lines = list(csv.DictReader((folder / "cells.csv").read_text(encoding="utf-8").splitlines()))
    assert [(one["sweep"], float(one["step"])) for one in lines] == [(cell.sweep, cell.step) for cell in cells]
    assert lines[9]["value"] == "vacuum"
    table = stability.summarise(cells, GRID)
    assert len(table) == len(GRID) + 1
    names = [sweep.name for sweep in GRID]
    for name, row in zip([*names, None], table, strict=True):
        own = [line for line in lines if name is None or line["sweep"] == name]
        ran = [line for line in own if not line["refused"]]
        figures = dict(zip(stability.SUMMARY, row, strict=True))
        assert figures["cells"] == str(len(own)) and figures["refused"] == str(len(own) - len(ran))
        assert figures["strokes"] == str(sum(int(line["robots"]) for line in ran))
        assert figures["failed"] == str(sum(int(line["failed"]) for line in ran)) == "0"
        assert figures["substeps"] == f"{sum(int(line['halvings']) > 0 for line in ran)} cells"
        iterations = [float(line["iterations"]) for line in ran]
        wanted = f"{np.median(iterations):.2g} ({max(iterations):.0f})"
        assert figures["Newton iterations per step (most)"] == wanted
        assert figures["energy grew"] == "nowhere"


def test_pictures_and_summary_follow_from_the_kept_numbers(cells, results, folder, tmp_path):
    again = stability.from_data(results)
    assert stability.sweeps_of(again) == list(GRID)
    assert stability.summarise(again, GRID) == stability.summarise(cells, GRID)
    for name in stability.STUDY.pictures:
        stability.draw_cells(cells, GRID, STEPS, "implicit-euler", tmp_path / name)
        np.testing.assert_array_equal(image(tmp_path / name), image(folder / name))


def image(file):
    return np.asarray(Image.open(file))


def test_a_failure_is_counted_in_its_cell(cells):
    rows = stability.summarise([replace(cells[0], failed=2), *cells[1:]], GRID)
    assert rows[0][4] == rows[-1][4] == "2"


def test_values_and_steps_are_written_as_a_reader_expects_them():
    sweep = SWEEPS[0]
    assert [format_value(sweep, value) for value in (None, 1e11, 1.6, 0.01)] == ["vacuum", "10¹¹", "1.6", "0.01"]
    assert [format_step(step) for step in (1e-5, 3e-3, 0.3, 1.0)] == ["10 µs", "3 ms", "300 ms", "1 s"]


def test_the_study_writes_its_files_and_prints_its_table(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(stability_cells, "REFERENCE_STEPS", 100)
    monkeypatch.setattr(stability, "SWEEPS", GRID)
    monkeypatch.setattr(stability, "STEPS", (2e-2, 0.3))
    assert main(["stability", "--scheme", "sdirk2", "--out", str(tmp_path / "out")]) == 0
    assert "stability.csv" in capsys.readouterr().out.replace("\n", "")  # a long path is wrapped
    pictures = {"stability_needs.png", "stability_iterations.png", "stability_error.png"}
    names = {"stability.csv", "stability.json", *pictures}
    assert {file.name for file in (tmp_path / "out").iterdir()} == names
