"""Elimination of a star of chains solves what a dense matrix of the same blocks solves."""

import itertools
from itertools import pairwise

import numpy as np
import pytest

from hubs import HUBS
from seastar_gym import Contact, Scene, Seastar, SmaPulse
from seastar_gym.der.linear.star_matrix import eliminate_node, pivots, smaller, solve_lone_root, solve_ring, store_root
from seastar_gym.der.linear.star_solution import solve_again, substitute_star
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import nodes, plain, rows
from stages import RandomStages, robot_and_star, turn_limbs

ZERO = Lanes(0.0)


def neighbours(n_limbs: int, nodes_per_limb: int) -> np.ndarray:
    """Which nodes couple: those of a limb up to the second next, root nodes with the ring's neighbours and the hub."""
    edges = nodes_per_limb - 1
    coupled = np.eye(n_limbs * edges + 1, dtype=bool)
    for limb in range(n_limbs):
        chain = [0, *range(limb * edges + 1, limb * edges + edges + 1)]
        for i, j in [*pairwise(chain), *zip(chain, chain[2:], strict=False)]:
            coupled[i, j] = coupled[j, i] = True
    return coupled


def blocks_of(matrix: np.ndarray, i: int, j: int) -> np.ndarray:
    """A node's 2 x 2 block with another, shape (2, 2, N_LANES)."""
    return matrix[:, 2 * i : 2 * i + 2, 2 * j : 2 * j + 2].transpose(1, 2, 0)


def symmetric(block):
    return Lanes(block[0, 0]), Lanes(block[0, 1]), Lanes(block[1, 1])


def coupling(block):
    return tuple(Lanes(block[i, j]) for i in range(2) for j in range(2))


def random_system(n_limbs: int, nodes_per_limb: int, hub: np.ndarray):
    """Symmetric matrices, one per lane, with the pattern of a star, and right-hand sides; hub: Blocks of hub hinges."""
    rng, n = np.random.default_rng(n_limbs), n_limbs * (nodes_per_limb - 1) + 1
    pattern = np.kron(neighbours(n_limbs, nodes_per_limb), np.ones((2, 2)))
    matrix = rng.standard_normal((N_LANES, 2 * n, 2 * n)) * pattern
    matrix = matrix + matrix.transpose(0, 2, 1) + 12.0 * np.eye(2 * n)
    full = matrix.copy()
    for a in range(n_limbs):
        Q, b = hub[a].transpose(2, 0, 1), (a + 1) % n_limbs
        at_a, at_b = ((nodes_per_limb - 1) * limb + 1 for limb in (a, b))
        for i, j, block in ((at_b, at_a, -Q), (at_b, 0, Q), (at_a, 0, Q.transpose(0, 2, 1)), (0, 0, -Q)):
            full[:, 2 * i : 2 * i + 2, 2 * j : 2 * j + 2] += block
            full[:, 2 * j : 2 * j + 2, 2 * i : 2 * i + 2] += block.transpose(0, 2, 1)
    return matrix, full, rng.standard_normal((N_LANES, 2 * n))


def solution(n_limbs: int, nodes_per_limb: int, matrix: np.ndarray, r: np.ndarray, hub: np.ndarray):
    """(x, decrement, smallest pivot) by the kernels, limb by limb from tip to root, then ring and hub."""
    measure = "opening" if n_limbs == 1 else "turning"
    robot = Seastar(n_limbs, nodes_per_limb, hub_hinge=measure, discretisation="chapter")
    rods = make_rods(Scene(robot, actuator=SmaPulse(0.0)))
    work, edges = make_work(rods, 1, again=True), nodes_per_limb - 1
    work.hub_coupling[:] = hub.reshape(-1, N_LANES)

    def at(i):
        return [Lanes(x) for x in r[:, 2 * i : 2 * i + 2].T]

    D_hub, r_hub, decrement, pivot = symmetric(blocks_of(matrix, 0, 0)), at(0), ZERO, Lanes(np.inf)
    for limb in range(n_limbs):
        chain = [0, *range(limb * edges + 1, limb * edges + edges + 1)]
        D = {i: symmetric(blocks_of(matrix, i, i)) for i in chain[1:]} | {0: D_hub}
        B = {(i, j): coupling(blocks_of(matrix, i, j)) for i, j in zip(chain[1:], chain, strict=False)}
        right = {i: at(i) for i in chain[1:]} | {0: r_hub}
        for k in range(edges, 1, -1):
            node, one, two = chain[k], chain[k - 1], chain[k - 2]
            D[one], B[one, two], D[two], right[one], right[two], part, smallest = eliminate_node.plain(
                work, node, D[node], B[node, one], coupling(blocks_of(matrix, node, two)), right[node],
                D[one], B[one, two], D[two], right[one], right[two],
            )  # fmt: skip
            decrement, pivot = decrement + part, smaller.plain(pivot, smallest)
        store_root.plain(work, limb, D[chain[1]], B[chain[1], 0], right[chain[1]])
        D_hub, r_hub = D[0], right[0]
    last = solve_ring.plain(work, n_limbs, D_hub, r_hub) if n_limbs > 1 else solve_lone_root.plain(work, D_hub, r_hub)
    substitute_star.plain(rods, work, work.step)
    again = np.ascontiguousarray(r.T)
    solve_again.plain(rods, work, again, again)
    np.testing.assert_allclose(again, work.step, rtol=0.0, atol=1e-12 * np.abs(work.step).max())
    return nodes(work.step).reshape(N_LANES, -1), *plain((decrement + last[0], smaller.plain(pivot, last[1])))


SHAPES = [(5, 4), (5, 2), (3, 3), (2, 4), (1, 5), (7, 3)]


@pytest.mark.parametrize("n_limbs, nodes_per_limb", SHAPES)
def test_solution_decrement_and_sign_of_the_pivots_are_those_of_the_dense_matrix(n_limbs, nodes_per_limb):
    hub = (n_limbs > 1) * np.random.default_rng(1).standard_normal((n_limbs, 2, 2, N_LANES))
    matrix, full, r = random_system(n_limbs, nodes_per_limb, hub)
    matrix[0] -= 9.0 * np.eye(len(r[0]))
    full[0] -= 9.0 * np.eye(len(r[0]))  # not definite
    x, decrement, pivot = solution(n_limbs, nodes_per_limb, matrix, r, hub)
    expected = np.linalg.solve(full, r[..., None])[..., 0]
    np.testing.assert_allclose(x, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(decrement, (r * expected).sum(axis=1), rtol=1e-8)
    np.testing.assert_array_equal(pivot > 0.0, np.linalg.eigvalsh(full)[:, 0] > 0.0)


def test_pivots_are_those_of_a_two_by_two_block():
    D = np.array([[4.0, 1.0], [1.0, 3.0]])
    inverse_x, lower, inverse_y, wr, smallest = plain(
        pivots.plain((Lanes(4.0), Lanes(1.0), Lanes(3.0)), (Lanes(2.0), Lanes(5.0)))
    )
    L = np.array([[1.0, 0.0], [lower, 1.0]])
    np.testing.assert_allclose(L @ np.diag([1.0 / inverse_x, 1.0 / inverse_y]) @ L.T, D, rtol=1e-14)
    assert wr == 5.0 - lower * 2.0 and smallest == 1.0 / inverse_y


def test_a_pivot_that_is_not_a_number_does_not_pass_for_a_good_one():
    assert np.isnan(plain(smaller.plain(Lanes(1.0), Lanes(np.nan))))


# Solutions of an eliminated system for other right-hand sides.


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
