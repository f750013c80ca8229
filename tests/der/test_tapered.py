"""Coefficients of limbs that taper, edge by edge and node by node, from the chapter's formulas themselves.

Those of the continuum are made of them, see tests/simulator/test_oracle_steps.py.
"""

import numpy as np
import pytest

from seastar_gym import Limb, Scene, Seastar, Water
from seastar_gym.der.rods import make_work
from seastar_gym.der.terms.added_mass import freeze_added_mass
from seastar_gym.der.terms.drag import add_cross_flow
from seastar_gym.der.terms.fluid import freeze_normals
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import NOTHING, plain, rows, symmetric

LENGTH, EDGE = 0.09, 0.03
LIMBS = tuple(Limb(length=LENGTH, radius=(2e-3 + 2e-4 * k, 1e-3)) for k in range(5))
ROBOT = Seastar(5, 4, limbs=LIMBS, density=1100.0, discretisation="chapter")
WATER = Water(950.0, 1.3, 0.2, None, 0.7)
RODS = make_rods(Scene(ROBOT, WATER, gravity=(0.3, -9.81), loads=((7, 0.1, 0.0), (7, 0.2, -0.5))))
Q = ROBOT.nodes() + 2e-3 * np.random.default_rng(0).standard_normal((ROBOT.n_nodes, 2))


def radius(limb: int, share: float) -> float:
    start, end = LIMBS[limb].radius
    return start + share * (end - start)


def radii_of_edges() -> list[float]:
    return [radius(e // 3, (e % 3 + 0.5) / 3) for e in range(15)]


def edges_of(node: int) -> list[int]:
    """Those that end or begin at a node; edge e ends at node e + 1."""
    if node == 0:
        return list(range(0, 15, 3))
    return [node - 1] if node % 3 == 0 else [node - 1, node]


def normals() -> np.ndarray:
    """Unit normals of all edges, shape (15, 2)."""
    tails = [0 if e % 3 == 0 else e for e in range(15)]
    edges = Q[1:] - Q[tails]
    return np.stack([-edges[:, 1], edges[:, 0]], axis=1) / np.linalg.norm(edges, axis=1)[:, None]


def frozen():
    work = make_work(RODS, 1)
    freeze_normals.plain(RODS, work, rows(Q))
    freeze_added_mass.plain(RODS, work)
    return work


@pytest.mark.parametrize("node", range(16))
def test_drag_across_is_that_of_the_halves_of_a_nodes_edges_by_their_own_radii(node):
    w, n = np.array([0.3, -0.2]), normals()
    expected = sum(
        0.5 * 950.0 * (1.3 - 0.2) * 2.0 * radii_of_edges()[e] * 0.5 * EDGE * abs(n[e] @ w) * (n[e] @ w) * n[e]
        for e in edges_of(node)
    )
    _, force, _ = add_cross_flow.plain(RODS, frozen().normals, node, *map(Lanes, w), Lanes(1.0), Lanes(1.0), NOTHING)
    np.testing.assert_allclose([x[0] for x in plain(force)], expected, rtol=1e-12)


@pytest.mark.parametrize("node", range(16))
def test_added_mass_is_that_of_the_halves_of_a_nodes_edges_by_their_own_radii(node):
    n = normals()
    expected = sum(
        950.0 * 0.7 * np.pi * radii_of_edges()[e] ** 2 * 0.5 * EDGE * np.outer(n[e], n[e]) for e in edges_of(node)
    )
    mass = frozen().added_mass.reshape(-1, 3, N_LANES)[node, :, 0]
    np.testing.assert_allclose(symmetric(tuple(mass)), expected, rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("node", range(1, 16))
def test_mass_drag_and_weight_of_a_node_are_those_of_its_radius_and_its_share_of_the_limb(node):
    limb, at = (node - 1) // 3, (node - 1) % 3 + 1
    r, dl = radius(limb, at / 3), EDGE if at < 3 else 0.5 * EDGE
    volume = np.pi * r**2 * dl
    assert RODS.mass[node] == pytest.approx(1100.0 * volume, rel=1e-12)
    assert RODS.drag[node] == pytest.approx(0.5 * 950.0 * 0.2 * 2.0 * r * dl, rel=1e-12)
    force = (1100.0 - 950.0) * volume * np.array([0.3, -9.81]) + (node == 7) * np.array([0.3, -0.5])
    np.testing.assert_allclose(RODS.load.reshape(-1, 2)[node], force, rtol=1e-12)


def test_the_hub_has_half_of_every_root_edge_with_the_mean_of_what_the_limbs_have_there():
    roots = np.array([radius(limb, 0.0) for limb in range(5)])
    assert RODS.mass[0] == pytest.approx(1100.0 * np.pi * np.mean(roots**2) * 2.5 * EDGE, rel=1e-12)
    assert RODS.drag[0] == pytest.approx(0.5 * 950.0 * 0.2 * 2.0 * np.mean(roots) * 2.5 * EDGE, rel=1e-12)


def test_tips_have_no_outer_edge_and_the_hubs_edges_are_those_of_its_neighbours():
    for per_half_edge in (RODS.cross_drag, RODS.added_mass):
        inner, outer = per_half_edge.reshape(-1, 2).T
        np.testing.assert_array_equal(np.flatnonzero(inner == 0.0), [0])
        np.testing.assert_array_equal(np.flatnonzero(outer == 0.0), [0, 3, 6, 9, 12, 15])


def test_two_limbs_have_one_hub_hinge():
    bending = make_rods(Scene(Seastar(2, 4, hub_hinge="turning", discretisation="chapter"))).bending
    assert bending.EI_over_dl[0] == pytest.approx(bending.EI_over_dl[1]) and bending.EI_over_dl[3] == 0.0
    assert bending.dl_over_EI[0] == pytest.approx(bending.dl_over_EI[1]) and bending.dl_over_EI[3] == 0.0
