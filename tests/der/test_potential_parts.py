"""The parts of a stage's potential: nodes, edges and hinges have the gradients and Hessians of their energies."""

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Seastar, UniformCurrent, Water
from seastar_gym.der.geometry import edge_geometry, positive_part
from seastar_gym.der.motion import node_motion
from seastar_gym.der.potential import coupling, elastic_slopes, node_slopes
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.der.terms.load import load_power, nodal_load
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import NO_RODS, gradient, plain, symmetric

GAMMA, NODE, EDGE = 0.01, 5, 4
ROBOT = Seastar(nodes_per_limb=4, relaxation_time=4e-3)
EVERYTHING = make_rods(Scene(
    ROBOT, Water(950.0, 1.3, 0.1, UniformCurrent(0.3, -0.2), 0.8), numerics=Numerics(), loads=((NODE, 1e-3, -2e-3),)
))
NOTHING_BUT_LIMBS = make_rods(Scene(Seastar(nodes_per_limb=4, relaxation_time=0.0), None))
RNG = np.random.default_rng(0)
EDGES = ROBOT.edge_length * np.array([[0.8], [0.6]]) + 4e-3 * RNG.standard_normal((2, N_LANES))


def stage_of(rods):
    """Memory and a stage from random states, with random normals, added mass, current and strains."""
    work = make_work(rods, 1)
    for rows in (work.normals, work.added_mass, work.current, work.tension, work.bending, work.v_hat):
        if rows is not None:
            rows[:] = 0.1 * RNG.standard_normal(rows.shape)
    return work, Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)


@pytest.mark.parametrize("rods", [EVERYTHING, NOTHING_BUT_LIMBS], ids=["everything", "limbs"])
def test_a_node_has_the_slopes_of_its_inertia_drag_and_load(rods):
    work, stage = stage_of(rods)

    def slopes(q):
        work.q[2 * NODE : 2 * NODE + 2] = q
        motion, push = node_motion.plain(work, stage, NODE), (Lanes(0.0), Lanes(0.0))
        energy, force, hessian = node_slopes.plain(rods, work, stage, NODE, motion, push)
        return plain(energy), np.array(plain(force)), symmetric(hessian)

    q = GAMMA * RNG.standard_normal((2, N_LANES))
    _, force, hessian = slopes(q)
    np.testing.assert_allclose(force, gradient(lambda q: slopes(q)[0], q, 1e-5), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(hessian, gradient(lambda q: slopes(q)[1], q, 1e-5), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("rods", [EVERYTHING, NOTHING_BUT_LIMBS], ids=["everything", "limbs"])
def test_an_edge_has_the_slopes_of_its_stretching_and_of_the_moments_that_turn_it(rods):
    """Energy E_s + mu theta + sigma (theta - theta_0)^2/2, with the net moment mu and stiffness sigma of its hinges."""
    work, stage = stage_of(rods)
    mu, sigma = 1e-4 * RNG.standard_normal(N_LANES), 1e-3 * RNG.random(N_LANES)
    theta_0 = np.arctan2(EDGES[1], EDGES[0])

    def slopes(e):
        edge = edge_geometry.plain(np.array([0.0 * e[0], 0.0 * e[1], *e]), 0, 1)
        energy, force, hessian = elastic_slopes.plain(rods, work, stage, EDGE, edge, Lanes(mu), Lanes(sigma), None)
        turn = np.arctan2(e[1], e[0]) - theta_0
        softer = sigma * turn * np.array([-e[1], e[0]]) / (e**2).sum(axis=0)
        return plain(energy) + mu * turn, np.array(plain(force)), symmetric(hessian), softer

    _, force, hessian, _ = slopes(EDGES)
    np.testing.assert_allclose(force, gradient(lambda e: slopes(e)[0], EDGES, 1e-5), rtol=1e-6, atol=1e-8)
    columns = gradient(lambda e: slopes(e)[1] + slopes(e)[3], EDGES, 1e-5)
    np.testing.assert_allclose(hessian, columns, rtol=1e-5, atol=1e-4)


def test_the_convex_part_of_an_edge_is_never_negative():
    work, stage = stage_of(NOTHING_BUT_LIMBS)
    edge = edge_geometry.plain(np.array([0.0 * EDGES[0], 0.0 * EDGES[1], *(0.7 * EDGES)]), 0, 1)
    args = NOTHING_BUT_LIMBS, work, stage, EDGE, edge, Lanes(1e-3), Lanes(0.0)
    smallest = [
        np.linalg.eigvalsh(symmetric(elastic_slopes.plain(*args, convex)[2]).transpose(2, 0, 1)).min()
        for convex in (None, Mask(np.ones(N_LANES, bool)))
    ]
    assert smallest[0] < 0.0 and smallest[1] > -1e-9


def test_a_hinge_couples_its_edges_by_the_product_of_their_directions_slopes():
    a, b = (edge_geometry.plain(np.array([0.0 * e[0], 0.0 * e[1], *e]), 0, 1) for e in (EDGES, EDGES[::-1]))
    turned = [np.array([-plain(e[6]), plain(e[5])]) for e in (b, a)]
    found = np.array(plain(coupling.plain(Lanes(0.7), b, a))).reshape(2, 2, -1)
    np.testing.assert_allclose(found, 0.7 * turned[0][:, None] * turned[1], rtol=1e-12)


def test_positive_part_is_zero_for_what_is_not_positive():
    np.testing.assert_array_equal(plain(positive_part.plain(Lanes(np.array([2.0, 0.0, -3.0])))), [2.0, 0.0, 0.0])


def test_a_load_has_its_power_and_none_is_none():
    assert plain(nodal_load.plain(EVERYTHING, NODE)) == (1e-3, -2e-3)
    assert plain(load_power.plain(EVERYTHING, NODE, Lanes(3.0), Lanes(1.0))) == pytest.approx(1e-3)
    assert plain(nodal_load.plain(NO_RODS, NODE)) == (0.0, 0.0)
    assert plain(load_power.plain(NO_RODS, NODE, Lanes(3.0), Lanes(1.0))) == 0.0
