"""Agents that search: the greedy agent by a map of what commands do, the planner by simulating what they would do.

    seastar evaluate --agents greedy planner pentagon

The greedy agent's map has the displacement of the hub in the body frame and the turn of the robot, per stroke of every
command, once the repeated command swims steadily. It is computed once for every scene and kept in the user's cache
folder. In a timed environment, commands are repeated at every decision, which heats the same wires over and over: the
map knows no lag.

The planner tries sequences of commands on a batch of the simulator before every decision. It has the observations of
any agent. An observation is the whole state of the robot and its wires, to single precision, so a beam search can begin
from it: at each of a few decisions, all pairs of limbs are tried from the best few states so far. The planner then
swims the first command of the sequence that leaves the shortest rewarded route. `gait_planner` tries whole periods of
evolved gaits instead, and decides once a second. A robot of more than ten nodes per limb is taken to lie smoothly
through the stations that are observed.
"""

from __future__ import annotations

import hashlib
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.controllers.contract import can_be_decided_by, observed, starts
from seastar_gym.envs.commands import Actions, checked_decision_period, command_table, decisions_in
from seastar_gym.envs.headings import HeadingTargets, wrapped
from seastar_gym.envs.layout import HEADINGS, N_STATIONS, OBSERVATION_LAYOUT, VELOCITY_SCALE, Layout, memory_size
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.rewards import RewardWeights
from seastar_gym.envs.stations import body_heading, heading_of, node_weights, of_beginning
from seastar_gym.files import beside
from seastar_gym.gaits import evolved_gaits
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import complete
from seastar_gym.scene.checks import as_finite, require_count, require_kind, require_number, require_period
from seastar_gym.simulator import Simulator, State
from seastar_gym.simulator.simulator import MAX_THREADS

Floats = NDArray[np.float64]

SETTLING_STROKES, MEASURED_STROKES = 6, 4
"""A repeated command swims steadily, to 1 %, after about six strokes."""


class Displacements(NamedTuple):
    """Mean displacements of the hub [m] in the body frame, shape (n, 2), and turns [rad], shape (n,), of n gaits."""

    hub: Floats
    turn: Floats


def turned(vectors: Floats, angles: Floats) -> Floats:
    """Vectors, shape (n, 2), turned by angles [rad], shape (n,)."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1)


def measure_gaits(
    scene: Scene, commands: Floats, settling: int, measured: int, decision_period: float | None = None
) -> Displacements:
    """Mean displacement and turn per stroke of periodic gaits, in the body frame when the measured strokes begin.

    commands: Commands of every gait, shape (n, period, n_limbs). settling, measured: Numbers of strokes before and
    during the measurement; `measured` is a multiple of the period. decision_period: Time between commands [s], called a
    stroke here. None means a stroke of the actuator.
    """
    simulator, duration = Simulator(scene, len(commands)), checked_decision_period(decision_period, scene)
    for stroke in range(settling + measured):
        if stroke == settling:
            hub, heading = simulator.hub_position(), heading_of(simulator)
        simulator.advance(duration, commands[:, stroke % commands.shape[1]])
    turn = heading_of(simulator) - heading
    turn -= 2.0 * np.pi * np.rint(turn / (2.0 * np.pi))
    return Displacements(turned(simulator.hub_position() - hub, -heading) / measured, turn / measured)


def displacement_map(scene: Scene, actions: Actions = "joint", decision_period: float | None = None) -> Displacements:
    """Map of a scene for the commands of an action mode, from the cache or measured now."""
    asked: tuple[Any, ...] = scene, actions, SETTLING_STROKES, MEASURED_STROKES, OBSERVATION_LAYOUT
    if decision_period is not None:
        asked = *asked, decision_period
    settling, measured_strokes = (
        decisions_in(n * scene.actuator.period, decision_period, scene) for n in (SETTLING_STROKES, MEASURED_STROKES)
    )
    key = hashlib.sha256(repr(asked).encode()).hexdigest()[:24]
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "seastar-gym"
    file = cache / f"displacements-{key}.npz"
    with suppress(OSError, ValueError, KeyError, EOFError, BadZipFile), np.load(file, allow_pickle=False) as known:
        return Displacements(known["hub"], known["turn"])
    commands = command_table(actions, scene.robot.n_limbs)[:, None]
    measured = measure_gaits(scene, commands, settling, measured_strokes, decision_period)
    with beside(file) as part, part.open("wb") as stream:
        np.savez(stream, hub=measured.hub, turn=measured.turn)
    return measured


def waypoints_of(
    observations: NDArray[np.float32], scene: Scene, layout: Layout | None = None
) -> tuple[Floats, Floats]:
    """Current and next waypoint [m] relative to the hub in the body frame, (n, 2) each.

    layout: Of the observations. None means that of waypoints without headings.
    """
    at, length = Layout.of(scene) if layout is None else layout, scene.robot.limb_length
    observations = np.atleast_2d(observed(observations, at.size))
    current, after = observations[:, at.current_waypoint], observations[:, at.next_waypoint]
    return length * current.astype(np.float64), length * after.astype(np.float64)


def require_search(scene: Scene, waypoint_radius: float, reward: object, decision_period: float | None) -> None:
    """ValueError for what no policy can search with."""
    require_kind("scene", scene, Scene, "a Scene")
    if scene.n_robots is not None:
        raise ValueError("scene must be that of one robot.")
    require_number("waypoint_radius", waypoint_radius, "m")
    require_kind("reward", reward, RewardWeights, "RewardWeights")
    checked_decision_period(decision_period, scene)


class Searcher(ABC):
    """Base of policies that choose actions by observations alone, for one robot or for many."""

    batched = True
    actions: Actions
    decision_period: float | None = None
    """Time between decisions [s]. None means a stroke."""
    scene: Scene
    """Scene that the policy knows."""

    @property
    def n_limbs(self) -> int:
        """Number of limbs of the robot that it drives."""
        return self.scene.robot.n_limbs

    @abstractmethod
    def choose(self, observations: NDArray[np.float32]) -> NDArray[np.int64]:
        """Actions, shape (n,), for observations of shape (n, size)."""

    def predict(
        self,
        observation: NDArray[np.float32],
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[np.int64], None]:
        """Actions for observations of shape (size,) or (n, size), and None: there is no state.

        A robot whose observation has a number that is NaN, infinite or beyond 1e30 rests, by action 0.
        """
        observations = np.atleast_2d(observed(observation, 1))
        known = can_be_decided_by(observations)
        chosen = np.zeros(len(observations), np.int64)
        if known.any():
            chosen[known] = self.choose(observations[known])
        return (chosen[0] if np.ndim(observation) == 1 else chosen), None


class GreedyPolicy(Searcher):
    """Agent that chooses the command whose mean displacement leaves the shortest rewarded route.

    scene: Scene in which displacements are measured; that of the environment, for a fair comparison.
    waypoint_radius: Radius of the waypoints [m]. reward: Reward whose route is shortened. decision_period: Of the
    environment [s]. None means a stroke.
    """

    actions = "joint"

    def __init__(
        self,
        scene: Scene,
        waypoint_radius: float = WAYPOINT_RADIUS,
        reward: RewardWeights = RewardWeights(),
        decision_period: float | None = None,
    ):
        require_search(scene, waypoint_radius, reward, decision_period)
        self.scene, self.waypoint_radius, self.reward = scene, waypoint_radius, reward
        self.decision_period = decision_period
        self._hub = displacement_map(scene, self.actions, decision_period).hub

    def choose(self, observations: NDArray[np.float32]) -> NDArray[np.int64]:
        """Actions, shape (n,), for observations of shape (n, size)."""
        current, following = (waypoint[:, None] for waypoint in waypoints_of(observations, self.scene))
        return np.argmin(self.reward.way_to_next(self._hub, current, following, self.waypoint_radius), axis=1)


DEEPEST, WIDEST = 1000, 100_000
"""Most decisions that are looked ahead, and most states that are kept."""


@dataclass(frozen=True)
class Budget:
    """Limits of the search: it simulates 21 + 21 beam (depth - 1) decisions or fewer for one of a five-limb robot."""

    depth: int = 3
    """Decisions looked ahead. Of strokes, one costs a stroke or so round the pentagon; more than three gain nothing."""
    beam: int = 8
    """States kept from one decision to the next."""
    coasting: float = 0.0
    """Time for which robots swim on without commands before they are compared [s]. Where decisions are shorter than the
    wires' cooling, a comparison without it sees power strokes, but not what the limbs cost on their way back."""

    def __post_init__(self) -> None:
        require_count("depth", self.depth, 1, DEEPEST)
        require_count("beam", self.beam, 1, WIDEST)
        require_number("coasting", self.coasting, "s", zero_allowed=True)


OF_GAITS = Budget(4, 8)
"""Budget of `gait_planner`: 250 seconds of one robot or fewer for every second."""
TIMED_BUDGETS = {0.5: Budget(3, 8, 0.5), 0.2: Budget(3, 4, 0.8), 0.1: Budget(2, 3, 0.9)}
"""Budgets by time between decisions [s], a fifth of which the planner takes to answer on two processors."""


def budget_for(decision_period: float | None) -> Budget:
    """Budget for a time between decisions [s]. None means strokes."""
    require_period(decision_period)
    shorter = [seconds for seconds in TIMED_BUDGETS if decision_period is not None and seconds >= decision_period]
    return TIMED_BUDGETS[min(shorter)] if shorter else Budget()


def state_of(observations: NDArray[np.float32], scene: Scene, layout: Layout | None = None) -> State:
    """State that observations, shape (n, size), were made from, in the body frame with the hub at its origin.

    layout: Of the observations. None means that of waypoints without headings.
    Actuators have the state that they recall from what is observed, and are at rest if they recall none. Bodies point
    along the frame and do not turn.
    """
    n, robot, actuator, at = len(observations), scene.robot, scene.actuator, layout or Layout.of(scene)
    of_limbs = observations[:, at.actuators].astype(np.float64).reshape(n, robot.n_limbs, -1)
    seen = of_limbs[..., : memory_size(actuator)]
    at_stations = node_weights(robot.nodes_per_limb)
    nodes, velocities = (
        at_stations @ observations[:, place].astype(np.float64).reshape(n, -1, N_STATIONS, 2)
        for place in (at.positions, at.velocities)
    )
    if robot.has_body:
        roots = np.array([limb.root for limb in robot.limb_shapes()]) / robot.limb_length
        nodes = nodes + of_beginning(at_stations)[:, None] * roots[:, None]
    nodes, velocities = nodes.reshape(n, -1, 2), velocities.reshape(n, -1, 2)
    hub_velocity = observations[:, None, at.hub_velocity].astype(np.float64)
    zero = np.zeros((n, 1, 2))
    return State(
        positions=robot.limb_length * np.concatenate([zero, nodes], axis=1),
        velocities=VELOCITY_SCALE * (hub_velocity + np.concatenate([zero, velocities], axis=1)),
        time=np.zeros(n),
        actuators=complete(actuator).recall(seen),
    )


class Branching:
    """Simulation of every move from every state, the step of a tree search.

    moves: Commands of decisions that follow each other, shape (n_moves, n_decisions, n_limbs).
    decision_period: Time between commands [s]. None means a stroke.
    """

    def __init__(self, scene: Scene, moves: Floats, threads: int | None = None, decision_period: float | None = None):
        self.scene, self.moves, self.threads = scene, moves, threads
        self._duration = checked_decision_period(decision_period, scene)
        self._simulators: dict[int, Simulator] = {}

    def coasted(self, states: State, seconds: float) -> Floats:
        """Positions of nodes [m] once the states have swum on without commands, shape (states, n_nodes, 2)."""
        simulator = self._simulator(len(states.time))
        simulator.set_state(states)
        simulator.advance(seconds)
        return simulator.positions

    def _simulator(self, n: int) -> Simulator:
        """Simulator of n robots."""
        if n not in self._simulators:
            self._simulators[n] = Simulator(self.scene, n, self.threads)
        return self._simulators[n]

    def decisions(self, states: State) -> Iterator[State]:
        """States after every decision of a move, shape (states * moves, ...), those of the same state side by side."""
        n_states, n_moves = len(states.time), len(self.moves)
        simulator = self._simulator(n_states * n_moves)
        simulator.set_state(states.of_robots(np.repeat(np.arange(n_states), n_moves)))
        for commands in np.moveaxis(np.tile(self.moves, (n_states, 1, 1)), 1, 0):
            simulator.advance(self._duration, commands)
            yield simulator.get_state()._replace(commands=None, phase=None)  # the next commands take their place


class Targets(NamedTuple):
    """Where robots are to go: current and next waypoint [m], shape (n, 2), and the turns to their headings [rad], (n,).

    All are seen from the robot as it is now. Turns are None where no headings are asked for.
    """

    current: Floats
    after: Floats
    turn: Floats | None = None
    turn_after: Floats | None = None


SOONER = 1e3
"""Way that a decision since the arrival counts as [m], so that who arrives first is best."""


def _checked_moves(moves: ArrayLike | None, n_limbs: int) -> Floats:
    """Moves, shape (n_moves, n_decisions, n_limbs), by default every pair of limbs; ValueError for what is none."""
    if moves is None:
        return command_table("pairs", n_limbs)[:, None]
    checked = as_finite("moves", moves, (None, None, n_limbs))
    if checked.ndim != 3 or checked.size == 0:
        raise ValueError(f"moves must have shape (n_moves, n_decisions, {n_limbs}), not {checked.shape}.")
    if np.abs(checked).max() > 1.0:
        raise ValueError("moves must be shares of a pulse from -1 to 1.")
    return checked


class Planner(Searcher):
    """Agent that runs a beam search over pairs of limbs, or over moves, before every decision or move.

    scene: Scene of the search, by default the chapter's at fidelity "fast", with wires if decisions are not strokes.
    waypoint_radius: Radius of the waypoints [m]. budget: Limits of the search, by default those of the decision period.
    threads: Number of threads of the simulator, by default one for every processor. reward: Reward whose route is
    shortened. decision_period: Of the environment [s]. None means a stroke. headings: Those of the environment; what is
    left to turn is then added to the route, at the price that it has in the reward. moves: Commands of decisions that
    follow each other, shares of a pulse of shape (n_moves, n_decisions, n_limbs), such as whole periods of gaits. The
    planner then decides after every move, and sees no pulse that is under way: pulses should end with their decision.
    """

    def __init__(
        self,
        scene: Scene | None = None,
        waypoint_radius: float = WAYPOINT_RADIUS,
        budget: Budget | None = None,
        threads: int | None = None,
        reward: RewardWeights = RewardWeights(),
        decision_period: float | None = None,
        headings: HeadingTargets | None = None,
        moves: ArrayLike | None = None,
    ):
        require_kind("headings", headings, HeadingTargets | None, "HeadingTargets, or None")
        require_kind("budget", budget, Budget | None, "a Budget, or None")
        self.headings = headings
        self.scene = make_scene(None, "fast", decision_period) if scene is None else scene
        require_search(self.scene, waypoint_radius, reward, decision_period)
        if threads is not None:
            require_count("threads", threads, 1, MAX_THREADS)
        self.waypoint_radius, self.reward, self.decision_period = waypoint_radius, reward, decision_period
        self.budget = budget_for(decision_period) if budget is None else budget
        self.actions = "pairs" if moves is None else "continuous"
        self.moves = _checked_moves(moves, self.scene.robot.n_limbs)
        self._layout = Layout.of(self.scene, entries=() if headings is None else HEADINGS)
        self._branches = Branching(self.scene, self.moves, threads, decision_period)

    def choose(self, observations: NDArray[np.float32]) -> NDArray[np.int64]:
        """Best moves, shape (n,), for observations of shape (n, size)."""
        observations = np.atleast_2d(observed(observations, self._layout.size))
        return self._search(state_of(observations, self.scene, self._layout), self._targets(observations))

    def predict(
        self,
        observation: NDArray[np.float32],
        state: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[Any], Any]:
        """Actions for observations of shape (size,) or (n, size), and the state for the next call.

        state: Moves under way and how many of their decisions are made, shapes (n,); None before the first decision.
        The state stays None where moves are one decision long. episode_start: Whether an episode begins, shape (n,).
        A robot whose observation has a number that is NaN, infinite or beyond 1e30 rests, and its move waits.
        """
        observations, length = np.atleast_2d(observed(observation, self._layout.size)), self.moves.shape[1]
        n, known = len(observations), can_be_decided_by(observations)
        under_way, made = (np.zeros(n, np.int64), np.zeros(n, np.int64)) if state is None or length == 1 else state
        made = np.where(starts(episode_start, n), 0, made)
        chosen, due = under_way.copy(), known & (made == 0)
        if due.any():
            chosen[due] = self.choose(observations[due])
        actions = chosen
        if self.actions != "pairs":
            actions = np.where(known[:, None], self.moves[chosen, made], 0.0).astype(np.float32)
        state = None if length == 1 else (chosen, np.where(known, (made + 1) % length, made))
        return (actions[0] if np.ndim(observation) == 1 else actions), state

    def _targets(self, observations: NDArray[np.float32]) -> Targets:
        """Targets that observations, shape (n, size), tell of."""
        waypoints = waypoints_of(observations, self.scene, self._layout)
        if self.headings is None:
            return Targets(*waypoints)
        seen = observations[:, self._layout.headings].astype(np.float64)
        turns = np.arctan2(seen[:, 1::2], seen[:, ::2])
        return Targets(*waypoints, turns[:, 0], turns[:, 1])

    def _search(self, start: State, targets: Targets) -> NDArray[np.int64]:
        """First move of the best sequence for every robot, shape (n,)."""
        n, n_moves = len(targets.current), len(self.moves)
        robots = np.arange(n)[:, None]
        states, width = start, 1
        passed = np.zeros((n, 1), bool)
        first = np.zeros((n, 1), np.int64)
        chosen, arrived = np.zeros(n, np.int64), np.zeros(n, bool)
        for move in range(self.budget.depth):
            passed = np.repeat(passed, n_moves, axis=1)
            since = np.zeros(passed.shape, np.int64)  # decisions since the arrival at the last waypoint, itself counted
            for states in self._branches.decisions(states):  # noqa: B020
                way, passed, there = self._judge(states.positions, passed, targets)
                since += there
            if self.budget.coasting > 0.0:
                way, *_ = self._judge(self._branches.coasted(states, self.budget.coasting), passed, targets)
            way = way - SOONER * since
            first = np.tile(np.arange(n_moves), (n, 1)) if move == 0 else np.repeat(first, n_moves, 1)
            best = np.argsort(way, axis=1)[:, : self.budget.beam]
            # Who arrives within this move cannot arrive sooner by a longer sequence.
            chosen = np.where(arrived, chosen, first[robots[:, 0], best[:, 0]])
            arrived |= (since > 0).any(axis=1)
            first, passed = first[robots, best], passed[robots, best]
            rows = (robots * width * n_moves + best).reshape(-1)
            states, width = states.of_robots(rows), best.shape[1]
        return chosen

    def _judge(
        self, positions: Floats, passed: NDArray[np.bool_], targets: Targets
    ) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
        """Way to go [m], whether the current waypoint is passed, and whether it was the last; shape (n, candidates).

        positions: Positions of nodes [m], shape (n candidates, n_nodes, 2). passed: Shape (n, candidates).
        """
        current, after = targets.current[:, None], targets.after[:, None]
        hub = positions[:, 0].reshape(*passed.shape, 2)
        near = np.hypot(*np.moveaxis(hub - current, -1, 0)) <= self.waypoint_radius
        way = self.reward.way_to_next(hub, current, after, self.waypoint_radius)
        beyond = np.hypot(*np.moveaxis(hub - after, -1, 0))
        if self.headings is not None and targets.turn is not None and targets.turn_after is not None:
            turned = body_heading(positions, self.scene.robot).reshape(passed.shape)
            left, left_after = (np.abs(wrapped(turn[:, None] - turned)) for turn in (targets.turn, targets.turn_after))
            between = np.abs(wrapped(targets.turn_after - targets.turn))[:, None]
            price = self.reward.heading / self.reward.progress
            near &= left <= self.headings.tolerance
            way, beyond = way + price * (left + between), beyond + price * left_after
        passed = passed | near
        last = (current == after).all(axis=-1)
        return np.where(passed & ~last, beyond, way), passed, passed & last


def gait_planner(decision_period: float | None, budget: Budget = OF_GAITS, threads: int | None = None) -> Planner:
    """Planner of the chapter's robot with wires that tries one period of every evolved gait, and decides once a second.

    decision_period: Of the environment [s], 0.05 s. ValueError for another one.
    """
    moves = evolved_gaits(decision_period)
    return Planner(budget=budget, threads=threads, decision_period=decision_period, moves=moves)
