"""The task behind `SeastarSwim-v0`: robots that swim along waypoints, each on a path of its own."""

from dataclasses import astuple
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.headings import EpisodeHeadings
from seastar_gym.envs.options import Path, SwimOptions
from seastar_gym.envs.paths import cross_track_error, make_path, shortest_way
from seastar_gym.envs.reward import Weights, reward_terms
from seastar_gym.envs.swimming import Flags, Floats, Score, Swimming


class Legs(NamedTuple):
    """Where robots swim between two of their waypoints [m], shape (n_robots, 2) each but for `beyond`."""

    start: Floats
    """Waypoint before the current one, or the origin."""
    current: Floats
    following: Floats
    """Waypoint after the current one; the current one on the last leg."""
    beyond: Floats
    """Length of the path from `following` to its end, shape (n_robots,)."""
    ends: Floats
    """`current` and `following`, shape (n_robots, 4)."""


class SwimTask(Swimming):
    """Task of `n_robots` robots that swim along waypoints.

    Every robot has its own path and its own generator, so a robot of a batch does what it would do alone.
    """

    TERMS: tuple[str, ...] = ("reward_progress", "reward_waypoint", "reward_effort")
    per_episode: tuple[str, ...] = ("path", "random_heading", "reward", "waypoint_radius")
    goals_are_waypoints = True

    def __init__(self, options: SwimOptions, n_robots: int, threads: int | None, *, effort: bool = False):
        self._asked = None if options.headings is None else EpisodeHeadings(options.headings, n_robots)
        if options.headings is not None:
            self.TERMS = (*self.TERMS, "reward_heading")
        super().__init__(options, n_robots, threads, draws=options.randomization, effort=effort)
        self._weights = Weights(*(np.full(n_robots, value) for value in astuple(options.reward)))
        self._radius = np.full(n_robots, options.waypoint_radius)  # [m]
        self._robots = np.arange(n_robots)
        self.waypoints = np.zeros((n_robots, 1, 2))
        self._way_after = np.zeros((n_robots, 1))  # from waypoint k to the last [m]
        self.n_waypoints = np.ones(n_robots, np.int64)
        self._known_legs: Legs | None = None  # until a robot reaches a waypoint, or gets other ones
        self._way_to_go, self._way_at_reset = np.zeros(n_robots), np.zeros(n_robots)  # [m]
        self._turn_to_go = np.zeros(n_robots)  # [rad]

    def _draw(self, robot: int, rng: np.random.Generator, asked: Path | None) -> None:
        options = self.options_of[robot]
        waypoints = make_path(options.path if asked is None else asked, rng)
        if self._asked is not None:
            self._asked.begin(robot, self._asked.headings.of_path(waypoints, rng))
        self._set_path(robot, waypoints)
        self._radius[robot] = options.waypoint_radius
        for weights, value in zip(self._weights, astuple(options.reward), strict=True):
            weights[robot] = value

    @property
    def waypoint_radius(self) -> float:  # type: ignore[override]
        """Radius of the waypoints of robot 0 [m]."""
        return self.radius_of(0)

    def radius_of(self, robot: int) -> float:
        """Radius of a robot's waypoints [m]."""
        return float(self._radius[robot])

    def _begin(self, robots: Flags) -> None:
        self.waypoint_index[robots] = 0
        self._known_legs = None
        self._way_to_go[robots] = self._measure_way_to_go(self.simulator.hub_position())[robots]
        self._way_at_reset[robots] = self._way_to_go[robots]
        if self._asked is not None:
            self._turn_to_go[robots] = self._asked.to_go(self.waypoint_index, self.heading())[robots]

    def _set_path(self, robot: int, waypoints: Floats) -> None:
        missing = len(waypoints) - self.waypoints.shape[1]
        if missing > 0:
            self.waypoints = np.pad(self.waypoints, ((0, 0), (0, missing), (0, 0)))
            self._way_after = np.pad(self._way_after, ((0, 0), (0, missing)))
        n = len(waypoints)
        self.waypoints[robot, :n] = waypoints
        self.waypoints[robot, n:] = waypoints[-1]
        legs = _length(np.diff(waypoints, axis=0))
        self._way_after[robot] = 0.0
        self._way_after[robot, : n - 1] = np.cumsum(legs[::-1])[::-1]
        self.n_waypoints[robot] = n
        self._known_legs = None

    def move_waypoints(self, by: Floats) -> None:
        """Move all waypoints of every robot by a vector [m], shape (n_robots, 2)."""
        self.waypoints += by[:, None]
        self._known_legs = None

    def waypoints_of(self, robot: int) -> Floats:
        """Waypoints of a robot's present episode [m], shape (n, 2), a copy."""
        return self.waypoints[robot, : self.n_waypoints[robot]].copy()

    def headings_of(self, robot: int) -> Floats | None:
        """Asked headings of a robot's present episode [rad], shape (n,), a copy; None if none are asked for."""
        return None if self._asked is None else self._asked.of_robot(robot)

    def _waypoint(self, k: NDArray[np.int64]) -> Floats:
        """Waypoint k of every robot [m], the last one beyond the end; shape (n_robots, 2)."""
        return np.asarray(self.waypoints[self._robots, np.minimum(k, self.waypoints.shape[1] - 1)])

    @property
    def _legs(self) -> Legs:
        if self._known_legs is None:
            k, last = self.waypoint_index, self.n_waypoints - 1
            leg, beyond = np.minimum(k, last), self._way_after[self._robots, np.minimum(k + 1, last)]
            start = np.where((leg == 0)[:, None], 0.0, self._waypoint(np.maximum(leg - 1, 0)))
            current, following = self._waypoint(k), self._waypoint(k + 1)
            ends = np.concatenate([current, following], axis=1)
            self._known_legs = Legs(start, current, following, beyond, ends)
        return self._known_legs

    def _measure_way_to_go(self, hub: Floats) -> Floats:
        """Length [m], shape (n_robots,), of the rewarded route from hub positions [m], shape (n_robots, 2), to the end.

        It passes the circle of the current waypoint on the way to the next; from there it leads from centre to centre.
        A route through the centre of the current waypoint would pay for corners that need not be swum.
        """
        legs = self._legs
        return shortest_way(hub, legs.current, legs.following, self._weights.aim * self._radius) + legs.beyond

    def _targets(self) -> Floats:
        return self._legs.ends

    def _task_observation(self) -> Floats:
        if self._asked is None:
            return super()._task_observation()
        return self._asked.seen(self.waypoint_index, self.seen_heading())

    def _reward_terms(self, hub: Floats, pulses: Floats) -> Score:
        reached = self._pass_waypoints(hub)
        before = self._way_to_go
        self._way_to_go = self._measure_way_to_go(hub)
        success = self.waypoint_index == self.n_waypoints
        terms = reward_terms(self._weights, before - self._way_to_go, reached, pulses, self._turned())
        return Score(terms, success, success)

    def _turned(self) -> Floats | None:
        """Decrease of what is left to turn since it was last measured [rad], shape (n_robots,)."""
        if self._asked is None:
            return None
        before, self._turn_to_go = self._turn_to_go, self._asked.to_go(self.waypoint_index, self.heading())
        return before - self._turn_to_go

    def _energy_per_metre(self) -> Floats:
        """Energy over the decrease of the way to go, both since the reset [J/m]; infinite where it did not decrease."""
        energy, progress = self._energy, self._way_at_reset - self._way_to_go
        without = np.where(energy > 0.0, np.inf, energy)
        return np.divide(energy, progress, out=without, where=progress > 0.0)

    def _pass_waypoints(self, hub: Floats) -> NDArray[np.int64]:
        """Move on while the current waypoint is within its radius, and its heading met if one is asked for.

        Returns the number of waypoints reached, shape (n_robots,).
        """
        heading = None if self._asked is None else self.heading()
        reached = np.zeros(self.n_robots, np.int64)
        while True:
            near = _length(self._legs.current - hub) <= self._radius
            if self._asked is not None and heading is not None:
                near &= self._asked.is_met(self.waypoint_index, heading)
            if not np.count_nonzero(near):
                return reached
            near &= self.waypoint_index < self.n_waypoints
            if not np.count_nonzero(near):
                return reached
            self.waypoint_index += near
            reached += near
            self._known_legs = None

    def _task_info(self, hub: Floats) -> dict[str, NDArray[Any]]:
        legs = self._legs
        return {
            "waypoint_index": self.waypoint_index.copy(),
            "distance": _length(legs.current - hub),
            "cross_track_error": cross_track_error(hub, legs.start, legs.current),
            "energy_per_metre": self._energy_per_metre(),
            **self._heading_facts(),
        }

    def _heading_facts(self) -> dict[str, Floats]:
        """Heading, and the turn from it to the asked one [rad], where headings are asked for."""
        if self._asked is None:
            return {}
        heading = self.heading()
        return {"heading": heading, "heading_error": self._asked.turn(self.waypoint_index, heading)}


def _length(vectors: Floats) -> Floats:
    """Euclidean length over the last axis, of size 2."""
    return np.hypot(vectors[..., 0], vectors[..., 1])
