"""Newton's method on a stage: it ends where the potential is least, and leaves alone whom it was not asked for."""

from types import SimpleNamespace

import numpy as np
import pytest

import oracle
from seastar_gym.der.geometry import larger
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.newton import minimise, move_node, step_scale
from seastar_gym.der.stepping.skip_last import quadratic_length
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import nodes, plain, rows
from stages import RandomStages, robot_and_star, rods_of, turn_limbs

ROBOT, STAR = robot_and_star(5, 4)
RODS, GAMMA = rods_of(ROBOT), 5e-3
EVERYONE = np.ones(N_LANES, bool)


def minimised(active=EVERYONE, tolerance=1e-13, limit=60.0, speed=0.05, bend=0.05, gamma=GAMMA):
    stages, work = RandomStages(STAR, gamma, bend=bend, speed=speed), make_work(RODS, 1)
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(stages.q), rows(stages.q_hat), rows(stages.v_hat)
    turn_limbs(work, STAR, stages.delta_psi)
    stage = Stage(work.q_hat, work.v_hat, Lanes(gamma), Lanes(1.0 / gamma), False)
    found = minimise.plain(RODS, work, stage, Mask(active), Lanes(tolerance), Lanes(limit))
    converged, phi, iterations, regularised, backtracks = plain(found)
    return SimpleNamespace(
        stages=stages, q=nodes(work.q), converged=converged, phi=phi, iterations=iterations, regularised=regularised,
        backtracks=backtracks, length=plain(quadratic_length.plain(RODS, stage)),
    )  # fmt: skip


def test_it_ends_at_a_minimum_of_the_oracles_potential():
    found = minimised()
    assert found.converged.all()
    for lane in range(N_LANES):
        data = found.stages.data(lane)
        residual = oracle.incremental_gradient(STAR, found.q[lane], *data)
        before = oracle.incremental_gradient(STAR, found.stages.q[lane], *data)
        assert np.abs(residual).max() < 1e-9 * np.abs(before).max()
        hessian = oracle.incremental_hessian(STAR, found.q[lane], data[0], GAMMA, data[3])
        assert np.linalg.eigvalsh(hessian)[0] > 0.0


def test_a_step_that_can_be_foreseen_is_left_out_and_would_have_been_as_small_as_asked():
    tolerance = 1e-7
    loose, tight = minimised(tolerance=tolerance, bend=0.01), minimised(bend=0.01)
    assert loose.iterations.sum() < tight.iterations.sum()
    assert np.linalg.norm(loose.q - tight.q, axis=2).max() < tolerance


def test_robots_that_are_not_active_keep_their_bits_and_cost_no_iteration():
    active = np.arange(N_LANES) % 2 == 0
    found, all_of_them = minimised(active), minimised()
    np.testing.assert_array_equal(found.q[active], all_of_them.q[active])
    np.testing.assert_array_equal(found.q[~active], found.stages.q[~active])
    assert not found.iterations[~active].any() and not found.converged[~active].any()


def test_nobody_takes_more_iterations_than_allowed():
    found = minimised(limit=2.0, speed=1.0, bend=0.5)
    assert found.iterations.max() == 2.0 and not found.converged.all()


def test_wild_robots_are_helped_by_convex_matrices_or_shorter_steps_and_arrive():
    found = minimised(speed=1.0, bend=0.5, limit=500.0, gamma=0.05)
    assert found.converged.all() and np.all(found.regularised + found.backtracks > 0.0)


def test_a_node_moves_by_its_new_step_or_back_along_its_last():
    work = make_work(RODS, 1)
    stepping, shortening = Mask(np.arange(N_LANES) == 0), Mask(np.arange(N_LANES) == 1)
    work.step[2], work.step[3] = 0.4, 0.2
    scale = step_scale.plain(stepping, shortening, Lanes(0.5))
    squared = plain(move_node.plain(work, 1, (Lanes(-1.0), Lanes(0.5)), shortening, scale))
    np.testing.assert_array_equal(work.q[2:4, :3], [[1.0, -0.2, 0.0], [-0.5, -0.1, 0.0]])
    np.testing.assert_allclose(squared[:3], [1.25, 0.05, 0.0])


def test_nothing_is_foreseen_further_than_edges_are_long():
    assert 0.0 < minimised().length < STAR.edge_length


def test_larger_is_the_larger():
    np.testing.assert_array_equal(plain(larger.plain(Lanes(np.array([1.0, 3.0])), Lanes(2.0))), [2.0, 3.0])


@pytest.mark.parametrize("lane", [0, N_LANES - 1])
def test_a_robot_whose_state_is_not_a_number_does_not_converge_and_stops_nobody(lane):
    work, stages = make_work(RODS, 1), RandomStages(STAR, GAMMA, bend=0.05)
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(stages.q), rows(stages.q_hat), rows(stages.v_hat)
    turn_limbs(work, STAR, stages.delta_psi)
    work.q[5, lane] = np.nan
    stage = Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)
    converged = plain(minimise.plain(RODS, work, stage, Mask(EVERYONE), Lanes(1e-10), Lanes(60.0))[0])
    np.testing.assert_array_equal(converged, np.arange(N_LANES) != lane)
