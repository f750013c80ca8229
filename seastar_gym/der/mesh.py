"""Limbs cut into edges and nodes: what the coefficients of all terms are made from."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


class Mesh(NamedTuple):
    """Lengths, radii and moduli of a robot's edges and nodes, in the order of star.py.

    n_limbs, nodes_per_limb: Numbers of limbs, and of nodes of a limb with the hub.
    l: Natural length, per edge [m]. dl: Voronoi length, per node [m]; the hub has half of every root edge.
    root_edges: Natural length of the root edges, per limb [m]. limb_lengths: Lengths of the limbs [m].
    radius_at_edges: Radius in the middle of every edge [m].
    radius_at_nodes: Radius at the nodes of every limb from hub to tip [m], the hub once per limb.
    modulus_at_edges, modulus_at_nodes: Young's modulus likewise [Pa].
    natural_turn: Natural angle of the hinges within every limb [rad].
    """

    n_limbs: int
    nodes_per_limb: int
    l: Floats  # noqa: E741
    dl: Floats
    root_edges: Floats
    limb_lengths: list[float]
    radius_at_edges: list[float]
    radius_at_nodes: list[list[float]]
    modulus_at_edges: list[float]
    modulus_at_nodes: list[list[float]]
    natural_turn: list[float]

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


def mean(values: ArrayLike, weights: Floats | None = None) -> float:
    """Mean that is exact where all values are equal."""
    values = np.asarray(values, dtype=float)
    return float(values[0] + np.average(values - values[0], weights=weights))
