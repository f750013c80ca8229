"""Limbs: `Limb` differs from the robot's others, `AlongLimb` and `Stiffening` say how actuators act along it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import is_finite_number, require_numbers, shown
from seastar_gym.scene.number import (
    Numbers,
    Profile,
    as_tuple,
    check_numbers,
    finite,
    make_floats,
    not_negative,
    positive,
    profile_at,
    within,
)
from seastar_gym.scene.section import AnySection, Cut, cuts
from seastar_gym.scene.serial import register_part

Floats = NDArray[np.float64]


Length: TypeAlias = Annotated[Numbers | None, positive("m", "A limb's ")]
Radius: TypeAlias = Annotated[Profile | Numbers | None, positive("m", "A limb's ")]
Modulus: TypeAlias = Annotated[Profile | Numbers | None, positive("Pa", "A limb's ")]
JointStiffness: TypeAlias = Annotated[Numbers | None, positive("N m/rad", "A limb's ")]


@register_part
@dataclass(frozen=True)
class Limb:
    """Overrides for one limb. `None` means the robot's value.

    direction: Direction of the limb at the hub, at rest [rad], anti-clockwise from that of limb 1. In the chapter's
        discretisation it is that of the root edge, which differs in curved limbs.
    length: Length of the limb [m].
    radius: Radius [m], a number or a profile along the limb. For example, radius=(root, tip) is a taper.
    section: Cross section of a limb that is no solid disc: `Strip`, `Tube` or `Section`; also `Disc`, which is what
        `radius` means. At most one of the two is named.
    youngs_modulus: Young's modulus [Pa], a number or a profile along the limb.
    natural_curvature: Curvature of the limb at rest [1/m]. Positive values bend it anti-clockwise towards its tip.
    joint_stiffness: Stiffness of a joint that turns between hub and limb [N m/rad]. None means a rigid clamp.

    Numbers that differ from robot to robot must be numpy arrays of shape (n_robots,), since a tuple is a profile.
    """

    direction: float | None = None
    length: Length = None
    radius: Radius = None
    youngs_modulus: Modulus = None
    natural_curvature: Annotated[Numbers, finite("1/m")] = 0.0
    joint_stiffness: JointStiffness = None
    section: AnySection | None = None

    def __post_init__(self) -> None:
        make_floats(self)
        if self.direction is not None and not (is_finite_number(self.direction) and 0 <= self.direction < 2 * math.pi):
            raise ValueError(
                f"A limb's direction must be from 0 to below 2 pi [rad], for all robots, not {shown(self.direction)}."
            )
        check_numbers(self)
        if not isinstance(self.section, AnySection | None):
            raise ValueError(f"A limb's section must be a Disc, Strip, Tube or Section, not {shown(self.section)}.")
        if self.section is not None and self.radius is not None:
            raise ValueError("A limb has either a radius or a section.")


class LimbShape(NamedTuple):
    """Limb with all values filled in, see Limb.

    gap: Angle to the next limb's root edge, anti-clockwise [rad]. root: Where it begins, from the hub [m].
    """

    direction: float
    gap: float
    length: float
    section: AnySection
    youngs_modulus: tuple[float, ...]
    natural_curvature: float
    root: tuple[float, float] = (0.0, 0.0)
    joint_stiffness: float | None = None

    def cuts(self, density: float, share: Floats) -> list[Cut]:
        """Cross sections at fractions of the length from hub to tip; density: The robot's [kg/m^3]."""
        return cuts(self.section, self.youngs_modulus, density, share)

    def corners(self, density: float) -> list[Cut]:
        """Cross sections where profiles have their points."""
        profiles = [getattr(self.section, field.name) for field in fields(self.section)] + [self.youngs_modulus]
        points = {len(as_tuple(profile)) for profile in profiles if profile is not None}
        share = np.unique(np.concatenate([np.linspace(0.0, 1.0, n) for n in points]))
        return self.cuts(density, share)

    def extreme_edges(self, nodes_per_limb: int, density: float) -> list[tuple[float, float, float, float]]:
        """(l^2 [m^2], EA/l [N/m], EI/l [N m], mass [kg]) of edges with the cross sections of `corners`."""
        l = self.length / (nodes_per_limb - 1)  # noqa: E741
        return [
            (l**2, E * cut.area / l, cut.EI / l, density * cut.inert * l)
            for cut in self.corners(density)
            for E in (min(self.youngs_modulus), max(self.youngs_modulus))
        ]


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
