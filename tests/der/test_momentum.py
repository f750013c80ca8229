"""The whole robot's own Newton step: it balances the momentum, and moves nobody who was not asked for."""

import numpy as np

import oracle
from seastar_gym import Scene, SmaPulse
from seastar_gym.der.lanes import N_LANES
from seastar_gym.der.momentum import LOST, settle_momentum
from seastar_gym.der.numpy_lanes import Lanes, Mask
from seastar_gym.der.rods import Stage, make_work
from slopes import nodes, rows
from stages import RandomStages, robot_and_star

GAMMA = 5e-3


def settled(fluid: bool, gamma: float = GAMMA):
    """(star, stages, positions before and after) with the last robot not asked for."""
    robot, star = robot_and_star(5, 4, fluid=fluid)
    scene = Scene(robot, actuator=SmaPulse(0.1)) if fluid else Scene(robot, None, SmaPulse(0.1))
    rods, stages = scene.rods(), RandomStages(star, gamma, bend=0.05)
    work = make_work(rods, 1)
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(stages.q), rows(stages.q_hat), rows(stages.v_hat)
    stage = Stage(work.q_hat, work.v_hat, Lanes(gamma), Lanes(1.0 / gamma), False)
    settle_momentum.plain(rods, work, stage, Mask(np.arange(N_LANES) < N_LANES - 1))
    return star, stages, nodes(work.q)


def test_in_vacuum_one_step_balances_the_momentum_and_bends_no_limb():
    star, stages, q = settled(fluid=False)
    moves = q - stages.q
    np.testing.assert_array_equal(moves[-1], 0.0)
    np.testing.assert_allclose(moves, np.broadcast_to(moves[:, :1], moves.shape), rtol=0.0, atol=1e-16)
    for lane in range(N_LANES - 1):
        change = (q[lane] - stages.q_hat[lane]) / GAMMA - stages.v_hat[lane]
        assert np.abs(star.masses @ change).max() < 1e-13 * star.masses.sum()
        assert np.abs(oracle.incremental_gradient(star, q[lane], *stages.data(lane)).sum(axis=0)).max() < 1e-10


def test_in_a_fluid_steps_that_leave_digits_enough_stay_what_they_are():
    rate = float(Scene().rods().unsettled_rate[0])
    assert rate * GAMMA**2 < LOST
    _, stages, q = settled(fluid=True)
    np.testing.assert_array_equal(q, stages.q)
    gamma = 1.1 * np.sqrt(LOST / float(Scene(robot_and_star(5, 4)[0]).rods().unsettled_rate[0]))
    star, stages, q = settled(fluid=True, gamma=gamma)
    for lane in range(N_LANES - 1):
        before, after = (
            np.abs(oracle.incremental_gradient(star, x[lane], *stages.data(lane)).sum(axis=0)).max()
            for x in (stages.q, q)
        )
        assert after < before
