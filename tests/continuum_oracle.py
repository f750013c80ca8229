"""The oracle of `Seastar(discretisation="continuum")`: what it has other than the chapter's, as coefficients.

A rigid hub that turns freely, Gregory's weights for bending, consistent masses, Simpson's rule for drag and added mass;
the formulas are those of oracle.py.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

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


# Limbs that actuators bend along their length


@dataclass(frozen=True)
class Bent(ContinuumShaped):
    """A star whose limbs are bent by delta_psi [rad] at this moment.

    share: Of the rotation, what bends limbs along their length. profile: Curvature at a fraction of the length, in any
    unit. ratio, middle, width, peak: Of the logistic stiffening, and the rotation [rad] of activation 1.
    """

    delta_psi: tuple[float, ...] = ()
    share: float = 1.0
    profile: Callable[[Array], Array] = np.ones_like
    ratio: float = 1.0
    middle: float = 0.5
    width: float = 0.15
    peak: float = 1.0

    def at(self, delta_psi: ArrayLike) -> "Bent":
        """The robot once its limbs are bent by other angles [rad], shape (n_limbs,)."""
        return replace(self, delta_psi=tuple(np.asarray(delta_psi).tolist()))

    def turned(self, delta_psi: ArrayLike) -> tuple["Bent", Array]:
        return self.at(delta_psi), np.zeros(self.n_limbs)

    @cached_property
    def shares(self) -> Array:
        """Turn of a limb's clamp and hinges per rotation: hat functions times the profile, at many points."""
        n = 400_000
        s = (np.arange(n) + 0.5) / n
        p = self.profile(s) / np.mean(self.profile(s))
        nodes = np.linspace(0.0, 1.0, self.nodes_per_limb)
        hats = [np.interp(s, nodes, unit) for unit in np.eye(self.nodes_per_limb)[:-1]]
        bend = self.share * np.array([np.mean(p * hat) for hat in hats])
        bend[0] += 1.0 - self.share
        return bend

    @cached_property
    def factors(self) -> Array:
        """Bending stiffness of the limbs over that at rest."""
        rise = [1.0 / (1.0 + np.exp(-(a - self.middle) / self.width)) for a in (*self._activations, 0.0, 1.0)]
        return 1.0 + (self.ratio - 1.0) * (np.array(rise[:-2]) - rise[-2]) / (rise[-1] - rise[-2])

    @property
    def _activations(self) -> Array:
        return np.abs(self.delta_psi) / self.peak

    @cached_property
    def clamps(self) -> list[Clamp]:
        return [
            Clamp(clamp.edge, clamp.direction + self.shares[0] * delta, f * clamp.stiffness)
            for clamp, delta, f in zip(super().clamps, self.delta_psi, self.factors, strict=True)
        ]

    @cached_property
    def inner_angles(self) -> Array:
        return super().inner_angles + np.outer(self.delta_psi, self.shares[1:]).ravel()

    @cached_property
    def hinge_EI(self) -> Array:
        return super().hinge_EI * np.repeat(self.factors, self.nodes_per_limb - 2)
