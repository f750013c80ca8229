"""`Plant`: what can be asked of a robot in a tank."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray


class PlantError(RuntimeError):
    """A plant that was stopped, and why, in one sentence."""


class Sighting(NamedTuple):
    """What a tracker saw in a picture."""

    captured_at: float
    """Time at which the picture was taken, on the plant's clock [s]."""
    seen_at: float
    """Time at which it was known here, on the same clock [s]."""
    pose: tuple[float, float, float]
    """Hub x, y [m] and heading of limb 1 [rad], anti-clockwise, in the tank."""
    markers: NDArray[np.float64] | None = None
    """Places of markers in the tank [m], shape (n_limbs, n, 2), from hub to tip; None where only the pose is seen."""


class Plant(Protocol):
    """A robot of `n_limbs` limbs with two wires each, and a tracker that sees it.

    Whoever drives it calls `sight` or `heat` again and again: a plant that hears nothing for 0.1 s stops by itself.
    """

    n_limbs: int

    def now(self) -> float:
        """Time on the plant's clock [s], which never goes back."""

    def wait(self, seconds: float) -> None:
        """Return after so many seconds on this clock."""

    def sight(self) -> Sighting | None:
        """The newest sighting, None before there is one; says that the driver lives. PlantError: it has stopped."""

    def heat(self, limbs: Sequence[int], seconds: float) -> None:
        """Heat a wire of every limb from now on: 1 the one for +, -1 the one for -, 0 none, for so many seconds.

        A pulse replaces what is left of the last one of the same wire. Other wires go on.
        """

    def stop(self) -> None:
        """Heat no wire any more."""
