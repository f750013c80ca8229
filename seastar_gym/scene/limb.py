"""`Limb`: a limb that differs from the robot's others, with profiles along its length."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import is_finite_number, require_numbers, shown
from seastar_gym.scene.number import Numbers, PerRobot, check_numbers, declared, finite, positive
from seastar_gym.scene.serial import register_part

Profile = float | tuple[float, ...]
"""Number, or numbers at equally spaced points from hub to tip (both included), linear in between."""


@register_part
@dataclass(frozen=True)
class Limb:
    """Overrides for one limb. `None` means the robot's value.

    direction: Direction of the limb at the hub, at rest [rad], anti-clockwise from that of limb 1. In the chapter's
        discretisation it is that of the root edge, which differs in curved limbs.
    length: Length of the limb [m].
    radius: Radius [m], a number or a profile along the limb. For example, radius=(root, tip) is a taper.
    youngs_modulus: Young's modulus [Pa], a number or a profile along the limb.
    natural_curvature: Curvature of the limb at rest [1/m]. Positive values bend it anti-clockwise towards its tip.
    joint_stiffness: Stiffness of a joint that turns between hub and limb [N m/rad]. None means a rigid clamp.

    Numbers that differ from robot to robot must be numpy arrays of shape (n_robots,), since a tuple is a profile.
    """

    direction: float | None = None
    length: Annotated[Numbers | None, positive("m", "A limb's ")] = None
    radius: Annotated[Profile | Numbers | None, positive("m", "A limb's ")] = None
    youngs_modulus: Annotated[Profile | Numbers | None, positive("Pa", "A limb's ")] = None
    natural_curvature: Annotated[Numbers, finite("1/m")] = 0.0
    joint_stiffness: Annotated[Numbers | None, positive("N m/rad", "A limb's ")] = None

    def __post_init__(self) -> None:
        if self.direction is not None and not (is_finite_number(self.direction) and 0 <= self.direction < 2 * math.pi):
            raise ValueError(
                f"A limb's direction must be from 0 to below 2 pi [rad], for all robots, not {shown(self.direction)}."
            )
        check_numbers(self)
        for name, profile in (("radius", self.radius), ("youngs_modulus", self.youngs_modulus)):
            if not isinstance(profile, tuple) or isinstance(profile, PerRobot):
                continue
            unit = declared(Limb)[name].number.unit
            require_numbers(f"A limb's {name}", profile, unit)
            if not profile or min(profile) <= 0.0:
                raise ValueError(f"A limb's {name} must be positive all along it [{unit}], not {shown(profile)}.")


class LimbShape(NamedTuple):
    """Limb with all values filled in, see Limb.

    gap: Angle to the next limb's root edge, anti-clockwise [rad]. root: Where it begins, from the hub [m].
    """

    direction: float
    gap: float
    length: float
    radius: tuple[float, ...]
    youngs_modulus: tuple[float, ...]
    natural_curvature: float
    root: tuple[float, float] = (0.0, 0.0)
    joint_stiffness: float | None = None

    def extreme_edges(self, nodes_per_limb: int) -> list[tuple[float, float, float, float]]:
        """Bounds of (l^2 [m^2], EA/l [N/m], EI/l [N m], volume [m^3]) over the edges: smallest and largest values."""
        l = self.length / (nodes_per_limb - 1)  # noqa: E741
        found = []
        for choose in (min, max):
            r, E = choose(self.radius), choose(self.youngs_modulus)
            area = math.pi * r**2
            found.append((l**2, E * area / l, E * math.pi * r**4 / 4.0 / l, area * l))
        return found


def as_tuple(profile: Profile) -> tuple[float, ...]:
    """Profile as a tuple of numbers."""
    return profile if isinstance(profile, tuple) else (profile,)


def along(profile: tuple[float, ...], share: NDArray[np.float64]) -> list[float]:
    """Values of a profile at fractions of the length from hub to tip."""
    if len(profile) == 1:
        return [*profile] * len(share)
    return np.interp(share, np.linspace(0.0, 1.0, len(profile)), profile).tolist()
