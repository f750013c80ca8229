"""Profiles: numbers along a limb, from hub to tip."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import require_numbers, shown
from seastar_gym.scene.number import PerRobot, declared

Profile = float | tuple[float, ...]
"""Number, or numbers at equally spaced points from hub to tip (both included), linear in between."""


def as_tuple(profile: Profile) -> tuple[float, ...]:
    """Profile as a tuple of numbers."""
    return profile if isinstance(profile, tuple) else (profile,)


def along(profile: tuple[float, ...], share: NDArray[np.float64]) -> list[float]:
    """Values of a profile at fractions of the length from hub to tip."""
    if len(profile) == 1:
        return [*profile] * len(share)
    return np.interp(share, np.linspace(0.0, 1.0, len(profile)), profile).tolist()


def check_profiles(part: Any) -> None:
    """Refuse profiles of a part that are not positive all along the limb."""
    for name, (number, _, _, may_be_profile) in declared(part.__class__).items():
        profile = getattr(part, name)
        if not may_be_profile or not isinstance(profile, tuple) or isinstance(profile, PerRobot):
            continue
        require_numbers(f"{number.whose}{name}", profile, number.unit)
        if not profile or min(profile) <= 0.0:
            what = f"{number.whose}{name} must be positive all along it [{number.unit}]"
            raise ValueError(f"{what}, not {shown(profile)}.")
