"""Quadratic drag (13.8) of a node, from its dissipation potential."""

import numpy as np

from seastar_gym.der.motion import relative
from seastar_gym.der.terms.drag import drag_slopes
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import NO_WORK, gradient, plain

C = 0.37
FLOWS = np.random.default_rng(0).standard_normal((2, 60))


def slopes(w: np.ndarray):
    """(potential, force with its sign turned, Hessian) of flows w, shape (2, n)."""
    potential, c_speed, c_over_speed = plain(drag_slopes.plain(Lanes(C), *map(Lanes, w)))
    hessian = c_speed * np.eye(2)[:, :, None] + c_over_speed * w[:, None] * w
    return potential, c_speed * w, hessian


def test_force_is_that_of_the_chapter():
    np.testing.assert_allclose(slopes(FLOWS)[1], C * np.hypot(*FLOWS) * FLOWS, rtol=1e-12)


def test_force_and_hessian_are_the_derivatives_of_the_potential():
    _, force, hessian = slopes(FLOWS)
    np.testing.assert_allclose(force, gradient(lambda w: slopes(w)[0], FLOWS, 1e-3), atol=1e-8)
    np.testing.assert_allclose(hessian, gradient(lambda w: slopes(w)[1], FLOWS, 1e-3), atol=1e-6)


def test_the_hessian_is_positive_definite_where_water_flows():
    assert np.linalg.eigvalsh(slopes(FLOWS)[2].transpose(2, 0, 1)).min() > 0.0


def test_drag_knows_no_direction():
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s], [s, c]])
    (potential, force, _), (same, turned, _) = slopes(FLOWS), slopes(turn @ FLOWS)
    np.testing.assert_allclose(same, potential, rtol=1e-12)
    np.testing.assert_allclose(turned, turn @ force, rtol=0.0, atol=1e-14)


def test_still_water_takes_nothing_and_is_finite():
    for part in slopes(np.zeros((2, 1))):
        np.testing.assert_array_equal(part, 0.0)


def test_a_node_that_drifts_with_the_current_feels_none():
    flowing = NO_WORK._replace(current=np.array([[0.2], [0.1], [-0.4], [0.3]]))
    np.testing.assert_array_equal(plain(relative.plain(flowing, 1, Lanes(-0.4), Lanes(0.3))), np.zeros((2, 1)))
    assert plain(relative.plain(NO_WORK, 1, Lanes(-0.4), Lanes(0.3))) == (-0.4, 0.3)
