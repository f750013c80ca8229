"""Robots that swim by decisions, and the `Task` that says what they swim for.

`Robots` knows quantities: where they are, what they see, what a decision does. A `Task` knows goals: what is drawn for
an episode, where the targets of an observation are, and how a decision is scored.
"""

from __future__ import annotations

import functools
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from types import ModuleType, SimpleNamespace
from typing import Any, Literal, NamedTuple, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from seastar_gym.accuracy.chapters import errors_in_info, read_certificate
from seastar_gym.envs.commands import action_masks, can_be_masked, masked_limbs
from seastar_gym.envs.delays import Lag, Piece, Tracker
from seastar_gym.envs.instances import SIZES, Split, generator_of, keep, numbers_of
from seastar_gym.envs.layout import N_STATIONS, Entry, Layout
from seastar_gym.envs.layout import SIZES as SIZES_OF_ENTRIES
from seastar_gym.envs.observation import axes_of, lengths_of, observed_rows, rows_on_device, to_float32
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.randomization import ACTION_DELAY, LIMB_STRENGTHS, DomainRandomization, drawn_scene
from seastar_gym.envs.rewards import pulses_of
from seastar_gym.envs.scenery import NOTHING, Scenery
from seastar_gym.envs.sight import Lateness, Sees, Sight, bounds_of, entries_of, stations_seen
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import Mirror, complete
from seastar_gym.scene.checks import require_choice, shown
from seastar_gym.scene.number import check_numbers
from seastar_gym.simulator import Simulator, StrokeReport
from seastar_gym.simulator.report import report_of_pieces
from seastar_gym.simulator.simulator import completed, pausing
from seastar_gym.simulator.watches import is_watched

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROUNDING = 1e-9
"""Fraction of a time that is no time."""


class Outcome(NamedTuple):
    """Reward, end and info of a decision; arrays over robots."""

    reward: Floats
    terminated: Flags
    info: dict[str, NDArray[Any]]


class Score(NamedTuple):
    """What a task says of a decision; arrays over robots."""

    terms: dict[str, Floats]
    """Terms of the reward by their names in `info`."""
    success: Flags | Literal[False] = False
    over: Flags | Literal[False] = False
    """Whether the episode ends, by success or failure."""


class Draws(Protocol):
    """Numbers of a scene that are drawn for every episode, such as a `DomainRandomization`."""

    def first_values(self, scene: Scene, n_robots: int) -> dict[str, Floats]:
        """Values before the first draw, by the numbers' names in the scene."""

    def draw(self, values: dict[str, Floats], robot: int, rng: np.random.Generator) -> None:
        """Draw all numbers of a robot, in place."""


class Task(ABC):
    """What robots swim for: a frozen dataclass of numbers, whose docstring is the contract that users read.

    The annotations of its fields declare what its numbers may be. A task keeps nothing of an episode: that stands in
    `robots.episode`, an array for every name that `draw` returns, whose first axis are the robots. Methods may change
    those arrays, or put others in their places.

    Episodes are numbered, and what is drawn for one follows from its split and its number alone: a reset draws the
    number, or takes that of `options={"instance": number}`.
    """

    terms: tuple[str, ...]
    """Names of the reward's terms."""
    entries: tuple[Entry, ...] = ()
    """What the numbers of `observation` are."""
    observes_commands = False
    """Whether the last command of every limb is observed, after the memory of its actuator."""
    observes_actuators = True
    """Whether the memory of the actuators may be observed."""
    shows_limbs = True
    """Whether the stations of the limbs and the hub's velocity are observed."""
    random_heading = True
    """Whether robots are turned at random at the start of every episode."""
    waypoint_radius = 0.01
    """Radius of waypoints in pictures [m]."""
    randomization: Draws | None = None
    """Numbers of the scene that are drawn for every episode."""
    sight: Sight | None = None
    """Camera through which robots are seen, unless the environment is given another."""
    tells_errors = True
    """Whether `info` has entries of measured errors, which are of whole robots in still water."""
    goals_are_waypoints = False
    """Whether an episode is about reaching waypoints, in an observation that tells of them in their places only."""
    option = "instance"
    """Name of the option by which a reset asks for a certain episode."""
    spawn_key: tuple[int, ...] = ()
    """Of the seeds of numbered episodes, see `numpy.random.SeedSequence`: no seed of a reset gives those with a key."""
    per_episode: tuple[str, ...] = ()
    """Fields that an environment may change from one episode to the next."""

    def __post_init__(self) -> None:
        name, terms = type(self).__name__, getattr(self, "terms", None)
        if not isinstance(terms, tuple) or not terms or not all(isinstance(term, str) for term in terms):
            raise ValueError(
                f'{name}.terms must name the terms of the reward, such as ("reward_a",), not {shown(terms)}.'
            )
        check_numbers(self, f"{name}.")

    @abstractmethod
    def draw(self, rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
        """What an episode of one robot of a scene is about, and what is kept of it: numbers or arrays by name.

        They are kept as floats, but for whole numbers of NumPy, such as `np.int64(0)`, and flags.
        """

    @abstractmethod
    def targets(self, robots: Robots) -> Floats:
        """Two points of every robot's observation in the world frame [m], shape (n_robots, 4)."""

    @abstractmethod
    def score(self, robots: Robots, hub: Floats, pulses: Floats) -> Score:
        """Score of a decision that ended with the hubs at `hub` [m]. pulses: Heat, see `pulses_of`."""

    def begin(self, robots: Robots, begun: Flags) -> None:  # noqa: B027  # most tasks draw all that they need
        """Begin the episodes of the robots in a mask, which are at rest with their hubs at the origin."""

    def info(self, robots: Robots, hub: Floats) -> dict[str, NDArray[Any]]:
        """Entries of info that belong to the task; arrays over robots, copies."""
        return {}

    def observation(self, robots: Robots) -> Floats:
        """Further entries of the observation, shape (n_robots, k), each of which `entries` names."""
        return np.zeros((robots.n_robots, 0))

    def scenery(self, robots: Robots, robot: int) -> Scenery:
        """What pictures of a robot show besides its waypoints."""
        return NOTHING

    def simulated(self, scene: Scene) -> Scene:
        """Scene that is simulated, where robots know another one."""
        return scene

    def waypoints_of(self, robots: Robots, robot: int) -> Floats:
        """Waypoints of a robot's present episode [m], shape (n, 2), a copy; n is 0 in tasks without."""
        return np.zeros((0, 2))

    def headings_of(self, robots: Robots, robot: int) -> Floats | None:
        """Asked headings of a robot's present episode [rad], shape (n,), a copy; None if none are asked for."""
        return None

    def radius_of(self, robots: Robots, robot: int) -> float:
        """Radius of a robot's waypoints [m]."""
        return self.waypoint_radius


class Robots:
    """`n_robots` robots that swim for a task.

    Every robot has an episode and a generator of its own, so a robot of a batch does what it would do alone.

    options: Of the environment, see `SeastarSwimEnv`. threads: Of the simulator, one for every processor if None.
    effort: Whether info has the actuators' work. split: Which episodes are drawn.
    """

    def __init__(
        self,
        task: Task,
        options: SwimOptions,
        n_robots: int,
        threads: int | None,
        *,
        effort: bool = False,
        split: Split = "train",
    ):
        require_choice("split", split, get_args(Split))
        if task.option != "instance" and split != "train":
            raise ValueError(
                'split is for tasks and path="random", whose episodes are numbered: leave it out for other paths.'
            )
        draws = options.randomization if task.randomization is None else task.randomization
        if task.randomization is not None and options.randomization is not None:
            raise ValueError(f"{type(task).__name__} draws numbers of the scene itself: leave out randomization.")
        options = replace(
            options, sight=options.sight or task.sight,
            randomization=draws if isinstance(draws, DomainRandomization) else None,
            observe_actuators=options.observe_actuators and task.observes_actuators,
        )  # fmt: skip
        self.task, self.options, self.split = task, options, split
        self.per_episode = task.per_episode
        """Fields of the task that may change from one episode to the next, see `ask`."""
        self._terms = frozenset(task.terms)
        self.tasks = [task] * n_robots
        """Task of every robot's next episode."""
        self.episode = SimpleNamespace()
        """What the task drew and keeps of the present episodes: arrays, whose first axis are the robots."""
        self.wiring: Floats | None = None
        """1 for limbs with wires as they should be, -1 for those whose wires are swapped, shape (n_robots, n_limbs)."""
        scene = options.modelled
        self.decision_period = options.period
        self.timed = None if self.decision_period == scene.actuator.period else self.decision_period
        """Time between decisions [s], None where they are strokes of the actuator."""
        self.can_be_masked = can_be_masked(scene.actuator)
        """Whether robots ever have wires that cannot be heated."""
        self.scene, self._drawn_from = scene, task.simulated(scene)
        self._draws = draws
        self.drawn = {} if draws is None else draws.first_values(self._drawn_from, n_robots)
        self.simulator = Simulator(
            drawn_scene(self._drawn_from, self.drawn), n_robots, threads, options.error_bars, effort, options.device
        )
        self._effort = effort
        self.certificate = read_certificate(options.certificate, scene, self.timed)
        self._names_of_errors = tuple(self._errors_of(self.simulator.scene))
        # Scene and strengths of limbs, and the errors of both.
        self._known: tuple[Scene | None, bytes, dict[str, Floats]] = None, b"", {}
        peak = np.max(self.simulator.scene.actuator.peak_angle)  # before the first draw the largest that may be drawn
        if scene.robot.hub_hinge == "turning" and 2 * peak >= scene.robot.opening_angle * (1 - 1e-9):
            raise ValueError(
                'With hub_hinge="turning" some actions would close a hub hinge, where its curvature is infinite: use '
                'hub_hinge="opening" or a smaller peak angle.'
            )
        self.n_robots = n_robots
        self.instance = np.zeros(n_robots, np.int64)
        """Number of every robot's episode in its split."""
        self.waypoint_index = np.zeros(n_robots, np.int64)  # the waypoint to swim to; 0 in tasks without
        self.last_commands = np.zeros((n_robots, scene.robot.n_limbs))
        self.energy = np.zeros(n_robots)  # since the reset [J]
        delay, n_limbs = options.late[ACTION_DELAY], scene.robot.n_limbs
        self._lateness = Lateness(options.late, n_robots)
        is_late = options.sight is not None or bounds_of(delay)[1] > 0.0
        self._lag = Lag(delay, self.decision_period, scene.actuator, n_robots, n_limbs) if is_late else None
        self.tracker: Tracker | None = None
        """What follows robots through the camera; None for full sight."""
        if options.sight is not None:
            self.tracker = Tracker(options.sight.rate, self._sees, n_limbs, self._lateness.values)

    def ask(self, name: str, values: Sequence[Any]) -> None:
        """Have a field of the task hold from the next episode of every robot on.

        values: One for each robot. ValueError, and nothing changes: one of them, or the field, cannot be changed.
        """
        if name not in self.per_episode:
            known = ", ".join(self.per_episode)
            others = f", or change {known}, which hold from the next episode on" if known else ""
            raise ValueError(f"This environment was made with its {name}: make another one with another{others}.")
        self.tasks = self._changed(name, values)

    def _changed(self, name: str, values: Sequence[Any]) -> list[Task]:
        """Tasks of all robots with other values of a field."""
        made: dict[tuple[int, int], Task] = {}
        for task, value in zip(self.tasks, values, strict=True):
            if (id(task), id(value)) not in made:
                made[id(task), id(value)] = replace(task, **{name: value})  # type: ignore[type-var]  # a dataclass
        return [made[id(task), id(value)] for task, value in zip(self.tasks, values, strict=True)]

    @functools.cached_property
    def layout(self) -> Layout:
        """What one robot's observation consists of."""
        of_sight = () if self.options.sight is None else entries_of(self._sees)
        bare = Layout.of(self.scene, self.options.observe_actuators, self.task.entries + of_sight)
        seen = len(stations_seen(self._sees))
        of_limb = bare.of_limb + self.task.observes_commands
        return replace(bare, of_limb=of_limb, shows_limbs=seen > 0, stations=seen or N_STATIONS)

    @property
    def _sees(self) -> Sees | int:
        """What is seen of the robots, see `Sight`."""
        if not self.task.shows_limbs:
            return "pose"
        return "nodes" if self.options.sight is None else self.options.sight.sees

    @functools.cached_property
    def _without_more(self) -> Layout:
        """Layout of what the kernel fills."""
        return Layout(self.scene.robot.n_limbs)

    @functools.cached_property
    def _is_bare(self) -> bool:
        self._further()  # refuses what entries do not name
        return self.layout == self._without_more

    def reset(self, robots: Flags, generators: list[np.random.Generator], asked: Any = None) -> None:
        """Begin a new episode of the robots in a mask, shape (n_robots,).

        generators: Random generator of every robot, which draws the number of its episode; that draws the task, the
        heading, then numbers of the scene. asked: What the options of the reset ask for, see `Task.option`.
        """
        tasks = self.tasks
        if self.task.option == "instance":
            generators = self._numbered(robots, generators, asked)
        elif asked is not None:
            tasks = self._changed(self.task.option, [asked] * self.n_robots)
        headings = np.zeros(self.n_robots)
        for robot in np.flatnonzero(robots).tolist():
            keep(vars(self.episode), robot, self.n_robots, tasks[robot].draw(generators[robot], self.scene))
            if tasks[robot].random_heading:
                headings[robot] = generators[robot].uniform(-np.pi, np.pi)
            if self._draws is not None:
                self._draws.draw(self.drawn, robot, generators[robot])
            self._lateness.draw(robot, generators[robot])
        if self.drawn:
            self.simulator.set_scene(drawn_scene(self._drawn_from, self.drawn), robots)
            strengths = np.asarray(self.scene.limb_strengths or 1.0) * self.drawn.get(LIMB_STRENGTHS, 1.0)
            self.simulator.set_limb_strengths(strengths)
        self.simulator.reset(robots, headings)
        self.energy[robots], self.last_commands[robots] = 0.0, 0.0
        if self._lag is not None:
            self._lag.begin(robots, self._lateness.values[ACTION_DELAY])
        if self.tracker is not None:
            self.tracker.begin(robots, generators, self.simulator)
        self.task.begin(self, robots)

    @functools.cached_property
    def _n_entries(self) -> int:
        """Numbers that the task adds to an observation."""
        return sum(SIZES_OF_ENTRIES[kind] for kind in self.task.entries)

    def _further(self) -> Floats:
        """What the task adds to an observation. ValueError unless its entries name as many numbers."""
        found, wanted = self.task.observation(self), (self.n_robots, self._n_entries)
        if np.shape(found) != wanted:
            raise ValueError(
                f"{type(self.task).__name__}.observation is of shape {np.shape(found)}, and its entries say {wanted}: "
                'name every number in entries, such as ("scalar",).'
            )
        return found

    def _targets(self) -> Floats:
        """Targets of the task, shape (n_robots, 4), checked."""
        found = np.asarray(self.task.targets(self), np.float64)
        if found.shape != (self.n_robots, 4):
            raise ValueError(
                f"{type(self.task).__name__}.targets must have two points of every robot, shape {(self.n_robots, 4)}, "
                f"not {found.shape}."
            )
        return found

    def _numbered(
        self, robots: Flags, generators: list[np.random.Generator], asked: object
    ) -> list[np.random.Generator]:
        """Generators of the next episodes of the robots in a mask, by their numbers.

        asked: Number of the episode, or one for each robot, shape (n_robots,); None draws them.
        """
        wanted = None if asked is None else numbers_of(asked, self.split, self.n_robots)
        of_episodes = list(generators)
        for robot in np.flatnonzero(robots).tolist():
            number = generators[robot].integers(SIZES[self.split]) if wanted is None else wanted[robot]
            self.instance[robot] = number
            of_episodes[robot] = generator_of(int(number), self.split, self.task.spawn_key)
        return of_episodes

    def observe(self) -> NDArray[np.float32]:
        """Observations, shape (n_robots, size), a fresh array; see observation.py."""
        at, tracker = self.layout, self.tracker
        if tracker is None:
            return self._with_more(self._seen_now(), np)
        found = np.empty((self.n_robots, at.size), np.float32)
        found[:, at.actuators] = self._remembered()
        if at.shows_limbs:
            found[:, at.stations_and_hub] = tracker.of_limbs(lengths_of(self.simulator))
        found[:, at.further] = np.concatenate([self._further(), tracker.entries(self.simulator.time)], axis=1)
        away = self._targets().reshape(-1, 2, 2) - tracker.hub[:, None]
        found[:, at.waypoints] = self.in_body_frame(away / lengths_of(self.simulator)[:, None, None]).reshape(-1, 4)
        return found

    @functools.cached_property
    def _tells_growth(self) -> bool:
        """Whether info tells how the kinetic energy grows. Asked once: the answer takes milliseconds."""
        return is_watched(self.scene)

    def observe_on_device(self) -> Any:
        """`observe` as a fresh array of the simulator's device. What a `Sight` shows is copied there."""
        if self.tracker is not None:
            return self.simulator.arrays.asarray(self.observe())
        seen = to_float32(rows_on_device(self.simulator, self._targets()), self.n_robots)
        return self._with_more(seen, self.simulator.arrays)

    def _with_more(self, seen: Any, arrays: ModuleType) -> Any:
        """Observations without delay, by what the kernel fills. arrays: Module of its arrays."""
        if self._is_bare:
            return seen
        at = self.layout
        found = arrays.empty((self.n_robots, at.size), np.float32)
        found[:, at.stations_and_hub] = seen[:, : at.stations_and_hub.stop]
        found[:, at.waypoints] = seen[:, self._without_more.waypoints]
        found[:, at.actuators] = arrays.asarray(self._remembered())
        if at.entries:
            found[:, at.further] = arrays.asarray(self._further())
        return found

    def privileged_observations(self) -> NDArray[np.float32]:
        """What would be observed without a `Sight`, in the layout `Layout.of(scene)`, shape (n_robots, size)."""
        bare, seen, at = self._without_more, self._seen_now(), Layout.of(self.scene)
        found = np.empty((self.n_robots, at.size), np.float32)
        found[:, at.stations_and_hub], found[:, at.waypoints] = seen[:, bare.stations_and_hub], seen[:, bare.waypoints]
        found[:, at.actuators] = self._observed_wires()
        return found

    def _seen_now(self) -> NDArray[np.float32]:
        """Observations of what the kernel fills, without delay, shape (n_robots, k)."""
        return to_float32(observed_rows(self.simulator, self._targets()), self.n_robots)

    def seen_hub(self) -> Floats:
        """Hubs as robots are seen by who decides [m], shape (n_robots, 2), a copy."""
        return self.simulator.hub_position() if self.tracker is None else self.tracker.hub

    def seen_heading(self) -> Floats:
        """Headings as robots are seen by who decides [rad], shape (n_robots,)."""
        c, s = self._seen_axes()
        return np.asarray(np.arctan2(s, c))

    def _seen_axes(self) -> Floats:
        return axes_of(self.simulator) if self.tracker is None else self.tracker.axes

    def _remembered(self) -> Floats:
        """Numbers of the limbs that stand before the targets, shape (n_robots, k), limb after limb."""
        wires = self._observed_wires() if self.options.observe_actuators else np.zeros((self.n_robots, 0))
        if not self.task.observes_commands:
            return wires
        of_limbs = [wires.reshape(*self.last_commands.shape, -1), self.last_commands[..., None]]
        return np.concatenate(of_limbs, axis=-1).reshape(self.n_robots, -1)

    @property
    def added_mirror(self) -> Mirror:
        """What a mirror does to the numbers that the task adds to a limb's in the observation, see `memory_mirror`."""
        return ((0, -1),) if self.task.observes_commands else ()

    def _observed_wires(self) -> Floats:
        """Memory of the actuators in the names of the commands, shape (n_robots, k), limb after limb."""
        wires = self.simulator.observe_actuators()
        if self.wiring is None:
            return wires
        return self._by_command(wires.reshape(*self.wiring.shape, -1)).reshape(self.n_robots, -1)

    def _by_command(self, of_wires: NDArray[Any]) -> NDArray[Any]:
        """Values of wires + and -, shape (n_robots, n_limbs, 2), in the names that commands have for them."""
        if self.wiring is None:
            return of_wires
        return np.where(self.wiring[..., None] < 0.0, of_wires[..., ::-1], of_wires)

    def heading(self) -> Floats:
        """Direction of every robot's body frame [rad], shape (n_robots,): the same bits for one robot and for many."""
        c, s = axes_of(self.simulator)
        return np.asarray(np.arctan2(s, c))

    def in_body_frame(self, vectors: Floats) -> Floats:
        """Vectors of the world frame, shape (n_robots, ..., 2), in the frames in which robots are seen."""
        c, s = (part.reshape(-1, *[1] * (vectors.ndim - 2)) for part in self._seen_axes())
        x, y = vectors[..., 0], vectors[..., 1]
        return np.stack([c * x + s * y, c * y - s * x], axis=-1)

    def action_masks(self) -> Flags:
        """Actions that wires can follow now, shape (n_robots, k), see commands.py."""
        return action_masks(self.options.actions, self.refractory_wires())

    def refractory_wires(self) -> Flags:
        """Wires that cannot be heated now, by their names in commands, shape (n_robots, n_limbs, 2)."""
        return self._by_command(self.simulator.refractory_wires())

    def followed(self, commands: Floats) -> Floats:
        """Commands with zeros for limbs whose wire cannot follow its command now, shape (n_robots, n_limbs)."""
        if not self.can_be_masked:
            return commands
        return np.where(masked_limbs(commands, self.refractory_wires()), 0.0, commands)

    def _wired(self, commands: Floats) -> Floats:
        """Commands as they reach the limbs, shape (n_robots, n_limbs)."""
        return commands if self.wiring is None else commands * self.wiring

    def step(self, commands: Floats) -> Outcome:
        """Advance every robot by one decision."""
        followed = self.last_commands = self.followed(commands)
        if self._lag is None:
            report = self.simulator.advance(self.decision_period, self._wired(followed))
        else:
            report = completed(self.swim_late(self._lag, followed, []))
        return self._judge(commands, followed, report)

    def step_in_parts(self, commands: Floats, parts: int) -> Generator[float, None, Outcome]:
        """One decision in `parts` parts; yields the time since it began [s] after each, and returns the Outcome."""
        followed = self.last_commands = self.followed(commands)
        if self._lag is None:
            report = yield from self.simulator.advance_in_parts(self.decision_period, self._wired(followed), parts)
        else:
            ends = (self.decision_period * np.arange(1, parts + 1) / parts).tolist()
            report = yield from pausing(self.swim_late(self._lag, followed, ends), first_after(ends))
        return self._judge(commands, followed, report)

    def swim_late(self, lag: Lag, commands: Floats, ends: list[float]) -> Generator[float, None, StrokeReport]:
        """One decision whose commands are late; yields times since it began [s], those at `ends` among them."""
        reports = []
        for piece in lag.pieces(commands):
            reports.append((yield from self._swim_piece(piece, np.array(ends) - piece.begin)))
        lag.send(commands)
        return report_of_pieces(reports)

    def _swim_piece(self, piece: Piece, ends: Floats) -> Generator[float, None, StrokeReport]:
        """Piece of a decision, in which pictures are taken. ends: Times at which it pauses, too [s]."""
        pauses = ends[(ends > 0.0) & (ends < piece.duration)]
        if self.tracker is not None:
            pauses = np.append(pauses, self.tracker.due_times(self.simulator.time, piece.duration))

        def look(since: float) -> float:
            if self.tracker is not None:
                self.tracker.take(self.simulator)
            return piece.begin + since

        steps = self.simulator.advance_pausing(piece.duration, self._wired(piece.commands), pauses)
        return (yield from pausing(steps, look))

    def wire_state(self) -> Floats | None:
        """Contractions or temperatures of wires + and -, 0 to 1, shape (n_robots, n_limbs, 2); None without wires."""
        actuator = complete(self.scene.actuator)
        if actuator.refractory_wires(actuator.rest) is None:
            return None
        numbers = self.simulator.observe_actuators()
        return np.clip(numbers.reshape(self.n_robots, self.scene.robot.n_limbs, -1)[..., :2], 0.0, 1.0)

    def _judge(self, commands: Floats, followed: Floats, report: StrokeReport) -> Outcome:
        """Outcome of a decision. commands: Those that were given. followed: Those that were followed."""
        hub = self.simulator.hub_position()
        self.energy += report.energy
        if self.tracker is not None:
            self.tracker.look(self.simulator.time)
        score = self._checked(self.task.score(self, hub, pulses_of(report.heating_time, followed)))
        info = self._info(hub, score, commands, followed, report)
        reward = functools.reduce(operator.add, score.terms.values())
        reward = reward.copy() if len(score.terms) == 1 else reward
        return Outcome(reward, score.over | (report.status != 0), info)

    def _checked(self, score: Score) -> Score:
        """A score whose terms and flags are arrays of their own, shape (n_robots,). ValueError for others."""
        if score.terms.keys() != self._terms:
            raise ValueError(
                f"{type(self.task).__name__}.score has the terms {', '.join(map(str, score.terms))}, and its terms are "
                f"{', '.join(self.task.terms)}."
            )
        terms = {name: self._of_robots(name, term, np.float64) for name, term in score.terms.items()}
        success, over = (self._of_robots("success, over", flags, bool) for flags in score[1:])
        return Score(terms, success, over)

    def _of_robots(self, name: str, values: Any, kind: Any) -> NDArray[Any]:
        """A task's numbers of all robots, or one for all, as a new array, shape (n_robots,)."""
        if type(values) is np.ndarray and values.dtype == kind and values.shape == (self.n_robots,):
            return values.copy()  # as nearly all are
        found = np.asarray(values)
        if found.shape not in ((), (self.n_robots,)) or found.dtype.kind not in "biuf":
            raise ValueError(
                f"{name} of {type(self.task).__name__}.score must be numbers of shape {(self.n_robots,)}, not "
                f"{shown(values)}."
            )
        return np.full(self.n_robots, found, kind)

    def _task_info(self, hub: Floats) -> dict[str, NDArray[Any]]:
        """Entries of info that belong to the task. ValueError for one that is no array over robots."""
        found = self.task.info(self, hub)
        for name, values in found.items():
            if not isinstance(values, np.ndarray) or values.shape[:1] != (self.n_robots,):
                raise ValueError(
                    f"{name} of {type(self.task).__name__}.info must be an array over {self.n_robots} robots."
                )
        return found

    def _info(
        self, hub: Floats | None, score: Score, commands: Floats, followed: Floats, report: StrokeReport
    ) -> dict[str, NDArray[Any]]:
        """Info after a decision; arguments as of `facts` and `_judge`."""
        return {
            **self.facts(hub),
            "is_success": score.success,
            "limbs_heated": np.add.reduce(followed != 0.0, axis=1),
            "heating_time": report.heating_time,
            "energy": report.energy,
            **({"work": report.work, "peak_moment": report.peak_moment} if self._effort else {}),
            **({"masked_limbs": np.add.reduce(followed != commands, axis=1)} if self.can_be_masked else {}),
            "newton_iterations": report.newton_iterations,
            "solver_status": report.status,
            "smallest_opening_angle": report.smallest_opening_angle,
            **({} if self.scene.contact is None else {"largest_overlap": report.largest_overlap}),
            **score.terms,
        }

    def first_info(self) -> dict[str, NDArray[Any]]:
        """Info before the first decision, with the names and types of a decision's info. Arrays are shared."""
        counts, none, never = (np.zeros(self.n_robots, kind) for kind in (np.int64, np.float64, bool))
        angle = np.full(self.n_robots, min(self.scene.robot.opening_angle, np.pi))
        known = {"status": counts, "newton_iterations": counts, "smallest_opening_angle": angle}
        report = StrokeReport(**{**dict.fromkeys(StrokeReport._fields, none), **known})
        score, still = Score(dict.fromkeys(self.task.terms, none), never, never), np.zeros_like(self.last_commands)
        return self._info(None, score, still, still, report)

    def facts(self, hub: Floats | None = None) -> dict[str, NDArray[Any]]:
        """What is known of every robot now; arrays over robots, units as in the environment's docstring.

        Who shows them to a user copies them: some are the same from one decision to the next.
        """
        hub = self.simulator.hub_position() if hub is None else hub
        return {
            "time": self.simulator.time,
            "hub_position": hub,
            **self._task_info(hub),
            **({"action_mask": self.action_masks().astype(np.int8)} if self.can_be_masked else {}),
            **(self._errors() if self.task.tells_errors else {}),
            **({"error_estimate": self.simulator.error_estimate} if self.options.error_bars else {}),
            **({"energy_growth": self.simulator.energy_growth} if self._tells_growth else {}),
            **({} if self.tracker is None else {"sight_age": self.tracker.age(self.simulator.time)}),
            **self.hidden,
            **({"instance": self.instance.copy()} if self.task.option == "instance" else {}),
        }

    @property
    def hidden(self) -> dict[str, Floats]:
        """Drawn numbers of the scene, of the sight and of the delay of actions, by their names, copies."""
        return {**{name: values.copy() for name, values in self.drawn.items()}, **self._lateness.drawn}

    def _errors_of(self, scene: Scene) -> dict[str, float]:
        return errors_in_info(scene, self.certificate, self.timed)

    def _errors(self) -> dict[str, Floats]:
        """Measured errors and speed, shape (n_robots,) each, not copies; NaN for robots with weak limbs."""
        scene, strengths = self.simulator.scene, self.simulator.limb_strengths
        if scene is not self._known[0] or strengths.tobytes() != self._known[1]:
            known, strong = self._errors_of(scene), (strengths == 1.0).all(axis=1)
            errors = {name: np.where(strong, known.get(name, np.nan), np.nan) for name in self._names_of_errors}
            self._known = scene, strengths.tobytes(), errors
        return self._known[2]


def first_after(ends: list[float]) -> Callable[[float], float | None]:
    """A function for `pausing`, which is asked about increasing times: it returns the first that has reached each end.

    For all other times it returns None.
    """
    left = iter(ends)
    end = next(left, np.inf)

    def look(time: float) -> float | None:
        nonlocal end
        if time < end * (1.0 - ROUNDING):
            return None
        while end * (1.0 - ROUNDING) <= time:
            end = next(left, np.inf)
        return time

    return look
