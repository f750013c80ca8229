"""Figures and tables that are committed are those of the code of today, where that is cheap to know."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from seastar_gym.controllers.greedy import measure_gaits
from seastar_gym.envs.task import make_scene
from seastar_gym.version import __version__
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


def test_the_page_that_swims_has_the_strokes_of_the_simulator():
    text = (DOCS / "swim.html").read_text(encoding="utf-8")
    hub = json.loads(re.search(r'"map":\{.*?"hub":(\[\[\[.*?\]\]\])', text)[1])
    np.testing.assert_allclose(hub, transitions("balanced")["hub"], atol=UNIT)


@pytest.mark.parametrize("name", ["work_precision.json", "promises.json"])
def test_measured_errors_are_of_this_version(name):
    results = read(name)
    assert results.get("seastar-gym", results.get("version")) == __version__
