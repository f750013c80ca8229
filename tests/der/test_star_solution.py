"""Solutions of an eliminated system for other right-hand sides."""

import itertools

import numpy as np
import pytest

from hubs import HUBS
from seastar_gym import Contact, Scene, SmaPulse
from seastar_gym.der.linear.star_solution import solve_again, substitute_star
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import rows
from stages import RandomStages, robot_and_star, turn_limbs

GAMMA = 1e-3


@pytest.fixture(scope="module", params=itertools.product([(5, 4), (3, 3), (6, 2)], HUBS[:2]), ids=str)
def eliminated(request):
    """(rods, work, stages) after an elimination; pivots are kept in scenes with contact."""
    shape, hub = request.param
    robot, star = robot_and_star(*shape, hub)
    rods = make_rods(Scene(robot, actuator=SmaPulse(0.1), contact=Contact()))
    stages = RandomStages(star, GAMMA, bend=0.05)
    stages.delta_psi[:] = 0.0
    work = make_work(rods, 1)
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(stages.q), rows(stages.q_hat), rows(stages.v_hat)
    turn_limbs(work, star, stages.delta_psi)
    factorise.plain(rods, work, Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False), None)
    return rods, work, stages


def solved(eliminated, r: np.ndarray) -> np.ndarray:
    rods, work, _ = eliminated
    x = np.zeros_like(r)
    solve_again.plain(rods, work, r, x)
    return x


def random_rows(eliminated, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(eliminated[1].q.shape)


def test_solutions_are_linear_and_of_a_symmetric_positive_definite_matrix(eliminated):
    a, b = random_rows(eliminated, 0), random_rows(eliminated, 1)
    of_a, of_b = solved(eliminated, a), solved(eliminated, b)
    np.testing.assert_allclose(solved(eliminated, a - 2.0 * b), of_a - 2.0 * of_b, atol=1e-10 * np.abs(of_a).max())
    np.testing.assert_allclose((a * of_b).sum(axis=0), (b * of_a).sum(axis=0), rtol=1e-7)
    assert np.all((a * of_a).sum(axis=0) > 0.0)


def test_a_solution_is_that_of_the_oracles_matrix(eliminated):
    r = random_rows(eliminated, 2)
    x = solved(eliminated, r)
    for lane in range(N_LANES):
        hessian = eliminated[2].hessian(lane)
        expected = np.linalg.solve(hessian, r[:, lane])
        np.testing.assert_allclose(x[:, lane], expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_the_solution_found_last_is_the_one_that_is_written(eliminated):
    rods, work, _ = eliminated
    x, again = solved(eliminated, random_rows(eliminated, 3)), np.zeros_like(work.q)
    substitute_star.plain(rods, work, again)
    np.testing.assert_array_equal(again, x)
