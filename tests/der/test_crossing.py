"""Limbs that came to cross: told from limbs that touch, that part, or that crossed before."""

import numpy as np
import pytest

from seastar_gym import Contact, Scene, Seastar, SmaPulse
from seastar_gym.der.contact.crossing import edges_cross, on_their_sides, without_new_crossings
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import NO_RODS, plain, rotated, rows

ROBOT = Seastar(5, 4)
RODS = make_rods(Scene(ROBOT, actuator=SmaPulse(0.1), contact=Contact()))
REST = ROBOT.nodes()
RNG = np.random.default_rng(0)
ODD = np.arange(N_LANES) % 2 == 1


def crossed(away: float = 0.0, limbs: tuple[int, int] = (0, 1)) -> np.ndarray:
    """The robot away from the origin, with the tip of one limb beyond the middle of the next."""
    turn = 0.4 * np.pi * limbs[0]
    q = rotated(REST, turn)  # the first of the two limbs lies along x
    q[3 * limbs[0] + 3] = 0.05 * np.array([np.cos(1.75), np.sin(1.75)])
    return rotated(q, -turn) + away


def found(q_1: np.ndarray, q_0: np.ndarray, ahead: bool = False, robots=None, missed=False) -> np.ndarray:
    """Who is uncrossed after a step from q_0 to q_1."""
    work = make_work(RODS, 1)
    work.q[:], work.q_hat[:] = rows(0.5 * (q_0 + q_1) if ahead else q_1), rows(q_0)
    work.contact.missed[:] = 1.0 * np.asarray(missed)
    stage = Stage(work.q_hat, work.v_hat, Lanes(1e-3), Lanes(1e3), ahead)
    asked = Mask(np.ones(N_LANES, bool) if robots is None else robots)
    return plain(without_new_crossings.plain(RODS, work, stage, rows(q_0), asked))


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("limbs", [(0, 1), (2, 3), (4, 0)])
@pytest.mark.parametrize("away", [0.0, 0.3])
def test_limbs_that_came_to_cross_are_seen_in_their_own_robot_alone(limbs, away, ahead):
    q_1 = np.where(ODD[:, None, None], crossed(away, limbs), REST + away)
    np.testing.assert_array_equal(found(q_1, REST + away, ahead), ~ODD)
    assert not found(q_1, REST + away, ahead, robots=ODD).any()


def test_limbs_that_crossed_before_may_part_again():
    assert found(crossed(), crossed()).all() and found(REST, crossed()).all()


def test_robots_whose_pairs_were_not_all_listed_are_left_out():
    np.testing.assert_array_equal(found(REST, REST, missed=ODD), ~ODD)


def test_without_contact_nobody_is_left_out():
    everyone = Mask(np.ones(N_LANES, bool))
    assert without_new_crossings.plain(NO_RODS, None, None, None, everyone) is everyone


def test_limbs_are_on_their_sides_of_a_line_across_the_difference_of_their_roots():
    """Of bent robots away from the origin, some with limbs that come near to each other."""
    q_0 = REST + 0.2 + 2e-3 * RNG.standard_normal((N_LANES, *REST.shape))
    q_1 = q_0 + 0.02 * RNG.standard_normal(q_0.shape)
    seen = plain(on_their_sides.plain(RODS, rows(q_1), rows(q_0), 1, 2))
    for lane in range(N_LANES):
        a, b = (root / np.linalg.norm(root) for root in q_0[lane, [4, 7]] - q_0[lane, 0])
        across = b - a + rotated(a + b, 0.5 * np.pi)
        right, left = ((q_1[lane, 3 * limb + 1 : 3 * limb + 4] - q_1[lane, 0]) @ across for limb in (1, 2))
        assert seen[lane] == (right.max() < 0.0 < left.min())
    assert 0 < seen.sum() < N_LANES


def test_edges_cross_where_the_lines_through_them_meet_within_both():
    q = RNG.standard_normal((40, N_LANES, ROBOT.n_nodes, 2))
    for nodes in q:
        seen = plain(edges_cross.plain(RODS, rows(nodes), 1, 5))
        for lane in range(N_LANES):
            (i, k), (j, m) = nodes[lane, [1, 2]], nodes[lane, [5, 6]]
            shares = np.linalg.solve(np.stack([k - i, j - m], axis=1), j - i)
            assert seen[lane] == np.all((shares > 0.0) & (shares < 1.0))
