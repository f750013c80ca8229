"""Figures and tables that are committed are those of the code of today, where that is cheap to know."""

import functools
import importlib
import json
import operator
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from seastar_gym.controllers.greedy import measure_gaits
from seastar_gym.envs.task import make_scene
from seastar_gym.scene.fidelity import TIMED_PRESETS, promise
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.version import __version__
from studies.accuracy import timed
from studies.accuracy.tables import two_digits
from studies.learning.bound import MEASURED, MM, SETTLING
from studies.scenes.page import UNIT, transitions

DOCS = Path(__file__).parents[2] / "docs"


def read(name):
    return json.loads((DOCS / name).read_text(encoding="utf-8"))


def command(name):
    """Command, shape (5,), of a name such as {2+,5-}."""
    shares = np.zeros(5)
    for limb, sign in re.findall(r"(\d)([+-])", name):
        shares[int(limb) - 1] = 1.0 if sign == "+" else -1.0
    return shares


@pytest.mark.parametrize("period", [1, 2, 3])
def test_the_fastest_gaits_swim_as_fast_as_bound_json_says(period):
    results = read("bound.json")
    gaits = [gait for gait in results["fastest_gaits"] if gait["period"] == period]
    commands = np.array([[command(name) for name in gait["gait"]] for gait in gaits])
    found = measure_gaits(make_scene(None, results["fidelity"]), commands, SETTLING, MEASURED)
    speeds = MM * np.linalg.norm(found.hub, axis=1)
    np.testing.assert_allclose(speeds, [gait["mm_per_stroke"] for gait in gaits], rtol=1e-3)


def test_the_table_of_ablations_is_that_of_its_numbers():
    ablations = pytest.importorskip("studies.learning.ablations")
    page = (DOCS / "results.md").read_text(encoding="utf-8")
    missing = [line for line in ablations.table(read("ablations.json")).splitlines() if line not in page]
    assert not missing


TABLES = {
    "promises.json": ("accuracy.md", "studies.accuracy.promises", "summary", ()),
    "heading.json": ("gaits.md", "studies.learning.heading", "table", ()),
    "fidelities.json": ("fidelities.md", "studies.learning.fidelities.tables", "as_markdown", ()),
    "in_time.json": ("in_time.md", "studies.learning.in_time.tables", "as_markdown", ("runs",)),
    "gaits.json": ("gaits.md", "studies.gaits.pages", "tables", ()),
}
"""Pages with tables of committed numbers: page, module and function that writes them, keys of their part."""


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_pages_are_those_of_their_numbers(name):
    page, module, function, keys = TABLES[name]
    pytest.importorskip("stable_baselines3")
    results = functools.reduce(operator.getitem, keys, read(name))
    written = getattr(importlib.import_module(module), function)(results)
    text = (DOCS / page).read_text(encoding="utf-8")
    lines = [line for line in written.splitlines() if line.startswith("| ")]
    assert len(lines) > 3 and not [line for line in lines if line not in text]


def test_the_tables_of_presets_are_those_that_come_with_the_package():
    text = (DOCS / "accuracy.md").read_text(encoding="utf-8")
    assert all(line in text for line in timed.table(json.loads(TIMED_PRESETS.read_text(encoding="utf-8"))).splitlines())
    for name in get_args(Fidelity):
        row = promise(name)
        errors = row.space_error, row.time_error, row.path_error, row.gait_error, row.slow_error, row.straight_error
        cells = [f"{two_digits(100 * error):g} %" for error in errors]
        line = next(line for line in text.splitlines() if line.startswith(f"| `{name}` |"))
        assert [cell.strip(" *") for cell in line.split("|")[5:11]] == cells, name


def test_the_page_that_swims_has_the_strokes_of_the_simulator():
    text = (DOCS / "swim.html").read_text(encoding="utf-8")
    hub = json.loads(re.search(r'"map":\{.*?"hub":(\[\[\[.*?\]\]\])', text)[1])
    np.testing.assert_allclose(hub, transitions("balanced")["hub"], atol=UNIT)


@pytest.mark.parametrize("name", ["work_precision.json", "promises.json"])
def test_measured_errors_are_of_this_version(name):
    results = read(name)
    assert results.get("seastar-gym", results.get("version")) == __version__
