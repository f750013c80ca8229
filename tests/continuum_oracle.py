"""The oracle of `Seastar(discretisation="continuum")`: what it has other than the chapter's, as coefficients.

A rigid hub that turns freely, Gregory's weights for bending, consistent masses, Simpson's rule for drag and added mass;
the formulas are those of oracle.py.
"""

from functools import cached_property

import numpy as np

from oracle import Array, Clamp, Shaped, Star

ROOT, FIRST = 5.0 / 12.0, 13.0 / 12.0
"""Gregory's weights of curvature at the hub and at node 1, in edge lengths."""


class Continuum(Star):
    """A star in the continuum's discretisation."""

    @property
    def n_hub_hinges(self) -> int:
        return 0

    @cached_property
    def clamps(self) -> list[Clamp]:
        """A curved limb is tangent to its direction at the hub, so its root edge is half a hinge's turn on."""
        roots = [self.edge(limb, 0) for limb in range(self.n_limbs)]
        directions = self.limb_directions + 0.5 * self.natural_turns
        return [
            Clamp(root, direction, self.node_EI(limb, 0) / (ROOT * self.edge_lengths[root]))
            for limb, (root, direction) in enumerate(zip(roots, directions, strict=True))
        ]

    @cached_property
    def hinge_dl(self) -> Array:
        weights = np.ones((self.n_limbs, self.nodes_per_limb - 2))
        weights[:, :1] = FIRST
        return weights.ravel() * np.array([self.edge_lengths[b] for _, b, _ in self.hinges])

    @cached_property
    def hinge_EI(self) -> Array:
        nodes = [(limb, i) for limb in range(self.n_limbs) for i in range(1, self.nodes_per_limb - 1)]
        return np.array([self.node_EI(limb, i) for limb, i in nodes])

    @cached_property
    def edge_mass(self) -> Array:
        """A sixth of the edge's mass."""
        return self.density * self.edge_areas * self.edge_lengths / 6.0

    @cached_property
    def drag_places(self) -> tuple[Array, Array]:
        """Velocities of the nodes, then those in the middle of the edges."""
        middles = np.zeros((len(self.edges), self.n_nodes))
        for row, ends in zip(middles, self.edges, strict=True):
            row[list(ends)] = 0.5
        whole = 0.5 * self.fluid_density * self.isotropic_coefficient * self.edge_diameters * self.edge_lengths
        return np.vstack([np.eye(self.n_nodes), middles]), np.concatenate([self.drag / 3.0, 2.0 / 3.0 * whole])

    def cross_places(self, edge: int) -> list[tuple[int, float]]:
        tail, head = self.edges[edge]
        return [(tail, 1.0 / 3.0), (head, 1.0 / 3.0), (self.n_nodes + edge, 4.0 / 3.0)]

    @cached_property
    def added_mass_coupling(self) -> Array:
        """A sixth of the edge's added mass."""
        return self.added_mass / 3.0


class ContinuumShaped(Continuum, Shaped):
    """A star whose limbs differ, in the continuum's discretisation."""

    @property
    def edges_before_the_arc(self) -> float:
        """A chord of the arc has its direction in its middle."""
        return 0.5
