"""Planner: a controller that tries sequences of commands on a batch of the simulator before every decision.

It has the observations of any agent. An observation is the whole state of the robot and its wires, to single precision,
so a beam search can begin from it: at each of a few decisions, all pairs of limbs are tried from the best few states so
far. The planner then swims the first command of the sequence that leaves the shortest rewarded route. `gait_planner`
tries whole periods of evolved gaits instead, and decides once a second. A robot of more
than ten nodes per limb is taken to lie smoothly through the stations that are observed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.controllers.contract import can_be_decided_by, observed, starts
from seastar_gym.controllers.greedy import Searcher, require_search, waypoints_of
from seastar_gym.envs.commands import checked_decision_period, command_table
from seastar_gym.envs.layout import HEADINGS, N_STATIONS, VELOCITY_SCALE, Layout, memory_size
from seastar_gym.envs.options import HeadingTargets, RewardWeights, make_scene, wrapped
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.stations import body_heading, node_weights, of_beginning
from seastar_gym.gaits import evolved_gaits
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import complete
from seastar_gym.scene.checks import as_finite, require_count, require_kind, require_number, require_period
from seastar_gym.simulator import Simulator, State
from seastar_gym.simulator.simulator import MAX_THREADS

Floats = NDArray[np.float64]
Look = Callable[[Floats], None]


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
SHARE = 0.2
"""Share of the time between decisions in which the planner is to answer, on two processors."""
TIMED_BUDGETS = {0.5: Budget(3, 8, 0.5), 0.2: Budget(3, 4, 0.8), 0.1: Budget(2, 3, 0.9)}
"""Budgets that keep SHARE, by time between decisions [s]."""


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

    def __call__(self, states: State, look: Look | None = None) -> State:
        """States after one move, shape (states * moves, ...), those of the same state side by side.

        look: Called with the positions of nodes [m], shape (states * moves, n_nodes, 2), after every decision.
        """
        n_states, n_moves = len(states.time), len(self.moves)
        simulator = self._simulator(n_states * n_moves)
        simulator.set_state(states.of_robots(np.repeat(np.arange(n_states), n_moves)))
        for commands in np.moveaxis(np.tile(self.moves, (n_states, 1, 1)), 1, 0):
            simulator.advance(self._duration, commands)
            if look is not None:
                look(simulator.positions)
        return simulator.get_state()._replace(commands=None, phase=None)  # the next commands take their place


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


class Outcome:
    """What is found of candidates, arrays of shape (n, candidates), while they swim a move.

    way: To go now [m]. passed: Whether the current waypoint is passed. since: Decisions since the arrival at the last
    waypoint, that of the arrival included; 0 before it.
    """

    def __init__(self, passed: NDArray[np.bool_]):
        self.way, self.passed, self.since = np.zeros(passed.shape), passed, np.zeros(passed.shape, np.int64)

    def add(self, way: Floats, passed: NDArray[np.bool_], there: NDArray[np.bool_]) -> None:
        """Take in what is judged after a decision."""
        self.way, self.passed = way, passed
        self.since += there


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
        self._swim_all = Branching(self.scene, self.moves, threads, decision_period)

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
            found = Outcome(np.repeat(passed, n_moves, axis=1))
            states = self._swim_all(states, partial(self._look, found, targets))
            way, passed, there = found.way, found.passed, found.since > 0
            if self.budget.coasting > 0.0:
                way, *_ = self._judge(self._swim_all.coasted(states, self.budget.coasting), passed, targets)
            way = way - SOONER * found.since
            first = np.tile(np.arange(n_moves), (n, 1)) if move == 0 else np.repeat(first, n_moves, 1)
            best = np.argsort(way, axis=1)[:, : self.budget.beam]
            # Who arrives within this move cannot arrive sooner by a longer sequence.
            chosen = np.where(arrived, chosen, first[robots[:, 0], best[:, 0]])
            arrived |= there.any(axis=1)
            first, passed = first[robots, best], passed[robots, best]
            rows = (robots * width * n_moves + best).reshape(-1)
            states, width = states.of_robots(rows), best.shape[1]
        return chosen

    def _look(self, found: Outcome, targets: Targets, positions: Floats) -> None:
        """Judge candidates after a decision."""
        found.add(*self._judge(positions, found.passed, targets))

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
