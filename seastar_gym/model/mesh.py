"""Limbs cut into edges and nodes: what the coefficients of all terms are made from."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene.limb import LimbShape, along

Floats = NDArray[np.float64]


class Mesh(NamedTuple):
    """Lengths and radii of a robot's edges and nodes; edges and nodes are ordered as in der/rods.py.

    l: Natural length, per edge [m]. dl: Voronoi length, per node [m]; the hub has half of every root edge.
    root_edges: Natural length of the root edges, per limb [m].
    radius_at_edges: In the middle of every edge [m].
    radius_at_nodes: Of every limb from hub to tip, the hub once per limb [m].
    """

    l: Floats  # noqa: E741
    dl: Floats
    root_edges: Floats
    radius_at_edges: list[float]
    radius_at_nodes: list[list[float]]

    def per_node(self, of_radius: Callable[[float], float]) -> Floats:
        """A function of the radius, per node; at the hub the mean of what the limbs have there."""
        values = [[of_radius(r) for r in radii] for radii in self.radius_at_nodes]
        hub = mean([of_limb[0] for of_limb in values], self.root_edges)
        return np.array([hub, *(value for of_limb in values for value in of_limb[1:])])

    def per_half_edge(self, of_edges: Floats) -> Floats:
        """Numbers per edge as those of the inner and the outer edge of every node in turn, shape (2 n_nodes,).

        Zero for the outer edge of tips, and for the hub: its edges are the inner ones of the root nodes.
        """
        inner = of_edges.reshape(len(self.root_edges), -1)
        outer = np.zeros_like(inner)
        outer[:, :-1] = inner[:, 1:]
        return np.concatenate([np.zeros(2), np.stack([inner, outer], axis=2).ravel()])


def make_mesh(limbs: Sequence[LimbShape], nodes_per_limb: int) -> Mesh:
    """Every limb in nodes_per_limb - 1 edges of equal lengths."""
    n_limbs, n_edges = len(limbs), nodes_per_limb - 1
    root_edges = np.array([limb.length / n_edges for limb in limbs])
    l = np.repeat(root_edges, n_edges)  # noqa: E741
    edges_at_node = np.where(np.arange(n_edges) < n_edges - 1, 1.0, 0.5)
    return Mesh(
        l=l,
        dl=np.concatenate([[0.5 * n_limbs * mean(root_edges)], l * np.tile(edges_at_node, n_limbs)]),
        root_edges=root_edges,
        radius_at_edges=[r for limb in limbs for r in along(limb.radius, edges_along(nodes_per_limb))],
        radius_at_nodes=[along(limb.radius, nodes_along(nodes_per_limb)) for limb in limbs],
    )


def nodes_along(nodes_per_limb: int) -> Floats:
    """Where the nodes of a limb are, as shares of the way from hub to tip."""
    return np.arange(nodes_per_limb) / (nodes_per_limb - 1)


def edges_along(nodes_per_limb: int) -> Floats:
    """Where the middles of a limb's edges are, likewise."""
    return (np.arange(nodes_per_limb - 1) + 0.5) / (nodes_per_limb - 1)


def mean(values: ArrayLike, weights: Floats | None = None) -> float:
    """Mean that is exact where all values are equal."""
    values = np.asarray(values, dtype=float)
    return float(values[0] + np.average(values - values[0], weights=weights))
