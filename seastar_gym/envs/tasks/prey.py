"""`SeastarPrey-v0`: a prey that swims faster than the robot, on a course that comes back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.robots import Flags, Floats, Robots, Score, Task
from seastar_gym.envs.scenery import Ring, Scenery
from seastar_gym.envs.tasks.course import Courses, Pursuit, draw_course
from seastar_gym.scene import Scene
from seastar_gym.scene.number import Range, not_negative, positive, ranging, whole
from seastar_gym.scene.serial import register_part

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

    ## Episode
    The prey swims on a closed course, a circle whose radius is in `radius`, and on it a
    second one of up to `epicycle` of that radius, twice as often round. Its root mean square speed is in `speed`. The
    course passes near the robot, and does not begin there. The prey is caught where a decision ends within
    `catch_radius` of it, and the next one begins on a course of its own around the robot. The task never ends by
    itself. Every course can be solved: a point that swims straight at `robot_speed`, which the robot exceeds, could
    meet the prey within 100 s.

    In time, the robot swims faster, and so do the prey of `"fast-prey"`: 10.5 to 13.5 mm/s, and 7 mm/s for the robot.

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
    That of `SeastarSwim-v0` without `waypoint_index`, `cross_track_error`, `energy_per_metre` and `reward_waypoint`;
    `is_success` says whether `wanted` prey are caught. Besides,

    | name           | type       | unit | meaning                                         |
    |----------------|------------|------|-------------------------------------------------|
    | `instance`     | int        | -    | number of the episode in its split              |
    | `distance`     | float      | m    | distance of the hub from the prey               |
    | `prey`         | array (2,) | m    | place of the prey in the world: x, y            |
    | `course`       | array (8,) | -    | the course, see `seastar_gym.envs.tasks.course` |
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
        return {"drawn": drawn, "course": np.zeros(8), "distance": 0.0, "catches": 0}

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
