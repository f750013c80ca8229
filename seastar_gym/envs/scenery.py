"""Scenery: what a picture shows of a task besides the robot and its waypoints. Lengths are in metres, y is up."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.model import velocities_at
from seastar_gym.scene.water import AnyCurrent

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

LONGEST, SHORTEST = 0.7, 0.05
"""Length of the longest arrow of a current [spacings of arrows], and of one too short to be drawn [longest arrows]."""


class Flow(NamedTuple):
    """Arrows of a current: `arrows` from start to tip [m], shape (n, 2, 2), and what they show, in words."""

    arrows: Floats
    words: str


def flow_of(current: AnyCurrent | None, low: Floats, high: Floats, spacing: float) -> Flow:
    """Arrows of a current, as long as it is fast, evenly over a rectangle from corner `low` to corner `high` [m].

    spacing: Distance of neighbouring arrows [m], about. Without a current there are no arrows and no words.
    """
    if current is None:
        return Flow(np.zeros((0, 2, 2)), "")
    counts = np.maximum(1, np.rint((high - low) / spacing)).astype(int)
    axes = [a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, counts, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    velocities = velocities_at(current, places)
    speeds = np.hypot(*velocities.T)
    fastest = float(speeds.max())
    if fastest == 0.0:
        return Flow(np.zeros((0, 2, 2)), "")
    half = 0.5 * LONGEST * spacing / fastest * velocities
    drawn = speeds > SHORTEST * fastest
    most = "" if np.ptp(speeds) < 1e-9 * fastest else "up to "
    return Flow(np.stack([places - half, places + half], axis=1)[drawn], f"current {most}{1000.0 * fastest:.3g} mm/s")
