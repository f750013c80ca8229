"""The gallery shows every scene with its cost."""

import numpy as np
import pytest

from studies.scenes import gallery


@pytest.mark.slow
def test_the_gallery_has_a_picture_and_a_cost_of_every_scene(tmp_path):
    gallery.draw_all(tmp_path, strokes=1)
    text = gallery.table(gallery.measured(rounds=1, n_robots=8))
    for exhibit in gallery.exhibits():
        assert f"**{exhibit.name}**" in text
        picture = tmp_path / f"{exhibit.name.replace(' ', '_')}.png"
        assert picture.stat().st_size > 1000


def test_costs_are_relative_to_the_first_scene():
    shown = gallery.exhibits()[:1] * 2
    costs, per_step = gallery.measure_costs(shown, rounds=1, n_robots=1)
    assert costs[0] == 1.0 and costs[1] > 0.0
    np.testing.assert_array_equal(per_step[0], per_step[1])


def test_an_outline_is_as_wide_as_the_limb():
    centre = np.stack([np.linspace(0.0, 0.1, 5), np.zeros(5)], axis=1)
    radius = np.linspace(2e-3, 1e-3, 5)
    contour = gallery.outline(centre, radius)
    np.testing.assert_allclose(contour[:5, 1], radius)
    np.testing.assert_allclose(contour[:4:-1, 1], -radius)
