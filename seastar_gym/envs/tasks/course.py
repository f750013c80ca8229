"""Courses of prey: a circle, and on it a second one that goes round twice as often.

A course is eight numbers:

    index  meaning                                                          unit
    0, 1   centre of the first circle                                       m
    2      time at which the prey begins                                    s
    3, 4   radii of the first and of the second circle                      m
    5, 6   angles on the circles at that time                               rad
    7      angular velocity on the first circle, + is anti-clockwise        rad/s
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

TWICE = 2.0
"""Rounds of the second circle in one of the first."""
ROBOT_SPEED, LONGEST_CHASE = 0.004, 100.0
"""A point of this speed [m/s] can meet a prey that is drawn, within this time [s]."""
NEAREST_CENTRE, FARTHEST_CENTRE = 0.0, 0.12
"""Distance of a course's centre from the robot [m]."""
MOST_DRAWS = 1000
HEAD_START = 0.08
"""Least distance of a prey from the robot when it begins [m]."""


class Courses(NamedTuple):
    """Courses, shape (..., 8)."""

    numbers: Floats

    def _angles(self, time: ArrayLike) -> tuple[Floats, Floats]:
        since = np.asarray(time) - self.numbers[..., 2]
        turned = self.numbers[..., 7] * since
        return self.numbers[..., 5] + turned, self.numbers[..., 6] + TWICE * turned

    def place(self, time: ArrayLike) -> Floats:
        """Places of the prey at times [s], shape (..., 2) [m]."""
        first, second = self._angles(time)
        x, y, big, small = (self.numbers[..., k] for k in (0, 1, 3, 4))
        return np.stack(
            [x + big * np.cos(first) + small * np.cos(second), y + big * np.sin(first) + small * np.sin(second)],
            axis=-1,
        )

    def velocity(self, time: ArrayLike) -> Floats:
        """Velocities of the prey at times [s], shape (..., 2) [m/s]."""
        first, second = self._angles(time)
        big, small = self.numbers[..., 7] * self.numbers[..., 3], TWICE * self.numbers[..., 7] * self.numbers[..., 4]
        return np.stack(
            [-big * np.sin(first) - small * np.sin(second), big * np.cos(first) + small * np.cos(second)], axis=-1
        )

    def once_round(self, n: int = 120) -> Floats:
        """The whole of one course [m], shape (n + 1, 2)."""
        period = 2.0 * np.pi / abs(float(self.numbers[7]))
        return Courses(self.numbers[None]).place(self.numbers[2] + period * np.arange(n + 1) / n)


def meeting_time(numbers: Floats, start: Floats, time: ArrayLike, speed: float, reach: float, longest: float) -> Floats:
    """Time [s] after which a point that swims straight can first be within `reach` [m] of the prey; inf if never.

    numbers: Courses, shape (..., 8). start: Where the point is at `time` [s], shape (..., 2) [m]. speed: [m/s].
    longest: Time after which nobody looks any more [s].
    """
    since = np.linspace(0.0, longest, 1 + round(longest))
    later = np.asarray(time, np.float64)[..., None] + since
    places = Courses(numbers[..., None, :]).place(later)
    away = places - start[..., None, :]
    gap = np.hypot(away[..., 0], away[..., 1]) - reach - speed * since
    met = gap <= 0.0
    first = np.argmax(met, axis=-1)
    before = np.maximum(first - 1, 0)
    g0, g1 = (np.take_along_axis(gap, k[..., None], -1)[..., 0] for k in (before, first))
    share = np.divide(g0, g0 - g1, out=np.zeros_like(g0), where=g0 - g1 > 0.0)
    found = since[before] + share * (since[first] - since[before])
    return np.where(met.any(axis=-1), np.where(first == 0, 0.0, found), np.inf)


def draw_course(
    rng: np.random.Generator,
    radius: tuple[float, float],
    speed: tuple[float, float],
    epicycle: float,
    reach: float,
) -> Floats:
    """Course around a robot at the origin, from time 0 on, that a slow swimmer can meet.

    ValueError: none was found.
    """
    for _ in range(MOST_DRAWS):
        big = rng.uniform(*radius)
        small = big * rng.uniform(0.0, epicycle)
        away, direction = rng.uniform(NEAREST_CENTRE, FARTHEST_CENTRE), rng.uniform(-np.pi, np.pi)
        turn = rng.choice([-1.0, 1.0]) * rng.uniform(*speed) / np.hypot(big, TWICE * small)
        angles = rng.uniform(-np.pi, np.pi, 2)
        course = np.array([away * np.cos(direction), away * np.sin(direction), 0.0, big, small, *angles, turn])
        far = np.hypot(*Courses(course).place(0.0)) >= HEAD_START
        if far and meeting_time(course, np.zeros(2), 0.0, ROBOT_SPEED, reach, LONGEST_CHASE) < np.inf:
            return course
    raise ValueError(
        f"No prey that a robot could meet was found in {MOST_DRAWS} draws: make courses smaller or slower."
    )
