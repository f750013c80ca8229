"""The whole robot's own Newton step: it balances the momentum, and moves nobody who was not asked for."""

import numpy as np
import pytest

import oracle
from hubs import HUBS, TEN
from seastar_gym import Scene, SmaPulse
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.momentum import LOST, correct_momentum, move_as_a_whole
from seastar_gym.der.stepping.newton import take_step
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import nodes, plain, rows
from stages import RandomStages, robot_and_star, rods_of, turn_limbs
from touching import touching_limbs

GAMMA = 5e-3


def pushed(star, q: np.ndarray, q_hat: np.ndarray, v_hat: np.ndarray, gamma: float) -> np.ndarray:
    """What inertia and drag leave unbalanced of the whole robot [N]."""
    v = (q - q_hat) / gamma
    return star.masses @ (v - v_hat) / gamma - oracle.drag_force(star, v).sum(axis=0)


def moved(hub: str, fluid: bool, robots: np.ndarray, times: int = 1):
    """(unbalanced forces before and after [N], positions before and after)."""
    robot, star = robot_and_star(5, 4, hub, fluid)
    rods, rng = rods_of(robot, fluid), np.random.default_rng(0)
    work = make_work(rods, 1)
    work.q[:], work.v_hat[:] = 1e-3 * rng.standard_normal((2, *work.q.shape))
    stage = Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)

    def unbalanced() -> np.ndarray:
        states = zip(nodes(work.q), nodes(work.q_hat), nodes(work.v_hat), strict=True)
        return np.array([np.hypot(*pushed(star, *state, GAMMA)) for state in states])

    before, q = unbalanced(), nodes(work.q)
    for _ in range(times):
        move_as_a_whole.plain(rods, work, SCHEMES["implicit-euler"], 0, stage, Mask(robots))
    return before, unbalanced(), q, nodes(work.q)


EVERYONE = np.ones(N_LANES, bool)


@pytest.mark.parametrize("hub", HUBS[:2])
def test_in_vacuum_one_move_balances_the_momentum(hub):
    before, after, _, _ = moved(hub, False, EVERYONE)
    assert np.all(after < 1e-13 * before)


@pytest.mark.parametrize("hub", HUBS[:2])
@pytest.mark.parametrize("times, left", [(1, 0.2), (5, 1e-9)])
def test_in_a_fluid_moves_are_those_of_newtons_method(times, left, hub):
    before, after, _, _ = moved(hub, True, EVERYONE, times)
    assert np.all(after < left * before)


def test_all_nodes_of_the_chosen_robots_move_alike_and_nobody_else_does():
    chosen = np.arange(N_LANES) % 2 == 0
    _, _, before, after = moved("rigid", True, chosen)
    np.testing.assert_array_equal(after[~chosen], before[~chosen])
    moves = (after - before)[chosen]
    assert np.all(np.linalg.norm(moves[:, 0], axis=1) > 0.0)
    np.testing.assert_allclose(moves, np.broadcast_to(moves[:, :1], moves.shape), rtol=1e-9, atol=1e-15)


def settled(fluid: bool, gamma: float = GAMMA):
    """(star, stages, positions before and after) with the last robot not asked for."""
    robot, star = robot_and_star(5, 4, fluid=fluid)
    scene = Scene(robot, actuator=SmaPulse(0.1)) if fluid else Scene(robot, None, SmaPulse(0.1))
    rods, stages = make_rods(scene), RandomStages(star, gamma, bend=0.05)
    work = make_work(rods, 1)
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(stages.q), rows(stages.q_hat), rows(stages.v_hat)
    stage = Stage(work.q_hat, work.v_hat, Lanes(gamma), Lanes(1.0 / gamma), False)
    robots = Mask(np.arange(N_LANES) < N_LANES - 1)
    correct_momentum.plain(rods, work, SCHEMES["implicit-euler"], 0, stage, work.q_hat, work.v_hat, gamma, robots)
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
    rate = float(make_rods(Scene(TEN)).scales.stiffness_ratio[0])
    assert rate * GAMMA**2 < LOST
    _, stages, q = settled(fluid=True)
    np.testing.assert_array_equal(q, stages.q)
    gamma = 1.1 * np.sqrt(LOST / float(make_rods(Scene(robot_and_star(5, 4)[0])).scales.stiffness_ratio[0]))
    star, stages, q = settled(fluid=True, gamma=gamma)
    for lane in range(N_LANES - 1):
        before, after = (
            np.abs(oracle.incremental_gradient(star, x[lane], *stages.data(lane)).sum(axis=0)).max()
            for x in (stages.q, q)
        )
        assert after < before


def test_what_contact_pushed_when_it_was_last_asked_moves_no_robot_as_a_whole():
    """As long as others in the lanes go on, contact is asked again where a robot has arrived already."""
    found = []
    for force in (0.0, 1.0):
        limbs = touching_limbs()
        limbs.work.contact.force[:] = force * np.random.default_rng(1).standard_normal(limbs.work.q.shape)
        move_as_a_whole.plain(limbs.rods, limbs.work, SCHEMES["implicit-euler"], 0, limbs.stage, Mask(EVERYONE))
        found.append(limbs.work.q.copy())
    np.testing.assert_array_equal(*found)


def test_where_momentum_begins_to_be_settled_in_a_fluid_rounding_is_some_1e_10_of_a_newton_step():
    """Measured with limbs of three edges and in vacuum, where nothing else is left of the momentum."""
    robot, star = robot_and_star(5, 4, fluid=False)
    rods, rate = rods_of(robot, fluid=False), float(rods_of(robot).scales.stiffness_ratio[0])
    gamma = np.sqrt(LOST / rate)
    stages, work = RandomStages(star, gamma, bend=1e-3, stretch=1e-6, speed=1e-3), make_work(rods, 1)
    work.q[:], work.q_hat[:] = rows(stages.q), rows(stages.q_hat)
    turn_limbs(work, star, stages.delta_psi)
    stage = Stage(work.q_hat, work.v_hat, Lanes(gamma), Lanes(1.0 / gamma), False)
    factorise.plain(rods, work, stage, None)
    move = plain(take_step.plain(rods, work, Mask(EVERYONE), None, Lanes(0.0)))
    states = zip(nodes(work.q), nodes(work.q_hat), nodes(work.v_hat), strict=True)
    forces = np.array([np.hypot(*pushed(star, *state, gamma)) for state in states])
    shift = forces * gamma**2 / rods.mass.sum()
    assert 3e-11 < (shift / move).max() < 1e-9
