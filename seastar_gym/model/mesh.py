"""Mesh of a robot: its limbs, divided into edges and nodes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.mesh import Mesh, Sections, mean
from seastar_gym.scene.limb import LimbShape
from seastar_gym.scene.number import profile_at
from seastar_gym.scene.shape import turn_per_hinge

Floats = NDArray[np.float64]


def make_mesh(limbs: Sequence[LimbShape], nodes_per_limb: int, density: float) -> Mesh:
    """Mesh of limbs of a density [kg/m^3] with nodes_per_limb - 1 edges of equal lengths each."""
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
        at_edges=sections(limbs, density, at_edges, (-1,)),
        at_nodes=sections(limbs, density, at_nodes, (n_limbs, nodes_per_limb)),
        modulus_at_edges=np.concatenate([profile_at(limb.youngs_modulus, at_edges) for limb in limbs]),
        modulus_at_nodes=np.array([profile_at(limb.youngs_modulus, at_nodes) for limb in limbs]),
        natural_turn=[turn_per_hinge(limb, nodes_per_limb) for limb in limbs],
    )


def sections(limbs: Sequence[LimbShape], density: float, share: Floats, shape: tuple[int, ...]) -> Sections:
    """Cross sections of all limbs at fractions of their lengths, as arrays of a shape."""
    unlike = {(limb.section, limb.youngs_modulus): limb for limb in limbs}
    found = {each: limb.cuts(density, share) for each, limb in unlike.items()}
    columns = np.array([cut for limb in limbs for cut in found[limb.section, limb.youngs_modulus]]).T
    return Sections(*columns.reshape(len(columns), *shape))


def nodes_along(nodes_per_limb: int) -> Floats:
    """Positions of a limb's nodes as fractions of its length from hub to tip, shape (nodes_per_limb,)."""
    return np.arange(nodes_per_limb) / (nodes_per_limb - 1)


def edges_along(nodes_per_limb: int) -> Floats:
    """Positions of the middles of a limb's edges as fractions of its length, shape (nodes_per_limb - 1,)."""
    return (np.arange(nodes_per_limb - 1) + 0.5) / (nodes_per_limb - 1)
