"""Edges and the angles between them: directions, their derivatives, half-angle tangents."""

import numpy as np
import pytest

from seastar_gym.lanes.plain import Lanes
from seastar_gym.rods.star import rotation, tangent
from slopes import plain

# The tangent


def tangents(x: np.ndarray) -> np.ndarray:
    return plain(tangent(Lanes(x)))


def test_tangent_is_that_of_numpy_to_a_few_units_in_the_last_place():
    """Up to 1.3 rad: the chapter's hub hinges, opened by two peaks, need pi/5 + pi/5 = 1.26 rad."""
    x = np.concatenate([np.linspace(-1.3, 1.3, 200_001), [0.0, -0.0, 1e-300, -1e-9]])
    exact = np.tan(x.astype(np.longdouble))
    found = tangents(x)
    assert np.max(np.abs(found - exact) / np.spacing(np.abs(exact.astype(float)))) < 5.0
    assert not np.signbit(found[-4])


def test_tangent_is_that_of_an_angle_a_few_units_in_the_last_place_away_up_to_the_pole():
    x = 0.5 * np.pi - np.geomspace(1e-6, 0.4, 10_000)
    exact = np.tan(x.astype(np.longdouble))
    # d tan x = (1 + tan^2 x) dx: the pole magnifies what rounding does to the angle.
    error_in_angle = (tangents(x) - exact) / (1.0 + exact**2)
    assert np.max(np.abs(error_in_angle)) < 4.0 * np.spacing(1.5)


@pytest.mark.parametrize("turns", [0.0, 1e-9, 0.3, 3.1, 3.2, -7.0, 100.0, -1e4])
def test_rotations_are_those_of_any_angle(turns):
    c, s = plain(rotation(Lanes(np.array([turns]))))
    assert c[0] == pytest.approx(np.cos(turns), abs=1e-12) and s[0] == pytest.approx(np.sin(turns), abs=1e-12)
    assert c[0] ** 2 + s[0] ** 2 == pytest.approx(1.0, abs=1e-15)
