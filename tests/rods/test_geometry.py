"""Edges and the angles between them: directions, their derivatives, half-angle tangents."""

import numpy as np
import pytest

from seastar_gym.lanes.plain import Lanes
from seastar_gym.rods.star import edge_geometry, half_angle, rotation, tangent
from slopes import gradient, plain

RNG = np.random.default_rng(0)
EDGES = RNG.standard_normal((2, 50))
OTHERS = RNG.standard_normal((2, 50))


def geometry(e: np.ndarray):
    """Of an edge from (0.3, -0.2) on."""
    q = np.array([0.3 + 0.0 * e[0], -0.2 + 0.0 * e[1], 0.3 + e[0], -0.2 + e[1]])
    return edge_geometry(q, 0, 1)


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.arctan2(a[0] * b[1] - a[1] * b[0], (a * b).sum(axis=0))


def test_an_edge_knows_its_length_its_square_and_what_is_over_it():
    ex, ey, length, squared, inverse, ux, uy = plain(geometry(EDGES))
    np.testing.assert_allclose([ex, ey], EDGES, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(length, np.hypot(*EDGES), rtol=1e-12)
    np.testing.assert_allclose(squared * inverse, 1.0, rtol=1e-12)
    np.testing.assert_allclose([ux * squared, uy * squared], [ex, ey], rtol=1e-12)


def test_u_turned_is_the_gradient_of_the_direction_and_the_documented_hessian_its_slope():
    def turned(e):
        *_, ux, uy = plain(geometry(e))
        return np.array([-uy, ux])

    np.testing.assert_allclose(turned(EDGES), gradient(lambda e: np.arctan2(e[1], e[0]), EDGES, 1e-4), atol=1e-7)
    *_, ux, uy = plain(geometry(EDGES))
    hessian = np.array([[2.0 * ux * uy, uy**2 - ux**2], [uy**2 - ux**2, -2.0 * ux * uy]])
    np.testing.assert_allclose(hessian, gradient(turned, EDGES, 1e-4), rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_half_angle_is_the_tangent_of_half_the_angle_from_the_first_edge_or_its_reverse(side):
    t = plain(half_angle(geometry(EDGES), geometry(OTHERS), side))
    np.testing.assert_allclose(np.arctan(t), 0.5 * angle(side * EDGES, OTHERS), rtol=0.0, atol=1e-12)


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
