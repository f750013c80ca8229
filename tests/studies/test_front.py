"""The front of speed over work: robots at all sizes, the best of them, and what the page says."""

from importlib.util import find_spec

import numpy as np
import pytest

if find_spec("pyarrow") is None or find_spec("pandas") is None:
    pytest.skip("the extra sweep is not installed", allow_module_level=True)

import pandas

from seastar_gym.scene import Scene
from seastar_gym.sweep.batches import Batch
from seastar_gym.sweep.configurations import Swim, configuration_with
from seastar_gym.sweep.swimming import swim
from studies.designs import search
from studies.designs.front import AT_WORK, CHAPTER, FASTEST, OWN, STUDY, THRIFTIEST, radii, scene_of
from studies.designs.search import CHILDREN, POWERS, Limit, children, fastest, first, grown, sizes, thriftiest
from studies.designs.space import ANGLES, MEASURED, Body
from studies.frame import DOCS
from studies.pages import numbers

FRONT = numbers(DOCS, STUDY)

ROW = {
    "n_limbs": 5, "taper": 0.25, "radius": 1.6e-3, "robot.limb_length": 0.08, "robot.youngs_modulus": 4e5,
    "actuator.peak_angle": 0.6, "speed": 5e-3, "work": 1e-4, "peak_moment": 1e-4,
}  # fmt: skip
TABLE = pandas.DataFrame([ROW, {**ROW, "speed": 6e-3, "work": 4e-4}])
"""The second is faster at its size, but the first at the same work."""


def swum(size):
    """Results of a robot of so many times the size."""
    row = grown(ROW, size)
    body = Body(5, row["radius"], 0.25)
    numbers = {name: np.array([row[name]]) for name in search.CHANGED}
    frame = configuration_with(Scene.preset("fast"), "straight", Swim(1, 1), {"robot": (body.robot(), body.label)})
    return swim(Batch(frame, numbers, 1))


def test_a_robot_of_another_size_swims_and_costs_what_the_powers_say():
    small, large = swum(1.0), swum(1.5)
    for name in ("speed", "work", "peak_moment"):
        assert large[name][0] / small[name][0] == pytest.approx(1.5 ** POWERS[name], rel=1e-6)


def test_robots_grow_within_the_ranges():
    low, high = sizes(TABLE)
    np.testing.assert_allclose(low, max(0.5, 5 / 8, 0.5**0.5))
    np.testing.assert_allclose(high, min(1.75, 15 / 8, 12.5**0.5))


def test_the_best_are_those_at_the_size_that_a_limit_or_a_speed_asks_for():
    free, bound = fastest(TABLE), fastest(TABLE, Limit(1e-4))
    assert free["speed"] == pytest.approx(1.75 * 6e-3) and bound["work"] == pytest.approx(1e-4)
    assert bound["speed"] == pytest.approx(5e-3)
    assert fastest(TABLE, Limit(moment=0.5e-4))["peak_moment"] == pytest.approx(0.5e-4)
    thrifty = thriftiest(TABLE, 6e-3)
    assert thrifty["speed"] == pytest.approx(6e-3) and thrifty["radius"] == pytest.approx(1.2 * 1.6e-3)


def test_the_search_begins_everywhere_and_goes_on_near_its_parents():
    draws = np.random.default_rng(0)
    begin, later = first(draws), children([grown(ROW, 1.2)], 0.01, draws)
    for name in search.CHANGED:
        assert len(begin[name]) == len(later[name]) == CHILDREN
        np.testing.assert_allclose(later[name], ROW[name], rtol=0.06)
    angles = begin["actuator.peak_angle"]
    assert ANGLES[0] <= angles.min() < 0.25 < 1.15 < angles.max() <= ANGLES[1]


def test_a_row_is_a_scene_with_contact():
    scene = scene_of(ROW)
    assert scene.contact is not None and scene.robot.n_limbs == 5 and scene.robot.limb_length == 0.08
    assert radii(scene) == pytest.approx((2.56e-3, 0.64e-3))
    assert radii(Scene()) == (1.6e-3, 1.6e-3)


def test_limits_are_the_chapter_s_robot_s_and_the_best_keep_them():
    robots = FRONT["robots"]
    own = robots[CHAPTER]
    assert own["mJ_per_stroke"] == pytest.approx(1e3 / MEASURED * OWN.work, rel=0.01)
    assert own["peak_mN_m"] == pytest.approx(1e3 * OWN.moment, rel=0.01)
    assert robots[AT_WORK]["mJ_per_stroke"] <= 1.01 * own["mJ_per_stroke"]
    assert robots[AT_WORK]["peak_mN_m"] <= 1.01 * own["peak_mN_m"]
    assert robots[THRIFTIEST]["mm_per_s"] == pytest.approx(own["mm_per_s"], rel=0.01)
    assert robots[FASTEST]["mm_per_s"] == max(row["mm_per_s"] for row in robots.values())


def test_the_page_and_the_readme_tell_the_front():
    page, readme = (" ".join(file.read_text(encoding="utf-8").split()) for file in (
        DOCS / "designs.md", DOCS.parent / "README.md"))  # fmt: skip
    robots = FRONT["robots"]
    gain = f"{robots[AT_WORK]['mm_per_s'] / robots[CHAPTER]['mm_per_s']:.1f} times as fast"
    assert gain in page and gain in readme
