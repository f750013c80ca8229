"""`SeastarPrey-v0`: a prey that swims faster than the robot, on a course that comes back.

Courses of prey: a circle, and on it a second one that goes round twice as often.

A course is eight numbers:

    index  meaning                                                          unit
    0, 1   centre of the first circle                                       m
    2      time at which the prey begins                                    s
    3, 4   radii of the first and of the second circle                      m
    5, 6   angles on the circles at that time                               rad
    7      angular velocity on the first circle, + is anti-clockwise        rad/s
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.robots import Flags, Floats, Robots, Score, Task
from seastar_gym.envs.scenery import Ring, Scenery
from seastar_gym.scene import Scene
from seastar_gym.scene.number import Range, not_negative, positive, ranging, whole
from seastar_gym.scene.serial import register_part

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


LOOK_AHEAD = 10.0
"""The second point of an observation is where the prey would be after this time [s] if it swam straight on."""
MOST_PREY = 12
"""Courses that are drawn for an episode; a robot that catches more meets the first one again."""


@register_part
@dataclass(frozen=True)
class Prey(Task):
    """A prey to catch, faster than the robot, on a closed course; then another one.

    A robot that swims to where the prey is trails behind it for ever. One that remembers the course, or foresees it,
    swims to where the prey will be.

    The prey swims on a closed course, a circle whose radius is in `radius`, and on it a second one of up to `epicycle`
    of that radius, twice as often round. Its root mean square speed is in `speed`. The prey is caught where a decision
    ends within `catch_radius` of it, and the next one begins on a course of its own around the robot.

    The robot of `SeastarPreyTimed-v0` swims faster, and so do its prey, `"fast-prey"`: 10.5 to 13.5 mm/s, and 7 mm/s
    for `robot_speed`.

    ## Starting state
    The robot rests with a random heading. The course passes near it, and does not begin there. Every course can be
    solved: a point that swims straight at `robot_speed`, which the robot exceeds, could meet the prey within 100 s.

    ## Episode end
    The task never ends by itself.

    ## Observation
    That of `SeastarSwim-v0`, with the prey in the place of the current waypoint, and with the place where it would be
    in 10 s if it swam straight on in that of the next: the difference tells its velocity.

    ## Reward
    | term              | meaning                                                | default weight |
    |-------------------|--------------------------------------------------------|----------------|
    | `reward_progress` | decrease of the distance from the prey [m]             | 50 per metre   |
    | `reward_catch`    | prey caught in the decision                            | 10 per prey    |
    | `reward_effort`   | minus the time for which wires were heated, in pulses  | 0.01 per pulse |

    The task's measure is the number of prey caught in 200 s.

    ## Info
    That of `SeastarSwim-v0` without `waypoint_index`, `cross_track_error`, `energy_per_metre`, `reward_waypoint` and
    `reward_time`; `is_success` says whether `wanted` prey are caught. Besides,

    | name           | type       | unit | meaning                                         |
    |----------------|------------|------|-------------------------------------------------|
    | `instance`     | int        | -    | number of the episode in its split              |
    | `distance`     | float      | m    | distance of the hub from the prey               |
    | `prey`         | array (2,) | m    | place of the prey in the world: x, y            |
    | `course`       | array (8,) | -    | the course, see `seastar_gym.envs.tasks.prey` |
    | `catches`      | int        | 1    | prey caught so far                              |
    | `reward_catch` | float      | 1    | term of the reward                              |

    `course` is what the robot is not told.

    ## Arguments
    speed: Smallest and largest speed of prey [m/s].
    radius: Smallest and largest radius of a course [m].
    epicycle: Largest radius of the second circle, as a fraction of the first.
    robot_speed: Speed of a point that could meet every prey in time [m/s].
    catch_radius: Distance [m] within which a prey is caught.
    wanted: Number of prey that count as success.
    progress, catch, effort: Weights of the reward's terms.
    """

    speed: Annotated[Range, ranging("m/s")] = (0.006, 0.008)
    radius: Annotated[Range, ranging("m")] = (0.12, 0.2)
    epicycle: Annotated[float, not_negative("1")] = 0.2
    robot_speed: Annotated[float, positive("m/s")] = 0.004
    catch_radius: Annotated[float, positive("m")] = 0.02
    wanted: Annotated[int, whole(1, 1_000_000)] = 3
    progress: Annotated[float, not_negative("1")] = 50.0
    catch: Annotated[float, not_negative("1")] = 10.0
    effort: Annotated[float, not_negative("1")] = 0.01

    terms = ("reward_progress", "reward_catch", "reward_effort")

    @property
    def waypoint_radius(self) -> float:  # type: ignore[override]
        """Radius of the prey in pictures [m]."""
        return self.catch_radius

    def draw(self, rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
        """Courses around the robot, from time 0 on; that of the present prey, its distance, and what was caught."""
        pursuit = Pursuit(self.robot_speed, self.catch_radius)
        drawn = [draw_course(rng, self.radius, self.speed, self.epicycle, pursuit) for _ in range(MOST_PREY)]
        return {"drawn": drawn, "course": np.zeros(8), "distance": 0.0, "catches": np.int64(0)}

    def begin(self, robots: Robots, begun: Flags) -> None:
        """Let the first prey go."""
        self._release(robots, begun, robots.simulator.hub_position())

    def _release(self, robots: Robots, begun: Flags, hub: Floats) -> None:
        """Let the next prey go, around the robots in a mask."""
        now = robots.episode
        for robot in np.flatnonzero(begun):
            course = now.drawn[robot, now.catches[robot] % MOST_PREY].copy()
            course[:2] += hub[robot]
            course[2] = robots.simulator.time[robot]
            now.course[robot] = course
        now.distance[begun] = self._distances(robots, hub)[begun]

    def prey(self, robots: Robots) -> tuple[Floats, Floats]:
        """Places [m] and velocities [m/s] of the prey, shape (n_robots, 2) each."""
        courses, time = Courses(robots.episode.course), robots.simulator.time
        return courses.place(time), courses.velocity(time)

    def _distances(self, robots: Robots, hub: Floats) -> Floats:
        """Distances of hubs from their prey [m]."""
        away = self.prey(robots)[0] - hub
        return np.hypot(away[:, 0], away[:, 1])

    def targets(self, robots: Robots) -> Floats:
        """The prey, and where it would be if it swam straight on."""
        place, velocity = self.prey(robots)
        return np.concatenate([place, place + LOOK_AHEAD * velocity], axis=1)

    def score(self, robots: Robots, hub: Floats, pulses: Floats) -> Score:
        """Progress towards the prey, catches, and effort; success once `wanted` are caught."""
        now = robots.episode
        before, now.distance = now.distance, self._distances(robots, hub)
        caught = now.distance <= self.catch_radius
        terms = {
            "reward_progress": self.progress * (before - now.distance),
            "reward_catch": self.catch * caught.astype(np.float64),
            "reward_effort": -self.effort * pulses,
        }
        now.catches += caught
        self._release(robots, caught, hub)
        return Score(terms, success=now.catches >= self.wanted)

    def info(self, robots: Robots, hub: Floats) -> dict[str, NDArray[Any]]:
        """The prey, its course, and how many were caught."""
        now = robots.episode
        return {
            "distance": self._distances(robots, hub),
            "prey": self.prey(robots)[0],
            "course": now.course.copy(),
            "catches": now.catches.copy(),
        }

    def scenery(self, robots: Robots, robot: int) -> Scenery:
        """The prey, where it swims, and its course."""
        place, velocity = (of_all[robot] for of_all in self.prey(robots))
        return Scenery(
            rings=(Ring(place, self.catch_radius),),
            lines=(Courses(robots.episode.course[robot]).once_round(),),
            arrows=(np.array([place, place + 5.0 * velocity]),),
            progress=f"{robots.episode.catches[robot]} caught",
        )
