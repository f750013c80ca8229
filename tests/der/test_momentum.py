"""The move of the whole robot that balances its momentum."""

import numpy as np
import pytest

from seastar_gym import Scene, Seastar
from seastar_gym.der.potential import node_slopes
from seastar_gym.der.rods import Stage, make_work
from seastar_gym.der.stepping.momentum import move_as_a_whole
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import nodes, plain

ROBOT, GAMMA = Seastar(nodes_per_limb=4), 0.01


def moved(scene: Scene, robots: np.ndarray, times: int = 1):
    """(unbalanced forces before and after [N], positions before and after)."""
    rods, rng = make_rods(scene), np.random.default_rng(0)
    work = make_work(rods, 1)
    work.q[:], work.v_hat[:] = 1e-3 * rng.standard_normal((2, *work.q.shape))
    stage = Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)

    def unbalanced() -> np.ndarray:
        slopes = [node_slopes.plain(rods, work, stage, node)[1] for node in range(ROBOT.n_nodes)]
        return np.linalg.norm(np.sum(plain(tuple(slopes)), axis=0), axis=0)

    before, q = unbalanced(), nodes(work.q)
    for _ in range(times):
        move_as_a_whole.plain(rods, work, stage, Mask(robots))
    return before, unbalanced(), q, nodes(work.q)


EVERYONE = np.ones(N_LANES, bool)


def test_in_vacuum_one_move_balances_the_momentum():
    before, after, _, _ = moved(Scene(ROBOT, None), EVERYONE)
    assert np.all(after < 1e-13 * before)


@pytest.mark.parametrize("times, left", [(1, 0.2), (5, 1e-9)])
def test_in_a_fluid_moves_are_those_of_newtons_method(times, left):
    before, after, _, _ = moved(Scene(ROBOT), EVERYONE, times)
    assert np.all(after < left * before)


def test_all_nodes_of_the_chosen_robots_move_alike_and_nobody_else_does():
    chosen = np.arange(N_LANES) % 2 == 0
    _, _, before, after = moved(Scene(ROBOT), chosen)
    np.testing.assert_array_equal(after[~chosen], before[~chosen])
    moves = (after - before)[chosen]
    assert np.all(np.linalg.norm(moves[:, 0], axis=1) > 0.0)
    np.testing.assert_allclose(moves, np.broadcast_to(moves[:, :1], moves.shape), rtol=1e-9, atol=1e-15)
