"""Quadratic drag (13.8) of a node, from its dissipation potential."""

import numpy as np
import pytest

from seastar_gym import Scene, Seastar, Water
from seastar_gym.der.motion import relative
from seastar_gym.der.terms.drag import add_cross_flow, add_half_edge, drag_slopes
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import NO_RODS, NO_WORK, NOTHING, gradient, plain, symmetric

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


# Drag of flow across half an edge, where a limb has another coefficient along than across.


C_ACROSS, GAMMA = 0.4, 0.01
ANGLE = 0.6
NORMAL = np.array([[-np.sin(ANGLE)], [np.cos(ANGLE)]])


def cross_slopes(w: np.ndarray, normal: np.ndarray = NORMAL):
    """(energy, gradient, Hessian) in q of flows w = q/gamma across an edge."""
    found = add_half_edge.plain(Lanes(C_ACROSS), normal, 0, *map(Lanes, w), Lanes(GAMMA), Lanes(1.0 / GAMMA), NOTHING)
    return plain(found[0]), np.array(plain(found[1])), symmetric(found[2])


def test_force_and_hessian_are_the_derivatives_of_the_energy():
    q = GAMMA * FLOWS
    _, force, hessian = cross_slopes(FLOWS)
    np.testing.assert_allclose(force, gradient(lambda q: cross_slopes(q / GAMMA)[0], q, 1e-5), atol=1e-7)
    np.testing.assert_allclose(hessian, gradient(lambda q: cross_slopes(q / GAMMA)[1], q, 1e-5), atol=2e-3)


def test_flow_along_the_edge_is_not_felt():
    along = np.array([[np.cos(ANGLE)], [np.sin(ANGLE)]]) * np.linspace(-1.0, 1.0, 5)
    assert np.abs(cross_slopes(along)[1]).max() < 1e-16


def test_either_normal_of_an_edge_will_do():
    for part, same in zip(cross_slopes(FLOWS), cross_slopes(FLOWS, -NORMAL), strict=True):
        np.testing.assert_array_equal(same, part)


def test_the_hessian_is_never_negative():
    assert np.linalg.eigvalsh(cross_slopes(FLOWS)[2].transpose(2, 0, 1)).min() > -1e-13


@pytest.mark.parametrize("discretisation, share", [("chapter", 1.0), ("continuum", 1.0 / 3.0)])
def test_a_straight_limb_has_the_one_coefficient_along_and_the_other_across(discretisation, share):
    """Limb 1 lies along x: a node in it feels C_t of flow in x, C_d of flow in y, all of it or a third (Simpson)."""
    rods = make_rods(Scene(Seastar(nodes_per_limb=4, discretisation=discretisation), Water(1000.0, 1.2, 0.3)))
    node, normals = 2, np.tile([0.0, 1.0], 15)[:, None] * np.ones(1)
    for flow, coefficient in (((0.2, 0.0), 0.3), ((0.0, 0.2), 1.2)):
        _, c_speed, _ = drag_slopes.plain(Lanes(rods.drag[node]), *map(Lanes, flow))
        start = (Lanes(0.0), (c_speed * flow[0], c_speed * flow[1]), NOTHING[2])
        _, force, _ = add_cross_flow.plain(rods, normals, node, *map(Lanes, flow), Lanes(1.0), Lanes(1.0), start)
        size = share * 0.5 * 1000.0 * coefficient * 2.0 * 1.6e-3 * (0.1 / 3) * 0.2**2
        np.testing.assert_allclose(np.hypot(*plain(force)), size, rtol=1e-12)


def test_without_such_drag_slopes_stay_what_they_are():
    assert add_cross_flow.plain(NO_RODS, None, 1, None, None, None, None, NOTHING) is NOTHING
