"""The task behind `SeastarSwim-v0`: robots that swim along waypoints, each on a path of its own."""

from dataclasses import replace
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.accuracy.certificate import Certificate
from seastar_gym.accuracy.info import read_certificate
from seastar_gym.envs.commands import Actions
from seastar_gym.envs.decisions import checked_decision_period, unless_strokes
from seastar_gym.envs.headings import AskedHeadings, Headings
from seastar_gym.envs.observation import scene_layout
from seastar_gym.envs.paths import FARTHEST, cross_track_error, make_path
from seastar_gym.envs.randomization import DomainRandomization
from seastar_gym.envs.reward import RewardWeights, reward_terms
from seastar_gym.envs.swimming import Flags, Floats, Outcome, Score, Swimming
from seastar_gym.scene import Scene, SmaWires
from seastar_gym.scene.checks import as_float, require_number, shown
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.scene_file import load_scene
from seastar_gym.scene.serial import Part, from_dict

Path = str | ArrayLike
"""Path by its name, or waypoints [m], shape (n, 2)."""
Plain = dict[str, Any]
"""Part of a scene, or of the task, as plain data, see `seastar_gym.scene.serial`."""

__all__ = ["Outcome", "Path", "Plain", "SwimTask", "make_scene", "read", "scene_at", "scene_observation_size"]


def make_scene(
    scene: Scene | Plain | None, fidelity: Fidelity | None, decision_period: float | None = None
) -> Scene:
    """Scene with the nodes and numerics that it names, otherwise with those of `fidelity`, see `Scene.at`.

    Without a scene, it is the chapter's at the fidelity, with wires for decisions that are not strokes.

    decision_period: Time between decisions [s]. None means a stroke.
    """
    if scene is None:
        chapters = Scene().at(fidelity)
        in_strokes = decision_period is None or decision_period == chapters.actuator.period
        return chapters if in_strokes else replace(chapters, actuator=SmaWires())
    scene = read(scene, Scene)
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be a Scene, not {shown(scene)}.")
    return scene.at(fidelity)


def scene_at(file: FilePath | None, fidelity: Fidelity) -> Scene | None:
    """Scene of a file as command lines name it, with its own numerics, or those of `fidelity` where it names none.

    None for no file.
    """
    if file is None:
        return None
    scene = load_scene(file)
    return make_scene(scene, None if scene.numerics.named else fidelity)


def read(part: Part | Plain, kind: type[Any]) -> Part:
    """Part that was given as an object or in plain form."""
    return from_dict(part, kind) if isinstance(part, dict) else part


def scene_observation_size(scene: Scene, observe_actuators: bool = True, with_headings: bool = False) -> int:
    """Length of the observation of a scene's robot. with_headings: Whether headings are asked for."""
    return scene_layout(scene, observe_actuators, with_headings).size


class SwimTask(Swimming):
    """Task of `n_robots` robots that swim along waypoints, for the arguments see `SeastarSwimEnv`.

    Every robot has its own path and its own generator, so a robot of a batch does what it would do alone.
    """

    TERMS: tuple[str, ...] = ("reward_progress", "reward_waypoint", "reward_effort")

    def __init__(
        self,
        scene: Scene,
        n_robots: int,
        path: Path,
        reward: RewardWeights | Plain,
        waypoint_radius: float,
        random_heading: bool,
        threads: int | None,
        randomization: DomainRandomization | Plain | None = None,
        certificate: Certificate | str | PathLike[str] | None = None,
        error_bars: bool = False,
        actions: Actions = "limbs",
        decision_period: float | None = None,
        observe_actuators: bool = True,
        headings: Headings | Plain | None = None,
        effort: bool = False,
    ):
        randomization, reward = read(randomization, DomainRandomization), read(reward, RewardWeights)
        headings = read(headings, Headings)
        if not isinstance(randomization, DomainRandomization | None):
            raise ValueError(f"randomization must be a DomainRandomization or None, not {shown(randomization)}.")
        waypoint_radius = as_float(waypoint_radius)
        require_number("waypoint_radius", waypoint_radius, "m")
        if waypoint_radius > FARTHEST:
            raise ValueError(f"waypoint_radius must be at most {FARTHEST:g} m, not {shown(waypoint_radius)}.")
        if not isinstance(reward, RewardWeights):
            raise ValueError(f"reward must be RewardWeights, not {shown(reward)}.")
        if not isinstance(headings, Headings | None):
            raise ValueError(f"headings must be Headings or None, not {shown(headings)}.")
        waypoints = make_path(path, np.random.default_rng(0))  # refuses a bad path now, not at the first reset
        if headings is not None:
            headings.of_path(waypoints, np.random.default_rng(0))  # likewise
            self.TERMS = (*self.TERMS, "reward_heading")
        self.headings = headings
        self._asked = None if headings is None else AskedHeadings(headings, n_robots)
        timed = unless_strokes(checked_decision_period(decision_period, scene), scene)
        super().__init__(
            scene, n_robots, threads, random_heading=random_heading, draws=randomization,
            certificate=read_certificate(certificate, scene, timed), error_bars=error_bars, actions=actions,
            decision_period=decision_period, observe_actuators=observe_actuators, effort=effort,
        )  # fmt: skip
        self.randomization = randomization
        self.path: Path = path if isinstance(path, str) else waypoints
        self.reward, self.waypoint_radius = reward, waypoint_radius
        self.waypoints = np.zeros((n_robots, 1, 2))
        self._way_after = np.zeros((n_robots, 1))  # from waypoint k to the last [m]
        self.n_waypoints = np.ones(n_robots, np.int64)
        self._way_to_go, self._way_at_reset = np.zeros(n_robots), np.zeros(n_robots)  # [m]
        self._turn_to_go = np.zeros(n_robots)  # [rad]

    def _draw(self, robot: int, rng: np.random.Generator, asked: Path | None) -> None:
        waypoints = make_path(self.path if asked is None else asked, rng)
        if self._asked is not None:
            self._asked.begin(robot, self._asked.headings.of_path(waypoints, rng))
        self._set_path(robot, waypoints)

    def _begin(self, robots: Flags) -> None:
        self.waypoint_index[robots] = 0
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

    def waypoints_of(self, robot: int) -> Floats:
        """Waypoints of a robot's present episode [m], shape (n, 2), a copy."""
        return self.waypoints[robot, : self.n_waypoints[robot]].copy()

    def headings_of(self, robot: int) -> Floats | None:
        """Asked headings of a robot's present episode [rad], shape (n,), a copy; None if none are asked for."""
        return None if self._asked is None else self._asked.of_robot(robot)

    def _waypoint(self, k: NDArray[np.int64]) -> Floats:
        """Waypoint k of every robot [m], the last one beyond the end, the origin at -1; shape (n_robots, 2)."""
        robots = np.arange(self.n_robots)
        found = self.waypoints[robots, np.clip(k, 0, self.n_waypoints - 1)]
        return np.where((k < 0)[:, None], 0.0, found)

    def _measure_way_to_go(self, hub: Floats) -> Floats:
        """Length [m], shape (n_robots,), of the rewarded route from hub positions [m], shape (n_robots, 2), to the end.

        It passes the circle of the current waypoint on the way to the next; from there it leads from centre to centre.
        A route through the centre of the current waypoint would pay for corners that need not be swum.
        """
        k, robots = self.waypoint_index, np.arange(self.n_robots)
        to_next = self.reward.way_to_next(hub, self._waypoint(k), self._waypoint(k + 1), self.waypoint_radius)
        return to_next + self._way_after[robots, np.minimum(k + 1, self.n_waypoints - 1)]

    def _targets(self) -> Floats:
        return np.concatenate([self._waypoint(self.waypoint_index), self._waypoint(self.waypoint_index + 1)], axis=1)

    def _wanted(self) -> Floats:
        if self._asked is None:
            return super()._wanted()
        return self._asked.seen(self.waypoint_index, self.heading())

    def _score(self, hub: Floats, pulses: Floats) -> Score:
        reached = self._pass_waypoints(hub)
        before = self._way_to_go
        self._way_to_go = self._measure_way_to_go(hub)
        success = self.waypoint_index == self.n_waypoints
        terms = reward_terms(self.reward, before - self._way_to_go, reached, pulses, self._turned())
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
        found = np.divide(energy, progress, out=np.full(self.n_robots, np.inf), where=progress > 0.0)
        return np.where(np.isnan(energy) | (energy == 0.0), energy, found)

    def _pass_waypoints(self, hub: Floats) -> NDArray[np.int64]:
        """Move on while the current waypoint is within its radius, and its heading met if one is asked for.

        Returns the number of waypoints reached, shape (n_robots,).
        """
        heading = None if self._asked is None else self.heading()
        reached = np.zeros(self.n_robots, np.int64)
        while True:
            near = _length(self._waypoint(self.waypoint_index) - hub) <= self.waypoint_radius
            near &= self.waypoint_index < self.n_waypoints
            if self._asked is not None and heading is not None:
                near &= self._asked.is_met(self.waypoint_index, heading)
            if not near.any():
                return reached
            self.waypoint_index += near
            reached += near

    def _goal_facts(self, hub: Floats) -> dict[str, NDArray[Any]]:
        current = self._waypoint(self.waypoint_index)
        leg = np.minimum(self.waypoint_index, self.n_waypoints - 1)
        return {
            "waypoint_index": self.waypoint_index.copy(),
            "distance": _length(current - hub),
            "cross_track_error": cross_track_error(hub, self._waypoint(leg - 1), self._waypoint(leg)),
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
