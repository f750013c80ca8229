"""The task behind both environments: a batch of robots, each on a path of its own, advanced by decisions."""

from collections.abc import Generator
from dataclasses import replace
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.commands import Actions
from seastar_gym.envs.decisions import checked_decision_period
from seastar_gym.envs.headings import AskedHeadings, Headings
from seastar_gym.envs.masks import action_masks, can_be_masked, masked_limbs
from seastar_gym.envs.observation import (
    VELOCITY_SCALE,
    body_axes,
    observation_size,
    observe,
    scene_layout,
    to_float32,
    with_more,
)
from seastar_gym.envs.paths import FARTHEST, cross_track_error, make_path
from seastar_gym.envs.promises import promised, read_certificate
from seastar_gym.envs.randomization import LIMB_STRENGTHS, DomainRandomization, drawn_scene
from seastar_gym.envs.reward import RewardWeights, pulses_of, reward_terms
from seastar_gym.envs.stations import stations
from seastar_gym.scene import Numerics, Scene, SmaWires
from seastar_gym.scene.actuators.actuator import Deaf
from seastar_gym.scene.certificate import Certificate
from seastar_gym.scene.checks import require_flag, require_number, shown
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.serial import Part, from_dict
from seastar_gym.simd.rows import to_rows
from seastar_gym.simulator import Simulator, SolverStatus, StrokeReport

Floats = NDArray[np.float64]
Path = str | ArrayLike
"""Path by its name, or waypoints [m], shape (n, 2)."""
Plain = dict[str, Any]
"""Part of a scene, or of the task, as plain data, see `seastar_gym.scene.serial`."""

DEFAULT_FIDELITY: Fidelity = "balanced"


class Outcome(NamedTuple):
    """Reward, end and info of a decision, and the commands that were followed; arrays over robots."""

    reward: Floats
    terminated: NDArray[np.bool_]
    info: dict[str, NDArray[Any]]
    commands: Floats


def make_scene(
    scene: Scene | Plain | None, fidelity: Fidelity | None, decision_period: float | None = None
) -> Scene:
    """Scene with the numerics that it names, otherwise with those of `fidelity`, by default "balanced".

    Without a scene, it is the fidelity's own, with its nodes per limb and its discretisation, and with wires for
    decisions that are not strokes. ValueError where scene and fidelity name different numerics.

    decision_period: Time between decisions [s]. None means a stroke.
    """
    if scene is None:
        chapters = Scene.preset(DEFAULT_FIDELITY if fidelity is None else fidelity)
        in_strokes = decision_period is None or decision_period == chapters.actuator.period
        return chapters if in_strokes else replace(chapters, actuator=SmaWires())
    scene = read(scene, Scene)
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be a Scene, not {shown(scene)}.")
    if fidelity is None and scene.numerics.named:
        return scene
    numerics = Numerics.preset(DEFAULT_FIDELITY if fidelity is None else fidelity)
    if scene.numerics.named and scene.numerics != numerics:
        raise ValueError(
            f'fidelity="{fidelity}" contradicts the numerics that the scene names, {shown(scene.numerics)}: '
            "give one of them."
        )
    return replace(scene, numerics=numerics)


def read(part: Part | Plain, kind: type[Any]) -> Part:
    """Part that was given as an object or in plain form."""
    return from_dict(part, kind) if isinstance(part, dict) else part


def scene_observation_size(scene: Scene, observe_actuators: bool = True, with_headings: bool = False) -> int:
    """Length of the observation of a scene's robot. with_headings: Whether headings are asked for."""
    return scene_layout(scene, observe_actuators, with_headings).size


class SwimTask:
    """Task of `n_robots` robots that swim along waypoints, for the arguments see `SeastarSwimEnv`.

    Every robot has its own path and its own generator, so a robot of a batch does what it would do alone.
    """

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
    ):
        randomization, reward = read(randomization, DomainRandomization), read(reward, RewardWeights)
        headings = read(headings, Headings)
        if not isinstance(randomization, DomainRandomization | None):
            raise ValueError(f"randomization must be a DomainRandomization or None, not {shown(randomization)}.")
        require_number("waypoint_radius", waypoint_radius, "m")
        if waypoint_radius > FARTHEST:
            raise ValueError(f"waypoint_radius must be at most {FARTHEST:g} m, not {shown(waypoint_radius)}.")
        require_flag("random_heading", random_heading)
        if not isinstance(reward, RewardWeights):
            raise ValueError(f"reward must be RewardWeights, not {shown(reward)}.")
        if not isinstance(headings, Headings | None):
            raise ValueError(f"headings must be Headings or None, not {shown(headings)}.")
        require_flag("observe_actuators", observe_actuators)
        self.decision_period = checked_decision_period(decision_period, scene)
        self._in_strokes = self.decision_period == scene.actuator.period
        self.actions: Actions = actions
        self.observe_actuators = observe_actuators
        self._can_be_masked = can_be_masked(scene.actuator)
        waypoints = make_path(path, np.random.default_rng(0))  # refuses a bad path now, not at the first reset
        if headings is not None:
            headings.of_path(waypoints, np.random.default_rng(0))  # likewise
        self.headings = headings
        self._asked = None if headings is None else AskedHeadings(headings, n_robots)
        self.scene, self.randomization = scene, randomization
        self.drawn = {} if randomization is None else randomization.first_values(scene, n_robots)
        self.simulator = Simulator(drawn_scene(scene, self.drawn), n_robots, threads, error_bars)
        self._error_bars = error_bars
        self.certificate = read_certificate(certificate, scene)
        self._promise = self.simulator.scene, self._promise_of(self.simulator.scene)
        peak = np.max(self.simulator.scene.actuator.peak_angle)  # before the first draw the largest that may be drawn
        if scene.robot.hub_hinge == "turning" and 2 * peak >= scene.robot.opening_angle * (1 - 1e-9):
            raise ValueError(
                'With hub_hinge="turning" some actions would close a hub hinge, where its curvature is infinite: use '
                'hub_hinge="opening" or a smaller peak angle.'
            )
        self.path: Path = path if isinstance(path, str) else waypoints
        self.reward, self.waypoint_radius, self.random_heading = reward, waypoint_radius, random_heading
        self.n_robots = n_robots
        self.waypoints = np.zeros((n_robots, 1, 2))
        self._way_after = np.zeros((n_robots, 1))  # from waypoint k to the last [m]
        self.n_waypoints = np.ones(n_robots, np.int64)
        self.waypoint_index = np.zeros(n_robots, np.int64)
        self._way_to_go, self._turn_to_go = np.zeros(n_robots), np.zeros(n_robots)
        self._way_at_reset, self._energy = np.zeros(n_robots), np.zeros(n_robots)  # [m]; since the reset [J]

    @property
    def observation_size(self) -> int:
        """Length of one robot's observation."""
        return scene_observation_size(self.simulator.scene, self.observe_actuators, self.headings is not None)

    def reset(self, robots: NDArray[np.bool_], generators: list[np.random.Generator], path: Path | None = None) -> None:
        """Begin a new episode of the robots in a mask, shape (n_robots,).

        generators: Random generator of every robot, which draws its path, asked headings, its own heading, then
            numbers of its scene.
        """
        headings = np.zeros(self.n_robots)
        for robot in np.flatnonzero(robots):
            waypoints = make_path(self.path if path is None else path, generators[robot])
            if self._asked is not None:
                self._asked.begin(int(robot), self._asked.headings.of_path(waypoints, generators[robot]))
            self._set_path(robot, waypoints)
            if self.random_heading:
                headings[robot] = generators[robot].uniform(-np.pi, np.pi)
            if self.randomization is not None:
                self.randomization.draw(self.drawn, int(robot), generators[robot])
        if self.drawn:
            self.simulator.set_scene(drawn_scene(self.scene, self.drawn), robots)
            strengths = np.asarray(self.scene.limb_strengths or 1.0) * self.drawn.get(LIMB_STRENGTHS, 1.0)
            self.simulator.set_limb_strengths(strengths)
        self.simulator.reset(robots, headings)
        self.waypoint_index[robots] = 0
        self._way_to_go[robots] = self._measure_way_to_go(self.simulator.hub_position())[robots]
        self._way_at_reset[robots], self._energy[robots] = self._way_to_go[robots], 0.0
        if self._asked is not None:
            self._turn_to_go[robots] = self._asked.to_go(self.waypoint_index, self.heading())[robots]

    def _set_path(self, robot: np.intp, waypoints: Floats) -> None:
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

    def heading(self) -> Floats:
        """Direction of every robot's body frame [rad], shape (n_robots,): the same bits for one robot and for many."""
        simulator = self.simulator
        out = np.empty((len(simulator.q), 2, simulator.q.shape[2]))
        body_axes(simulator.coefficients.rest, simulator.q, stations(simulator.scene.robot.nodes_per_limb), out)
        c, s = out.transpose(1, 0, 2).reshape(2, -1)[:, : self.n_robots]
        return np.asarray(np.arctan2(s, c))

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

    def observe(self) -> NDArray[np.float32]:
        """Observations, shape (n_robots, size), a fresh array; see observation.py."""
        simulator = self.simulator
        targets = np.concatenate([self._waypoint(self.waypoint_index), self._waypoint(self.waypoint_index + 1)], axis=1)
        target_rows = to_rows(targets)
        own, robot = simulator.coefficients, simulator.scene.robot
        out = np.empty((len(target_rows), observation_size(robot.n_limbs), target_rows.shape[2]))
        places = stations(robot.nodes_per_limb)
        observe(own.rest, own.limb_length, simulator.q, simulator.v, places, target_rows, VELOCITY_SCALE, out)
        seen = to_float32(out, self.n_robots)
        more = [simulator.observe_actuators()] if self.observe_actuators else []
        if self._asked is not None:
            more.append(self._asked.seen(self.waypoint_index, self.heading()))
        return with_more(seen, np.hstack(more), robot.n_limbs) if more else seen

    def action_masks(self) -> NDArray[np.bool_]:
        """Actions that wires can follow now, shape (n_robots, k), see masks.py."""
        return action_masks(self.actions, self.simulator.deaf_wires())

    def followed(self, commands: Floats) -> Floats:
        """Commands with zeros for limbs whose wire cannot follow its command now, shape (n_robots, n_limbs)."""
        if not self._can_be_masked:
            return commands
        return np.where(masked_limbs(commands, self.simulator.deaf_wires()), 0.0, commands)

    def step(self, commands: Floats) -> Outcome:
        """Advance every robot by one decision."""
        followed = self.followed(commands)
        report = self.simulator.advance(self.decision_period, followed)
        return self._judge(followed, np.count_nonzero(followed != commands, axis=1), report)

    def step_in_parts(self, commands: Floats, parts: int) -> Generator[float, None, Outcome]:
        """One decision in `parts` parts; yields the time since it began [s] after each, and returns the Outcome."""
        followed = self.followed(commands)
        report = yield from self.simulator.advance_in_parts(self.decision_period, followed, parts)
        return self._judge(followed, np.count_nonzero(followed != commands, axis=1), report)

    def warmth(self) -> Floats | None:
        """Contractions or temperatures of wires + and -, 0 to 1, shape (n_robots, n_limbs, 2); None without wires."""
        if not isinstance(self.scene.actuator, Deaf):
            return None
        numbers = self.simulator.observe_actuators()
        return np.clip(numbers.reshape(self.n_robots, self.scene.robot.n_limbs, -1)[..., :2], 0.0, 1.0)

    def _judge(self, commands: Floats, masked: NDArray[np.int64], report: StrokeReport) -> Outcome:
        """Outcome of a decision. commands: Those that were followed. masked: Number of limbs whose command was not."""
        hub = self.simulator.hub_position()
        reached = self._pass_waypoints(hub)
        before = self._way_to_go
        self._way_to_go = self._measure_way_to_go(hub)
        success = self.waypoint_index == self.n_waypoints
        self._energy += report.energy
        pulses = pulses_of(report.heating_time, commands)
        terms = reward_terms(self.reward, before - self._way_to_go, reached, pulses, self._turned())
        reward = terms["reward_progress"] + terms["reward_waypoint"] + terms["reward_effort"]
        if self._asked is not None:
            reward = reward + terms["reward_heading"]
        info = {
            **self.facts(hub),
            "is_success": success,
            "limbs_heated": np.count_nonzero(commands, axis=1),
            "heating_time": report.heating_time,
            "energy": report.energy,
            "energy_per_metre": self._energy_per_metre(),
            **({"masked_limbs": masked} if self._can_be_masked else {}),
            "newton_iterations": report.newton_iterations,
            "solver_status": report.status,
            "solver_message": _messages(report.status),
            "smallest_opening_angle": report.smallest_opening_angle,
            **terms,
        }
        return Outcome(reward, success | (report.status != SolverStatus.CONVERGED), info, commands)

    def first_info(self) -> dict[str, NDArray[Any]]:
        """Info before the first decision, with the names and types of a decision's info."""
        counts, none = np.zeros(self.n_robots, np.int64), np.zeros(self.n_robots)
        return {
            **self.facts(),
            "is_success": np.zeros(self.n_robots, bool),
            "limbs_heated": counts,
            "heating_time": none,
            "energy": none.copy(),
            "energy_per_metre": none.copy(),
            **({"masked_limbs": counts.copy()} if self._can_be_masked else {}),
            "newton_iterations": counts.copy(),
            "solver_status": counts.copy(),
            "solver_message": _messages(counts),
            "smallest_opening_angle": np.full(self.n_robots, min(self.scene.robot.opening_angle, np.pi)),
            **reward_terms(self.reward, none, counts, none, None if self._asked is None else none),
        }

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

    def facts(self, hub: Floats | None = None) -> dict[str, NDArray[Any]]:
        """Place of every robot on its path; arrays over robots, units as in the environment's docstring."""
        hub = self.simulator.hub_position() if hub is None else hub
        current = self._waypoint(self.waypoint_index)
        leg = np.minimum(self.waypoint_index, self.n_waypoints - 1)
        return {
            "time": self.simulator.time,
            "hub_position": hub.copy(),
            "waypoint_index": self.waypoint_index.copy(),
            "distance": _length(current - hub),
            "cross_track_error": cross_track_error(hub, self._waypoint(leg - 1), self._waypoint(leg)),
            **self._heading_facts(),
            **({"action_mask": self.action_masks().astype(np.int8)} if self._can_be_masked else {}),
            **self._promised(),
            **({"error_estimate": self.simulator.error_estimate} if self._error_bars else {}),
            **{name: values.copy() for name, values in self.drawn.items()},
        }

    def _heading_facts(self) -> dict[str, Floats]:
        """Heading, and the turn from it to the asked one [rad], where headings are asked for."""
        if self._asked is None:
            return {}
        heading = self.heading()
        return {"heading": heading, "heading_error": self._asked.turn(self.waypoint_index, heading)}

    def _promise_of(self, scene: Scene) -> dict[str, float]:
        return promised(scene, self.certificate, None if self._in_strokes else self.decision_period)

    def _promised(self) -> dict[str, Floats]:
        """Measured errors and speed, shape (n_robots,) each; NaN for robots with weak limbs."""
        simulator = self.simulator
        if simulator.scene is not self._promise[0]:
            self._promise = simulator.scene, self._promise_of(simulator.scene)
        strong = (simulator.limb_strengths == 1.0).all(axis=1)
        return {name: np.where(strong, value, np.nan) for name, value in self._promise[1].items()}


def _messages(status: NDArray[np.int64]) -> NDArray[Any]:
    """Sentences on what to do about each status, shape (n_robots,); empty where the solver converged."""
    messages = np.full(len(status), "", dtype=object)
    for robot in np.flatnonzero(status != SolverStatus.CONVERGED):
        messages[robot] = SolverStatus(status[robot]).sentence
    return messages


def _length(vectors: Floats) -> Floats:
    """Euclidean length over the last axis, of size 2."""
    return np.hypot(vectors[..., 0], vectors[..., 1])
