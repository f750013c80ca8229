"""The oracle of limbs that actuators bend along their length: at any moment a robot of other natural curvature."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from continuum_oracle import ContinuumShaped
from oracle import Array, Clamp


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
