"""A limb that is not like the robot's others, and what a profile along it says."""

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.checks import is_finite_number, require_number, require_numbers

Profile = float | tuple[float, ...]
"""A number, or numbers at equally spaced points from hub to tip (both included), linear in between."""


@dataclass(frozen=True)
class Limb:
    """What one limb has of its own; None: what the robot says for all.

    direction: Of its root edge at rest [rad], anti-clockwise from limb 1's.
    length [m]. radius [m] and youngs_modulus [Pa], along the limb: a taper is radius=(root, tip).
    natural_curvature: Of the limb at rest [1/m], + bends it anti-clockwise on the way to its tip.

    They are the same for all robots of a batch: only the robot's own numbers may differ from robot to robot.
    """

    direction: float | None = None
    length: float | None = None
    radius: Profile | None = None
    youngs_modulus: Profile | None = None
    natural_curvature: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if isinstance(getattr(self, field.name), np.ndarray):
                raise ValueError(
                    f"A limb's {field.name} is the same for all robots of a batch: give one number, or a tuple along "
                    "the limb, and let only the robot's own numbers differ from robot to robot."
                )
        if self.direction is not None and not (is_finite_number(self.direction) and 0 <= self.direction < 2 * math.pi):
            raise ValueError(f"A limb's direction must be from 0 to below 2 pi [rad], not {self.direction!r}.")
        if self.length is not None:
            require_number("A limb's length", self.length, "m")
        if not is_finite_number(self.natural_curvature):
            raise ValueError(f"natural_curvature must be a finite number [1/m], not {self.natural_curvature!r}.")
        for name, profile, unit in (("radius", self.radius, "m"), ("youngs_modulus", self.youngs_modulus, "Pa")):
            if profile is None:
                continue
            require_numbers(f"A limb's {name}", as_tuple(profile), unit)
            if not as_tuple(profile) or min(as_tuple(profile)) <= 0.0:
                raise ValueError(f"A limb's {name} must be positive all along it [{unit}], not {profile!r}.")


class LimbShape(NamedTuple):
    """A limb with nothing left open; see Limb. gap: Angle to the next limb's root edge, anti-clockwise [rad]."""

    direction: float
    gap: float
    length: float
    radius: tuple[float, ...]
    youngs_modulus: tuple[float, ...]
    natural_curvature: float


def as_tuple(profile: Profile) -> tuple[float, ...]:
    """The numbers of a profile."""
    return profile if isinstance(profile, tuple) else (profile,)


def along(profile: tuple[float, ...], share: NDArray[np.float64]) -> list[float]:
    """A profile at shares of the way from hub to tip."""
    if len(profile) == 1:
        return [*profile] * len(share)
    return np.interp(share, np.linspace(0.0, 1.0, len(profile)), profile).tolist()
