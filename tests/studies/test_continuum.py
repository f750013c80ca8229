"""Both discretisations tend to the same robot, the chapter's with order 1 and the continuum's with order 2 or more."""

import json

import numpy as np
import pytest

from studies.continuum import study
from studies.continuum.scenes import NAMES, scene


@pytest.fixture(scope="module")
def rows():
    return study.measure(("damped", "three limbs", "unequal, tapered limbs", "curved limbs", "soft limbs"))


def test_both_discretisations_tend_to_the_same_robot(rows):
    for row in rows:
        assert (np.diff(row.errors) < 0.0).all(), row
        assert row.errors[-1] < (0.12 if row.discretisation == "chapter" else 1e-3), row


def test_the_table_has_the_rows_of_the_kept_numbers(rows):
    results = json.loads(json.dumps(study.as_data(rows)))
    table = study.table(results)
    for row, kept in zip(rows, study.rows_of(results), strict=True):
        assert kept[:2] == row[:2] and kept.order == pytest.approx(row.order, abs=1e-4)
        np.testing.assert_allclose(kept.errors, row.errors, rtol=1e-3)
        assert f"| {row.name} | " in table and f" {row.order:.1f} |" in table


def test_the_chapters_order_is_one_and_the_continuums_two_or_more(rows):
    orders = {kind: [row.order for row in rows if row.discretisation == kind] for kind in ("chapter", "continuum")}
    assert min(orders["chapter"]) > 0.7 and max(orders["chapter"]) < 1.3
    assert min(orders["continuum"]) > 1.9


def test_ten_nodes_are_within_about_a_per_cent(rows):
    ten = study.NODES.index(10)
    assert max(row.errors[ten] for row in rows if row.discretisation == "continuum") < 0.013


@pytest.mark.slow
def test_every_scene_and_consistent_added_mass_which_is_better_than_lumped():
    rows = study.measure(NAMES)
    errors = {(row.name, row.discretisation): row.errors for row in rows}
    for name in NAMES:
        assert (errors[name, "continuum"] < 0.4 * errors[name, "chapter"]).all(), name
    consistent, lumped = errors["added mass", "continuum"], errors[study.LUMPED, "continuum"]
    assert (consistent < 0.7 * lumped).all()


def test_orders_are_slopes_over_the_edge_length():
    errors = np.array([1.0, 0.1, 0.025, 0.00625])
    assert study.order(errors) == pytest.approx(2.0)


def test_the_picture_is_drawn(rows, tmp_path):
    study.STUDY.write(study.as_data(rows), tmp_path)
    assert (tmp_path / "continuum.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", NAMES)
def test_every_scene_has_the_nodes_and_the_discretisation_asked_for(name):
    robot = scene(name, "chapter", 7).robot
    assert (robot.nodes_per_limb, robot.discretisation) == (7, "chapter")
