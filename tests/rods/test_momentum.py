"""The whole robot's own Newton step: it balances the momentum, and moves nobody who was not asked for."""

import numpy as np
import pytest

import oracle
from hubs import HUBS
from oracle import Star
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.rods.bundles import Rods
from seastar_gym.rods.guard import LOST, correct_momentum, move_as_a_whole
from seastar_gym.rods.step import SCHEMES
from slopes import nodes
from stages import EVERYONE, RandomStages, robot_and_star, rods_of
from touching import touching_limbs

EULER, GAMMA = SCHEMES["implicit-euler"], 5e-3
CHOSEN = np.arange(N_LANES) % 2 == 0


def unbalanced(star: Star, q: np.ndarray, stages: RandomStages) -> np.ndarray:
    """What inertia and drag leave unbalanced of whole robots [N], shape (N_LANES,)."""
    v = (q - stages.q_hat) / stages.gamma
    push = star.masses @ (v - stages.v_hat) / stages.gamma
    return np.linalg.norm(push - [oracle.drag_force(star, one).sum(axis=0) for one in v], axis=1)


def of(hub: str, fluid: bool, gamma: float = GAMMA, **size: float) -> tuple[Rods, RandomStages]:
    robot, star = robot_and_star(5, 4, hub, fluid)
    return rods_of(robot, fluid), RandomStages(star, gamma, **size)


def lost_at(gamma: float) -> float:
    """Stiffness of edges over inertia at such a step, over the LOST of a robot in water."""
    return float(rods_of(robot_and_star(5, 4)[0]).scales.stiffness_ratio[0]) * gamma**2 / LOST


@pytest.mark.parametrize("hub", HUBS[:2])
@pytest.mark.parametrize("fluid, times, left", [(False, 1, 1e-12), (True, 1, 0.2), (True, 5, 1e-9)])
def test_moves_of_the_chosen_robots_are_newtons_and_exact_in_vacuum_and_bend_no_limb(fluid, times, left, hub):
    rods, stages = of(hub, fluid, speed=0.05)
    work, stage = stages.begin(rods)
    for _ in range(times):
        move_as_a_whole(rods, work, EULER, 0, stage, Mask(CHOSEN))
    q = nodes(work.q)
    before, after = (unbalanced(stages.star, places, stages) for places in (stages.q, q))
    assert np.all(after[CHOSEN] < left * before[CHOSEN])
    np.testing.assert_array_equal(q[~CHOSEN], stages.q[~CHOSEN])
    moves = (q - stages.q)[CHOSEN]
    np.testing.assert_allclose(moves, np.broadcast_to(moves[:, :1], moves.shape), rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("fluid, steps", [(False, 1e-3), (True, 1.1), (True, 0.9)])
def test_momentum_is_corrected_in_vacuum_and_in_a_fluid_where_digits_are_lost(fluid, steps):
    """steps: Over those at which that begins in a fluid."""
    rods, stages = of("rigid", fluid, steps * GAMMA / np.sqrt(lost_at(GAMMA)), bend=0.05)
    work, stage = stages.begin(rods)
    correct_momentum(
        rods, work, EULER, 0, stage, work.q_hat, work.v_hat, Lanes(stages.gamma), Mask(CHOSEN)
    )  # fmt: skip
    before, after = (unbalanced(stages.star, places, stages) for places in (stages.q, nodes(work.q)))
    corrected = CHOSEN & (steps > 1.0 or not fluid)
    assert np.all(after[corrected] < before[corrected])
    np.testing.assert_array_equal(nodes(work.q)[~corrected], stages.q[~corrected])


def test_what_contact_pushed_when_it_was_last_asked_moves_no_robot_as_a_whole():
    """As long as others in the lanes go on, contact is asked again where a robot has arrived already."""
    found = []
    for force in (0.0, 1.0):
        limbs = touching_limbs()
        limbs.work.contact.force[:] = force * np.random.default_rng(1).standard_normal(limbs.work.q.shape)
        move_as_a_whole(limbs.rods, limbs.work, EULER, 0, limbs.stage, EVERYONE)
        found.append(limbs.work.q.copy())
    np.testing.assert_array_equal(*found)
