"""Swims along waypoints: what tasks along a path have in common, and that of `SeastarSwim-v0`.

What is left to swim is the length of the rewarded route, see `rewards.py`; what is left to turn is known
by the shortest way round, from one asked heading to the next, see `headings.py`.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.headings import HeadingTargets, wrapped
from seastar_gym.envs.layout import HEADINGS, Entry
from seastar_gym.envs.paths import FARTHEST, WAYPOINT_RADIUS, make_path
from seastar_gym.envs.rewards import RewardWeights, Weights, reward_terms
from seastar_gym.envs.robots import Flags, Floats, Robots, Score, Task
from seastar_gym.envs.routes import length_of_routes, measured_routes
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import as_float, require_flag, require_kind, require_number, shown
from seastar_gym.scene.serial import read

Path = str | ArrayLike
"""Path by its name, or waypoints [m], shape (n, 2)."""


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


class Waypoints(Task):
    """Base of tasks along waypoints, each robot on a path of its own.

    Kept of an episode: waypoints [m], shape (n_robots, n, 2), their number, the way from each to the last [m], radius
    and aim [m], `RewardWeights` as numbers, the legs of the robots, and what is left to swim [m] and to turn [rad].
    """

    terms: tuple[str, ...] = ("reward_progress", "reward_waypoint", "reward_effort", "reward_time")
    goals_are_waypoints = True
    path: Path = "random"
    waypoint_radius: float = WAYPOINT_RADIUS
    reward = RewardWeights()
    headings: HeadingTargets | None = None

    def draw(self, rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
        """Waypoints, and what follows from them."""
        waypoints = make_path(self.path, rng)
        asked = {} if self.headings is None else _turns(self.headings.of_path(waypoints, rng))
        return {**self.along(waypoints), **asked}

    def along(self, waypoints: Floats) -> dict[str, Any]:
        """What is kept of an episode along a path [m], shape (n, 2)."""
        legs = length(np.diff(waypoints, axis=0))
        way_after = np.append(np.cumsum(legs[::-1])[::-1], 0.0)
        return {
            "waypoints": waypoints, "n_waypoints": np.int64(len(waypoints)), "way_after": way_after,
            "radius": float(self.waypoint_radius), "aim": float(self.reward.aim * self.waypoint_radius),
            "weights": np.array(astuple(self.reward), np.float64),
            "way_to_go": 0.0, "way_at_reset": 0.0, "turn_to_go": 0.0,
        }  # fmt: skip

    def begin(self, robots: Robots, begun: Flags) -> None:
        """Swim to the first waypoint."""
        now = robots.episode
        robots.waypoint_index[begun] = 0
        now.prices = Weights(*now.weights.T)
        self.know_legs(robots)
        now.way_to_go[begun] = self.measure_way_to_go(robots, robots.simulator.hub_position())[begun]
        now.way_at_reset[begun] = now.way_to_go[begun]
        if self.headings is not None:
            now.turn_to_go[begun] = self._left_to_turn(robots, robots.heading())[begun]

    def know_legs(self, robots: Robots) -> None:
        """Know where robots swim, after their waypoints or the number of those that are reached have changed."""
        now, each, k, last = robots.episode, np.arange(robots.n_robots), robots.waypoint_index, _last(robots)
        leg, after = np.minimum(k, last), np.minimum(k + 1, last)
        start = np.where((leg == 0)[:, None], 0.0, now.waypoints[each, np.maximum(leg - 1, 0)])
        current, following = now.waypoints[each, leg], now.waypoints[each, after]
        ends = np.concatenate([current, following], axis=1)
        now.legs = Legs(start, current, following, now.way_after[each, after], ends)
        now.measured_at = None

    def move_waypoints(self, robots: Robots, by: Floats) -> None:
        """Move all waypoints of every robot by a vector [m], shape (n_robots, 2)."""
        robots.episode.waypoints += by[:, None]
        self.know_legs(robots)

    def measure_way_to_go(self, robots: Robots, hub: Floats) -> Floats:
        """Length [m], shape (n_robots,), of the rewarded route from hub positions [m], shape (n_robots, 2), to the end.

        It passes the circle of the current waypoint on the way to the next; from there it leads from centre to centre.
        A route through the centre of the current waypoint would pay for corners that need not be swum.
        """
        now = robots.episode
        return length_of_routes(self._measured(robots, hub), now.aim) + now.legs.beyond

    def _measured(self, robots: Robots, hub: Floats) -> Floats:
        """What `measure_routes` finds at hub positions [m], shape (n_robots, 2): once for an array and its legs."""
        now = robots.episode
        if now.measured_at is not hub:
            start, current, following, *_ = now.legs
            now.measured = measured_routes(np.ascontiguousarray(hub), start, current, following, now.aim)
            now.measured_at = hub
        return np.asarray(now.measured)

    def targets(self, robots: Robots) -> Floats:
        """The current waypoint and the next."""
        return np.asarray(robots.episode.legs.ends)

    @property
    def entries(self) -> tuple[Entry, ...]:  # type: ignore[override]
        """Turns to asked headings."""
        return () if self.headings is None else HEADINGS

    def observation(self, robots: Robots) -> Floats:
        """Cosine and sine of the turns to the headings at the current waypoint and the next, shape (n_robots, 4)."""
        if self.headings is None:
            return super().observation(robots)
        k, heading = robots.waypoint_index, robots.seen_heading()
        turns = np.stack([_turn(robots, k, heading), _turn(robots, k + 1, heading)], axis=1)
        return np.stack([np.cos(turns), np.sin(turns)], axis=2).reshape(len(heading), 4)

    def score(self, robots: Robots, hub: Floats, pulses: Floats) -> Score:
        """Progress along the route, waypoints, effort, and turns to asked headings; success at the last waypoint."""
        now, heading = robots.episode, None if self.headings is None else robots.heading()
        reached = self._pass_waypoints(robots, hub, heading)
        before, now.way_to_go = now.way_to_go, self.measure_way_to_go(robots, hub)
        turned = None
        if heading is not None:
            turn_before, now.turn_to_go = now.turn_to_go, self._left_to_turn(robots, heading)
            turned = turn_before - now.turn_to_go
        success = robots.waypoint_index == now.n_waypoints
        terms = reward_terms(now.prices, before - now.way_to_go, reached, pulses, robots.decision_period, turned)
        return Score(terms, success, success)

    def _pass_waypoints(self, robots: Robots, hub: Floats, heading: Floats | None) -> NDArray[np.int64]:
        """Move on while the current waypoint is within its radius, and its heading met if one is asked for.

        Returns the number of waypoints reached, shape (n_robots,).
        """
        now, reached = robots.episode, np.zeros(robots.n_robots, np.int64)
        while True:
            near = self._measured(robots, hub)[6] <= now.radius
            if self.headings is not None and heading is not None:
                near &= np.abs(_turn(robots, robots.waypoint_index, heading)) <= self.headings.tolerance
            if not any(near.tolist()):
                return reached
            near &= robots.waypoint_index < now.n_waypoints
            if not any(near.tolist()):
                return reached
            robots.waypoint_index += near
            reached += near
            self.know_legs(robots)

    def _left_to_turn(self, robots: Robots, heading: Floats) -> Floats:
        """All that is left to turn on the way through the waypoints to the last [rad], shape (n_robots,)."""
        k = robots.waypoint_index
        return np.abs(_turn(robots, k, heading)) + _at(robots, robots.episode.turn_after, k)

    def info(self, robots: Robots, hub: Floats) -> dict[str, NDArray[Any]]:
        """Where robots are on their paths, and their headings where some are asked for."""
        now, k, measured = robots.episode, robots.waypoint_index, self._measured(robots, hub)
        found = {
            "waypoint_index": k.copy(),
            "distance": measured[6],
            "cross_track_error": measured[7],
            "energy_per_metre": _per_metre(robots.energy, now.way_at_reset - now.way_to_go),
        }
        if self.headings is not None:
            heading = robots.heading()
            found |= {"heading": heading, "heading_error": _turn(robots, k, heading)}
        return found

    def waypoints_of(self, robots: Robots, robot: int) -> Floats:
        """Waypoints of a robot's present episode [m], shape (n, 2), a copy; none before the first."""
        now = robots.episode
        if not hasattr(now, "waypoints"):
            return np.zeros((0, 2))
        return np.array(now.waypoints[robot, : now.n_waypoints[robot]])

    def headings_of(self, robots: Robots, robot: int) -> Floats | None:
        """Asked headings of a robot's present episode [rad], shape (n,), a copy; None if none are asked for."""
        now = robots.episode
        return np.array(now.asked[robot, : now.n_waypoints[robot]]) if hasattr(now, "asked") else None

    def radius_of(self, robots: Robots, robot: int) -> float:
        """Radius of a robot's waypoints [m]."""
        return float(robots.episode.radius[robot]) if hasattr(robots.episode, "radius") else self.waypoint_radius


@dataclass(frozen=True)
class AlongPath(Waypoints):
    """Waypoints, and nothing else: the task of `SeastarSwim-v0`, whose docstring documents these numbers."""

    path: Path = "pentagon"
    reward: RewardWeights = RewardWeights()
    waypoint_radius: float = WAYPOINT_RADIUS
    random_heading: bool = False
    headings: HeadingTargets | None = None

    option = "path"
    per_episode = ("path", "random_heading", "reward", "waypoint_radius")

    def __post_init__(self) -> None:
        for name, kind in {"reward": RewardWeights, "headings": HeadingTargets}.items():
            object.__setattr__(self, name, read(getattr(self, name), kind))
        object.__setattr__(self, "waypoint_radius", as_float(self.waypoint_radius))
        require_kind("reward", self.reward, RewardWeights, "RewardWeights")
        require_kind("headings", self.headings, HeadingTargets | None, "HeadingTargets or None")
        require_flag("random_heading", self.random_heading)
        require_number("waypoint_radius", self.waypoint_radius, "m")
        if self.waypoint_radius > FARTHEST:
            raise ValueError(f"waypoint_radius must be at most {FARTHEST:g} m, not {shown(self.waypoint_radius)}.")
        waypoints = make_path(self.path, np.random.default_rng(0))  # refuses a bad path now, not at the first reset
        if not isinstance(self.path, str):
            object.__setattr__(self, "path", waypoints)
        if self.headings is not None:
            self.headings.of_path(waypoints, np.random.default_rng(0))  # likewise

    @property
    def terms(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the reward's terms."""
        return Waypoints.terms if self.headings is None else (*Waypoints.terms, "reward_heading")


@dataclass(frozen=True)
class HeldOutPaths(AlongPath):
    """Random paths of the split "test": numbered episodes, which no reset with a seed draws."""

    option = "instance"
    spawn_key = (0,)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.path, str) or self.path != "random":
            raise ValueError('split="test" is for tasks and path="random": other paths are no draws.')


def _turns(asked: Floats) -> dict[str, Floats]:
    """Asked headings [rad], shape (n,), and what is to turn from each to the last [rad]."""
    turns = np.abs(wrapped(np.diff(asked)))
    return {"asked": asked, "turn_after": np.append(np.cumsum(turns[::-1])[::-1], 0.0)}


def _last(robots: Robots) -> NDArray[np.int64]:
    """Number of every robot's last waypoint, shape (n_robots,)."""
    return np.asarray(robots.episode.n_waypoints - 1)


def _at(robots: Robots, rows: Floats, k: NDArray[np.int64]) -> Floats:
    """Number k of every robot's row, the last one beyond its end, shape (n_robots,)."""
    return np.asarray(rows[np.arange(robots.n_robots), np.minimum(k, _last(robots))])


def _turn(robots: Robots, k: NDArray[np.int64], heading: Floats) -> Floats:
    """Turns [rad], shape (n_robots,), from headings to those at waypoints k, the last one beyond the end."""
    return wrapped(_at(robots, robots.episode.asked, k) - heading)


def _per_metre(energy: Floats, progress: Floats) -> Floats:
    """Energy [J] over the decrease of the way to go [J/m]; infinite where it did not decrease."""
    is_nearer = progress > 0.0
    if all(is_nearer.tolist()):
        return energy / progress
    return np.divide(energy, progress, out=np.where(energy > 0.0, np.inf, energy), where=is_nearer)


def length(vectors: Floats) -> Floats:
    """Euclidean length over the last axis, of size 2."""
    return np.hypot(vectors[..., 0], vectors[..., 1])
