"""Mesh of a robot: its limbs, divided into edges and nodes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.mesh import Mesh, mean
from seastar_gym.scene.limb import LimbShape, along
from seastar_gym.scene.shape import turn_per_hinge

Floats = NDArray[np.float64]


def make_mesh(limbs: Sequence[LimbShape], nodes_per_limb: int) -> Mesh:
    """Mesh of limbs with nodes_per_limb - 1 edges of equal lengths each."""
    n_limbs, n_edges = len(limbs), nodes_per_limb - 1
    root_edges = np.array([limb.length / n_edges for limb in limbs])
    l = np.repeat(root_edges, n_edges)  # noqa: E741
    edges_at_node = np.where(np.arange(n_edges) < n_edges - 1, 1.0, 0.5)
    at_edges, at_nodes = edges_along(nodes_per_limb), nodes_along(nodes_per_limb)
    return Mesh(
        n_limbs=n_limbs,
        nodes_per_limb=int(nodes_per_limb),
        l=l,
        dl=np.concatenate([[0.5 * n_limbs * mean(root_edges)], l * np.tile(edges_at_node, n_limbs)]),
        root_edges=root_edges,
        limb_lengths=[limb.length for limb in limbs],
        radius_at_edges=[r for limb in limbs for r in along(limb.radius, at_edges)],
        radius_at_nodes=[along(limb.radius, at_nodes) for limb in limbs],
        modulus_at_edges=[E for limb in limbs for E in along(limb.youngs_modulus, at_edges)],
        modulus_at_nodes=[along(limb.youngs_modulus, at_nodes) for limb in limbs],
        natural_turn=[turn_per_hinge(limb, nodes_per_limb) for limb in limbs],
    )


def nodes_along(nodes_per_limb: int) -> Floats:
    """Positions of a limb's nodes as fractions of its length from hub to tip, shape (nodes_per_limb,)."""
    return np.arange(nodes_per_limb) / (nodes_per_limb - 1)


def edges_along(nodes_per_limb: int) -> Floats:
    """Positions of the middles of a limb's edges as fractions of its length, shape (nodes_per_limb - 1,)."""
    return (np.arange(nodes_per_limb - 1) + 0.5) / (nodes_per_limb - 1)
