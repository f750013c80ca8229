"""Limbs cut into edges and nodes: what the coefficients of all terms are made from."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


class Sections(NamedTuple):
    """Cross sections at places of limbs: of every edge in its middle, or of the nodes of every limb from hub to tip.

    area: Of the material [m^2]. displaced: Of the fluid that it takes the place of [m^2]. inert: Area of the robot's
        density that weighs as much [m^2].
    EI: Bending stiffness [N m^2]. thickness: Radius of the disc with the same EI/EA [m].
    width: Diameter that flow across sees [m]. added: Area of the fluid that moves along across [m^2].
    reach: Distance from the centre line at which limbs touch [m].
    """

    area: Floats
    displaced: Floats
    inert: Floats
    EI: Floats
    thickness: Floats
    width: Floats
    added: Floats
    reach: Floats


class Mesh(NamedTuple):
    """Lengths, cross sections and moduli of a robot's edges and nodes, in the order of star.py.

    n_limbs, nodes_per_limb: Numbers of limbs, and of nodes of a limb with the hub.
    l: Natural length, per edge [m]. dl: Voronoi length, per node [m]; the hub has half of every root edge.
    root_edges: Natural length of the root edges, per limb [m]. limb_lengths: Lengths of the limbs [m].
    at_edges, at_nodes: Cross sections, shape (n_edges,), and (n_limbs, nodes_per_limb) with the hub once per limb.
    modulus_at_edges, modulus_at_nodes: Young's modulus likewise [Pa].
    natural_turn: Natural angle of the hinges within every limb [rad].
    """

    n_limbs: int
    nodes_per_limb: int
    l: Floats  # noqa: E741
    dl: Floats
    root_edges: Floats
    limb_lengths: list[float]
    at_edges: Sections
    at_nodes: Sections
    modulus_at_edges: Floats
    modulus_at_nodes: Floats
    natural_turn: list[float]

    def per_node(self, at_nodes: Floats) -> Floats:
        """Numbers per node from those at the nodes of every limb; at the hub the mean of what the limbs have there."""
        return np.concatenate([[mean(at_nodes[:, 0], self.root_edges)], at_nodes[:, 1:].ravel()])

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
