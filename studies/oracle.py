"""Oracles of the benchmark: the best controllers that were found, which is no proof that nothing is better.

`Oracle` is told what is hidden, and simulates the very robots ahead before every decision. `Sighted` is for robots that
are seen by a camera, late: a policy that learned with full sight of such robots, and has it. `Planner` and `Adaptive`
are rules, which are told the true state and nothing else that is hidden.
"""

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO

from agents.ppo import policy_of
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers.learned import LearnedPolicy, load, save
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.observation import axes_of
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.randomization import drawn_scene
from seastar_gym.envs.rewards import RewardWeights
from seastar_gym.envs.robots import Robots
from seastar_gym.envs.symmetry import VectorSymmetryReduction
from seastar_gym.envs.tasks.hidden import MOST_DEAD, FailBlind, Miswired, SimToReal
from seastar_gym.envs.tasks.prey import Courses, Prey, Pursuit
from seastar_gym.envs.tasks.prizes import Prizes, best_round, distances
from seastar_gym.envs.tasks.station import Station
from seastar_gym.evaluation import benchmark
from seastar_gym.simulator import Simulator, State
from studies.frame import Floats

Cost = Callable[[Floats, float], Floats]
"""Cost of hubs in the world [m], shape (n, m, 2), so many seconds from now, shape (n, m)."""

AHEAD = np.arange(0.0, 201.0)
"""Times at which a prey is foreseen [s]."""
NEVER = 1e3
"""Time that a prey counts that is not met [s]."""
OF_CURRENT = 20
"""Decisions over which what robots have drifted is averaged at most."""
LARGEST_TURN = 0.2
"""Turn per second of a prey [rad/s]; of more, it is another prey."""
SIGHTED = Path("runs/oracle")
"""Folder of policies with full sight."""
DECISIONS = 800_000
"""Length of their trainings, by PPO as shipped with symmetry reduction."""


class Search(NamedTuple):
    """What a search tries.

    commands: Of every robot, shape (n, k, n_limbs). depth: Decisions ahead. beam: States that are kept from one to the
    next. coasting: Time for which robots swim on before they are compared [s].
    """

    commands: Floats
    depth: int = 1
    beam: int = 4
    coasting: float = 0.0


class Oracle:
    """Policy of the robots of a batch, to whose simulator and episodes it looks."""

    batched = True

    def __init__(self, batch: Any):
        inner = batch.unwrapped
        self.robots: Robots = inner._robots
        self._numbers = {command.tobytes(): number for number, command in enumerate(inner.command_table + 0.0)}
        self._simulator = cache(self._made)

    def predict(self, observation: Any, *_: Any, **__: Any) -> Any:
        """Actions of all robots, and None."""
        best = self._best(self.robots.simulator.get_state(), self.cost(), self.search)
        chosen = self.wired(self.search.commands[np.arange(self.robots.n_robots), best])
        return np.array([self._numbers[command.tobytes()] for command in chosen + 0.0]), None

    @cached_property
    def search(self) -> Search:
        """What is tried before every decision, in the episodes that had begun at the first."""
        return search_of(self.robots)

    def cost(self) -> Cost:
        """By which ends of decisions are compared."""
        return cost_of(self.robots)

    def wired(self, commands: Floats) -> Floats:
        """Commands whose limbs bend as these say, shape (n, n_limbs)."""
        return commands if self.robots.wiring is None else commands * self.robots.wiring

    def _best(self, states: State, cost: Cost, search: Search) -> NDArray[np.intp]:
        """Number of the first command of the sequence whose costs after all its decisions have the least sum."""
        n, k = search.commands.shape[:2]
        each = np.arange(n)[:, None]
        states, period = states._replace(commands=None, phase=None), self.robots.decision_period
        first, total = np.tile(np.arange(k), (n, 1)), np.zeros((n, k))
        for decision in range(1, search.depth + 1):
            width = total.shape[1]
            simulator = self._simulator(width)
            simulator.set_state(states.of_robots(np.repeat(np.arange(len(states.time)), k)))
            simulator.advance(period, np.repeat(search.commands, width // k, axis=0).reshape(n * width, -1))
            ends = simulator.get_state()._replace(commands=None, phase=None)
            if search.coasting > 0.0:
                simulator.advance(search.coasting)
            hubs = simulator.hub_position().reshape(n, width, 2)
            total = total + cost(hubs, decision * period + search.coasting)
            if decision < search.depth:
                kept = np.argsort(total, axis=1)[:, : search.beam]
                states = ends.of_robots((each * width + kept).reshape(-1))
                first, total = np.repeat(first[each, kept], k, axis=1), np.repeat(total[each, kept], k, axis=1)
        return np.asarray(first[each[:, 0], np.argmin(total, axis=1)])

    def _made(self, copies: int) -> Simulator:
        """Simulator of so many copies of every robot."""
        robots = self.robots
        drawn = {name: np.repeat(values, copies, axis=0) for name, values in robots.drawn.items()}
        made = Simulator(drawn_scene(robots._drawn_from, drawn), copies * robots.n_robots, 1)
        made.set_limb_strengths(np.repeat(robots.simulator.limb_strengths, copies, axis=0))
        return made


class Planner(Oracle):
    """Model predictive control, one decision ahead, by the true state of the robots and as if nothing were hidden.

    Robots are as designed, in still water and wired as they should be, and a prey swims straight on.
    """

    @cached_property
    def search(self) -> Search:
        if isinstance(self.robots.task, FailBlind):
            pairs = command_table("pairs", self.robots.scene.robot.n_limbs)
            return Search(np.tile(pairs, (self.robots.n_robots, 1, 1)), coasting=0.5)
        return search_of(self.robots)._replace(depth=1)

    def cost(self) -> Cost:
        robots, task = self.robots, self.robots.task
        if isinstance(task, Prey):
            place, velocity = (each[:, None, None] for each in task.prey(robots))
            return _chase(task, lambda since: place + (since + AHEAD)[:, None] * velocity)
        return cost_of(robots)

    def wired(self, commands: Floats) -> Floats:
        return commands

    def _made(self, copies: int) -> Simulator:
        return Simulator(self.robots.scene, copies * self.robots.n_robots, 1)


class Adaptive(Planner):
    """Planner that believes in what explains the past best: the wiring, the dead limbs, a current, how a prey turns.

    It simulates every decision again under all beliefs, and compares displacements and turns with those that it saw.
    Where nothing of that is hidden it is the planner.

    flow: Velocity of the water that it believes in [m/s], shape (n_robots, 2).
    """

    def __init__(self, batch: Any):
        super().__init__(batch)
        n, n_limbs = self.robots.n_robots, self.robots.scene.robot.n_limbs
        others: dict[type, tuple[float, ...]] = {Miswired: (-1.0,), FailBlind: (0.0,)}
        factors = 1.0, *others.get(type(self.robots.task), ())
        beliefs = np.array(list(itertools.product(factors, repeat=n_limbs)))
        self._beliefs = beliefs[np.count_nonzero(beliefs == 0.0, axis=1) <= MOST_DEAD]  # factors of commands
        self._errors, self.flow, self._rate = np.zeros((n, len(self._beliefs))), np.zeros((n, 2)), np.zeros(n)
        self._before: tuple[State, Floats, Any] | None = None  # state, commands and velocity of the prey
        self._decisions = 0

    @property
    def believed(self) -> Floats:
        """Factors of commands that it believes in, shape (n_robots, n_limbs): -1 if wired crosswise, 0 if dead."""
        return np.asarray(self._beliefs[np.argmin(self._errors, axis=1)])

    @cached_property
    def search(self) -> Search:
        if not isinstance(self.robots.task, FailBlind):
            return super().search
        every = command_table("joint", self.robots.scene.robot.n_limbs)
        few = every[np.count_nonzero(every, axis=1) <= every.shape[1] - MOST_DEAD]
        return Search(np.tile(few, (self.robots.n_robots, 1, 1)))

    def predict(self, observation: Any, *_: Any, **__: Any) -> Any:
        task, robots = self.robots.task, self.robots
        velocity = task.prey(robots)[1] @ [1.0, 1j] if isinstance(task, Prey) else np.zeros(robots.n_robots, complex)
        if self._before is not None:
            self._learn(*self._before, velocity)
        states, cost, flow = self._in_water(robots.simulator.get_state()), self.cost(), self.flow[:, None]
        search = self.search._replace(commands=self.search.commands * self.believed[:, None])
        best = self._best(states, lambda hubs, since: cost(hubs + since * flow, since), search)
        chosen = self.search.commands[np.arange(robots.n_robots), best]
        self._before = states, chosen, velocity
        return np.array([self._numbers[command.tobytes()] for command in chosen + 0.0]), None

    def _in_water(self, states: State) -> State:
        """States in the frame of the water that flows as it believes, none under way."""
        velocities = states.velocities - self.flow[:, None]
        return states._replace(velocities=velocities, commands=None, phase=None)

    def _learn(self, states: State, commands: Floats, before: Any, velocity: Any) -> None:
        """Learn from a decision. states, commands: With which it began. before, velocity: Of the prey [m/s], x + iy."""
        robots, period, k = self.robots, self.robots.decision_period, len(self._beliefs)
        simulator = self._simulator(k)
        simulator.set_state(states.of_robots(np.repeat(np.arange(robots.n_robots), k)))
        simulator.advance(period, (commands[:, None] * self._beliefs).reshape(len(commands) * k, -1))
        hubs = simulator.hub_position().reshape(-1, k, 2) + period * self.flow[:, None]
        missed = robots.simulator.hub_position()[:, None] - hubs
        c, s = axes_of(simulator).reshape(2, -1, k)
        turned = np.angle(np.exp(1j * robots.heading()[:, None]) / (c + 1j * s))
        self._errors += (missed**2).sum(axis=-1) / robots.scene.robot.limb_length**2 + turned**2
        if isinstance(robots.task, Station):
            self._decisions += 1
            self.flow += missed[:, 0] / period / min(self._decisions, OF_CURRENT)
        turn = np.angle(velocity * before.conj()) / period
        self._rate = np.where(np.abs(turn) < LARGEST_TURN, turn, 0.0)

    def cost(self) -> Cost:
        robots, task = self.robots, self.robots.task
        if not isinstance(task, Prey):
            return super().cost()
        place, velocity = (each @ [1.0, 1j] for each in task.prey(robots))
        rate = np.where(self._rate == 0.0, 1e-9, self._rate)

        def foreseen(since: float) -> Floats:
            """The prey goes on turning as it has turned since the last decision."""
            turns = 1j * rate[:, None] * (since + AHEAD)
            places = place[:, None] + velocity[:, None] * np.expm1(turns) / (1j * rate[:, None])
            return np.stack([places.real, places.imag], axis=-1)[:, None]

        return _chase(task, foreseen)


class Sighted:
    """Policy of the robots of a batch that are seen by a camera, which sees their true state."""

    batched = True

    def __init__(self, batch: Any):
        self._batch = batch.unwrapped
        self._policy = learned_with_sight()

    def predict(self, observation: Any, *_: Any, **__: Any) -> Any:
        """Actions of all robots, and None."""
        return self._policy.predict(self._batch.privileged_observations(), deterministic=True)[0], None


def learned_with_sight(id: str = "SeastarSwimSimToReal-v0") -> LearnedPolicy:
    """Policy of seed 0 that learned the task of an id without its camera; trained where its contract has no file."""
    file = SIGHTED / f"{id}-{benchmark.contract(id)}.safetensors"
    if not file.is_file():
        torch.set_num_threads(1)
        task: Any = benchmark.task_of(id)
        batch = benchmark.make(id, 128, threads=1, autoreset_mode="SameStep", task=replace(task, sight=None))
        env = BatchVecEnv(VectorSymmetryReduction(batch))
        model = PPO("MlpPolicy", env, n_steps=32, seed=0, device="cpu", policy_kwargs={"net_arch": [64, 64]})
        model.learn(DECISIONS)
        save(policy_of(model), file, strokes=DECISIONS, seed=0)
        env.close()
    return load(file)


def oracle_of(batch: Any) -> Oracle | Sighted:
    """Oracle of the task of a batch."""
    return Sighted(batch) if isinstance(batch.unwrapped.task, SimToReal) else Oracle(batch)


def search_of(robots: Robots) -> Search:
    """Search in the task of robots whose episodes have begun."""
    n, n_limbs, task = robots.n_robots, robots.scene.robot.n_limbs, robots.task
    pairs = np.tile(command_table("pairs", n_limbs), (n, 1, 1))
    if isinstance(task, FailBlind):
        live = [strengths > 0.0 for strengths in robots.simulator.limb_strengths]
        tried = [list(itertools.product(*((0.0, 1.0, -1.0)[: 1 + 2 * on] for on in limbs))) for limbs in live]
        return Search(np.array(tried), 2)
    if isinstance(task, Station):
        every = command_table("joint", n_limbs)
        return Search(np.tile(every[np.count_nonzero(every, axis=1) <= 2], (n, 1, 1)), 2)
    if robots.decision_period < 0.5:
        return Search(pairs, 2, 3, 0.8)
    return Search(pairs, 2, 6, 0.5) if isinstance(task, Prizes) else Search(pairs, 1, 1, 0.5)


def cost_of(robots: Robots) -> Cost:
    """Cost of the ends of decisions in the task of robots, by their present episodes."""
    task, now = robots.task, robots.episode
    if isinstance(task, Prey):
        courses, time = Courses(now.course[:, None, None]), robots.simulator.time[:, None, None]
        return _chase(task, lambda since: courses.place(time + since + AHEAD))
    if isinstance(task, Station):
        return lambda hubs, _: np.hypot(*np.moveaxis(hubs - now.station[:, None], -1, 0))
    if isinstance(task, Prizes):
        ends, radius = _next_prizes(robots, task), task.radius
    else:
        ends, radius = task.targets(robots), WAYPOINT_RADIUS
    first, second = ends[:, None, :2], ends[:, None, 2:]
    return lambda hubs, _: RewardWeights().way_to_next(hubs, first, second, radius)


def _chase(task: Prey, foreseen: Callable[[float], Floats]) -> Cost:
    """Time until the prey is met [s]; where it is not, the time that is lacking at least, on top of NEVER.

    foreseen: Places of the prey of all robots AHEAD of a time from now on [s], shape (n, 1, len(AHEAD), 2) [m].
    """
    pursuit = Pursuit(0.0075, 0.9 * task.catch_radius)

    def until_met(hubs: Floats, since: float) -> Floats:
        prey = foreseen(since)
        prey = np.broadcast_to(prey, (*hubs.shape[:2], *prey.shape[2:]))
        lacking = pursuit.gaps(hubs, prey, AHEAD).min(axis=-1) / pursuit.speed
        return np.minimum(pursuit.meeting_time(hubs, prey, AHEAD), NEVER + np.maximum(lacking, 0.0))

    return until_met


def _next_prizes(robots: Robots, task: Prizes) -> Floats:
    """First and second prizes of the best rounds through what is left [m], shape (n, 4)."""
    hubs, ends = robots.simulator.hub_position(), np.zeros((robots.n_robots, 4))
    ways = 0.0075 * np.maximum(0.0, task.seconds - robots.simulator.time)
    for robot, (hub, prizes) in enumerate(zip(hubs, robots.episode.prizes, strict=True)):
        left = prizes[prizes[:, 2] > 0.0]
        if len(left) == 0:
            continue
        to = np.hypot(*(left[:, :2] - hub).T)
        first, between = np.maximum(0.0, to - task.radius), np.maximum(0.0, distances(left[:, :2]) - task.radius)
        order = best_round(first, between, left[:, 2], float(ways[robot])).order or [int(np.argmin(to))]
        ends[robot] = left[(order * 2)[:2], :2].reshape(-1)
    return ends
