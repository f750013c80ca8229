"""`Limb`: a limb that differs from the robot's others, with profiles along its length."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import is_finite_number, shown
from seastar_gym.scene.number import Numbers, Profile, as_tuple, check_numbers, finite, make_floats, positive
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
