"""The study of mass in the hub: equal masses, and the chapter's robot where the hub has none."""

import json
from importlib.util import find_spec
from pathlib import Path

import pytest

if find_spec("pyarrow") is None:
    pytest.skip("the extra sweep is not installed", allow_module_level=True)

from seastar_gym.scene import Scene
from seastar_gym.scene.per_robot import of_robot
from seastar_gym.sweep.cells import Cell
from seastar_gym.sweep.frames import frame_with
from seastar_gym.sweep.swimming import scene_of, swim
from studies.designs.hub import CURVES, SETTINGS, SWIM, Curve, draw, limbs_mass

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.parametrize("hub", ["point", "disc"])
def test_all_robots_of_a_curve_have_the_same_mass(hub):
    cell = Curve(hub, "1-,3+", 2.0).cell("fast", (0.1, 0.5, 0.9))
    for k, share in enumerate((0.1, 0.5, 0.9)):
        robot = scene_of(cell, k).robot
        limbs = limbs_mass() * of_robot(robot.density, 0) / Scene.preset("fast").robot.density
        assert limbs + robot.body.mass == pytest.approx(2.0 * limbs_mass())
        assert robot.body.mass / (limbs + robot.body.mass) == pytest.approx(share)


def test_a_point_hub_that_weighs_next_to_nothing_is_the_chapter_s():
    with_hub = swim(Curve("point", "1-,3+", 1.0).cell("fast", (1e-6,)))
    without = swim(Cell(frame_with(Scene.preset("fast"), "1-,3+", SWIM, {}), {}, 1))
    assert with_hub["speed"] == pytest.approx(without["speed"], rel=2e-3)  # drag next to the hub is spread otherwise


def test_the_page_tells_what_was_measured():
    found = json.loads((DOCS / "hub.json").read_text(encoding="utf-8"))
    assert set(found["mm_per_s"]) == set(SETTINGS)
    count = sum(len(speeds) for hubs in found["mm_per_s"]["fast"].values() for speeds in hubs.values())
    assert count == len(CURVES)
    page = (DOCS / "designs.md").read_text(encoding="utf-8")
    straight = found["mm_per_s"]["fine"]["point"]["1-,3+"]["1"]
    for share in (0.0, 0.5, 0.9):
        assert f"{straight[found['shares'].index(share)]:.2f}" in page


def test_the_picture_shows_every_gait(tmp_path):
    pytest.importorskip("matplotlib")
    draw(json.loads((DOCS / "hub.json").read_text(encoding="utf-8")), tmp_path / "hub.png")
    assert (tmp_path / "hub.png").stat().st_size > 10_000
