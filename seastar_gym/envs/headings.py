"""Headings that may be asked for at waypoints: `HeadingTargets` say which way robots have to look.

The heading of a robot is the direction of the x axis of its body frame (`layout.py`): that of limb 1, by all
stations. Limbs are told from each other, as by a camera on limb 1: a heading repeats after 360 degrees, not after 72.
Angles are those of the world, anti-clockwise from +x.

What is left to turn is known by the shortest way round, from one heading to the next: in [-pi, pi), anti-clockwise
positive. It does not depend on which limb is called limb 1. A turn of the world leaves it, a mirror changes its sign.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import is_finite_number, require_number, shown
from seastar_gym.scene.number import make_floats
from seastar_gym.scene.serial import register_part

Floats = NDArray[np.float64]

LARGEST = 1e6
"""Largest angle that may be asked for [rad]: beyond it, rounding is seen."""


@register_part
@dataclass(frozen=True)
class HeadingTargets:
    """Headings at the waypoints, without which they are not reached.

    target: "along", the direction of the leg that ends at the waypoint; "random", drawn for every waypoint of every
        episode; angles [rad], one for each waypoint; or one angle for all.
    tolerance: Largest difference between heading and asked heading at which a waypoint is reached [rad], at most pi.
    """

    target: Literal["along", "random"] | float | tuple[float, ...] = "along"
    tolerance: float = math.radians(10.0)

    def __post_init__(self) -> None:
        make_floats(self)
        angles = self.target if isinstance(self.target, tuple) else (self.target,)
        is_named = isinstance(self.target, str) and self.target in ("along", "random")
        if not is_named and not (angles and all(map(_is_angle, angles))):
            raise ValueError(
                f"HeadingTargets.target must be 'along', 'random', an angle or a tuple of angles [rad], at most "
                f"{LARGEST:g}, not {shown(self.target)}."
            )
        require_number("HeadingTargets.tolerance", self.tolerance, "rad")
        if self.tolerance > math.pi:
            raise ValueError(f"HeadingTargets.tolerance must be at most pi, not {shown(self.tolerance)} rad.")

    def of_path(self, waypoints: Floats, rng: np.random.Generator) -> Floats:
        """Asked headings [rad], shape (n,), at waypoints [m], shape (n, 2). rng: Generator of random ones.

        ValueError: the waypoints are not as many as the angles, or a leg has no direction.
        """
        if self.target == "random":
            return rng.uniform(-np.pi, np.pi, len(waypoints))
        if self.target == "along":
            return _along(waypoints)
        angles = np.array(self.target, dtype=np.float64)
        if angles.ndim and len(angles) != len(waypoints):
            counts = f"{len(angles)} angles, but the path has {len(waypoints)} waypoint(s)"
            raise ValueError(f"HeadingTargets.target has {counts}.")
        return np.broadcast_to(angles, len(waypoints)).copy()


def _is_angle(value: object) -> bool:
    return is_finite_number(value) and abs(float(value)) <= LARGEST  # type: ignore[arg-type]


def _along(waypoints: Floats) -> Floats:
    """Directions [rad], shape (n,), of the legs that end at the waypoints [m], shape (n, 2)."""
    legs = np.diff(waypoints, axis=0, prepend=np.zeros((1, 2)))
    if not legs.any(axis=1).all():
        k = int(np.argmin(legs.any(axis=1)))
        raise ValueError(f"Headings along the path need legs with a direction: the leg to waypoint {k + 1} has none.")
    return np.arctan2(legs[:, 1], legs[:, 0])


def wrapped(angles: Floats) -> Floats:
    """Angles [rad] by the shortest way round, in [-pi, pi)."""
    return np.asarray(np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi)
