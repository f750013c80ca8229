"""`AlongLimb` and `Stiffening`: actuators that act on limbs along their length, on natural curvature and stiffness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import require_numbers, shown
from seastar_gym.scene.number import (
    Numbers,
    Profile,
    as_tuple,
    check_numbers,
    not_negative,
    positive,
    profile_at,
    within,
)
from seastar_gym.scene.serial import register_part

Floats = NDArray[np.float64]


@register_part
@dataclass(frozen=True)
class AlongLimb:
    """How the rotation that actuators make is spread between the hub and the length of a limb.

    An actuator's rotation delta_psi is then the angle by which the whole limb bends, from hub to tip: a uniform wire
    changes the natural curvature of a limb of length L by delta_psi/L, so a curvature has the peak angle curvature * L.

    share: Share of the rotation that bends the limb along its length, from 0 to 1. The rest turns the limb at the hub.
    profile: Change of natural curvature along the limb, in any unit: one number if it is uniform, or numbers at equally
        spaced points from hub to tip, linear in between. Only their ratios count.
    """

    share: Annotated[Numbers, within(0.0, 1.0)] = 1.0
    profile: Profile = 1.0

    def __post_init__(self) -> None:
        check_numbers(self)
        require_numbers("A profile along a limb", as_tuple(self.profile), "1")
        points = tuple(map(float, as_tuple(self.profile)))
        bend = sum(points) - 0.5 * (points[0] + points[-1]) * (len(points) > 1) if points else 0.0
        if not bend > 1e-6 * max(map(abs, points), default=0.0):
            raise ValueError(
                f"A profile along a limb must bend it to one side on the whole, not {shown(self.profile)}."
            )

    def hinge_shares(self, nodes_per_limb: int) -> Floats:
        """Turn of every hinge of a limb per rotation by the actuator, shape (nodes_per_limb - 1,), the clamp's first.

        Edges are chords of the bent limb: a hinge turns by the integral of curvature times its hat function.
        """
        points = as_tuple(self.profile)
        n_edges = nodes_per_limb - 1
        s = np.union1d(np.linspace(0.0, 1.0, nodes_per_limb), np.linspace(0.0, 1.0, max(len(points), 2)))
        p, length = np.array(profile_at(points, s)), np.diff(s)
        edge = np.minimum((0.5 * (s[1:] + s[:-1]) * n_edges).astype(int), n_edges - 1)
        outer = np.stack([s[:-1], s[1:]]) * n_edges - edge
        ends = np.stack([p[:-1], p[1:]])
        turns = np.zeros(nodes_per_limb)
        for node, hat in ((edge, 1.0 - outer), (edge + 1, outer)):
            middle = ends.sum(axis=0) * hat.sum(axis=0)  # Simpson's rule: four times the product in the middle
            turns += np.bincount(node, length * ((ends * hat).sum(axis=0) + middle) / 6.0, nodes_per_limb)
        shares = self.share * turns[:-1] / turns.sum()
        shares[0] += 1.0 - self.share
        return np.asarray(shares)


@register_part
@dataclass(frozen=True)
class Stiffening:
    """How much stiffer a limb is whose actuator is hot: alloy that has recovered its shape has a larger modulus.

    The bending stiffness EI of a limb is multiplied by 1 + (ratio - 1) S(a), with the activation a = |delta_psi|/peak
    angle from 0 to 1 and a logistic S from S(0) = 0 to S(1) = 1. Two wires that pull against each other have the
    activation of their difference.

    ratio: EI at full activation over EI at rest. The default is that of a limb of nickel-titanium wires in an elastomer
        in the repository `softmachineslab/horton_der_2d`.
    middle: Activation at which S rises most.
    width: Width of the rise, in activation: S is about 1/(1 + exp(-(a - middle)/width)).
    """

    ratio: Annotated[Numbers, positive("1")] = 2.68
    middle: Annotated[float, not_negative("1")] = 0.5
    width: Annotated[float, positive("1")] = 0.15

    def __post_init__(self) -> None:
        check_numbers(self)
        if not (np.min(self.ratio) >= 1e-3 and np.max(self.ratio) <= 1e3):
            raise ValueError(f"The ratio of bending stiffnesses must be from 0.001 to 1000, not {shown(self.ratio)}.")
        if self.middle > 1.0 or not 0.02 <= self.width <= 100.0:
            raise ValueError(
                f"The middle must be from 0 to 1 and the width from 0.02 to 100, not {self.middle} and {self.width}."
            )
