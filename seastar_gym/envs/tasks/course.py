"""Courses of prey: a circle, and on it a second one that goes round twice as often.

A course is eight numbers:

    index  meaning                                                          unit
    0, 1   centre of the first circle                                       m
    2      time at which the prey begins                                    s
    3, 4   radii of the first and of the second circle                      m
    5, 6   angles on the circles at that time                               rad
    7      angular velocity on the first circle, + is anti-clockwise        rad/s
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seastar_gym.envs.robots import Floats

TWICE = 2.0
"""Rounds of the second circle in one of the first."""
CHASE = np.arange(101.0)
"""Times [s] at which a prey may be met: what is drawn can be, by then."""
FARTHEST_CENTRE = 0.12
"""Largest distance of a course's centre from the robot [m]."""
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


class Pursuit(NamedTuple):
    """A point that swims straight to meet a prey."""

    speed: float
    """[m/s]"""
    reach: float
    """Distance at which the prey is met [m]."""

    def meeting_time(self, start: Floats, prey: Floats, since: Floats) -> Floats:
        """Time [s] until the prey can be met, linear between the given times; inf if it cannot, shape (...).

        start: Where the point is, shape (..., 2) [m]. prey: Where the prey is, shape (..., n, 2) [m], after times
        `since` [s], shape (n,), which begin with 0.
        """
        gap = self.gaps(start, prey, since)
        met = gap <= 0.0
        first = np.argmax(met, axis=-1)
        before = np.maximum(first - 1, 0)
        wide, none = (np.take_along_axis(gap, k[..., None], -1)[..., 0] for k in (before, first))
        share = np.divide(wide, wide - none, out=np.zeros_like(wide), where=wide - none > 0.0)
        found = since[before] + share * (since[first] - since[before])
        return np.where(met.any(axis=-1), np.where(first == 0, 0.0, found), np.inf)

    def gaps(self, start: Floats, prey: Floats, since: Floats) -> Floats:
        """Way that the point lacks at each of the times [m], shape (..., n); for the arguments see `meeting_time`."""
        away = prey - start[..., None, :]
        return np.asarray(np.hypot(away[..., 0], away[..., 1]) - self.reach - self.speed * since)


def draw_course(
    rng: np.random.Generator,
    radius: tuple[float, float],
    speed: tuple[float, float],
    epicycle: float,
    pursuit: Pursuit,
) -> Floats:
    """Course around a robot at the origin, from time 0 on, on which a pursuer that swims straight can meet the prey.

    ValueError: none was found.
    """
    for _ in range(MOST_DRAWS):
        big = rng.uniform(*radius)
        small = big * rng.uniform(0.0, epicycle)
        away, direction = rng.uniform(0.0, FARTHEST_CENTRE), rng.uniform(-np.pi, np.pi)
        turn = rng.choice([-1.0, 1.0]) * rng.uniform(*speed) / np.hypot(big, TWICE * small)
        angles = rng.uniform(-np.pi, np.pi, 2)
        course = np.array([away * np.cos(direction), away * np.sin(direction), 0.0, big, small, *angles, turn])
        prey = Courses(course).place(CHASE)
        far = np.hypot(*prey[0]) >= HEAD_START
        if far and pursuit.meeting_time(np.zeros(2), prey, CHASE) < np.inf:
            return course
    raise ValueError(f"Of {MOST_DRAWS} prey, a robot could meet none: make their courses smaller, or slow them down.")
