"""Scenery: what a picture shows of a task besides the robot and its waypoints. Lengths are in metres, y is up."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Ring(NamedTuple):
    """Place to be, drawn as the current waypoint is."""

    centre: Floats
    radius: float
    label: str = ""
    """What stands in it."""


class Scenery(NamedTuple):
    """What a picture shows of a task."""

    rings: tuple[Ring, ...] = ()
    obstacles: tuple[Ring, ...] = ()
    """Discs that are no place to be."""
    lines: tuple[Floats, ...] = ()
    """Courses, shape (n, 2) each."""
    arrows: tuple[Floats, ...] = ()
    """Start and tip of every arrow, shape (2, 2) each."""
    progress: str | None = None
    """What stands in the upper right corner; None for the number of the waypoint."""
    note: str = ""
    """What stands below: what the robot is not told."""

    @property
    def points(self) -> Floats:
        """Points that the picture has to show, shape (n, 2)."""
        centres = [place.centre for place in (*self.rings, *self.obstacles)]
        return np.concatenate([np.reshape(centres, (-1, 2)), *self.lines, *self.arrows])


NOTHING = Scenery()
