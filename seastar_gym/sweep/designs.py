"""`Sweep`: designs of a grid or a Latin hypercube, and their batches, one after the other.

Axes of a sweep: what differs from design to design.

An axis has the name of a number of the scene ("robot.limb_length", "numerics.step"), of a whole part ("robot",
"fluid", "actuator", "numerics", "contact"), "fidelity" for the name of a preset, "gait" or "controller".

Configurations: what all robots of a lane batch have in common, a scene, and a gait or a controller.

Gaits by name, as the commands of a sweep's robots.

Controllers of designs: policies by the names that `seastar evaluate` knows, and the path that they swim.

Batches: designs that are simulated side by side, named by the digest of all that their results depend on.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym import gaits
from seastar_gym.controllers.contract import Policy, require_fit
from seastar_gym.controllers.learned import load
from seastar_gym.controllers.open_loop import GAITS, scripted
from seastar_gym.controllers.registry import AGENTS, files_of, learned_file, load_agent
from seastar_gym.envs.commands import checked_decision_period, decisions_in
from seastar_gym.envs.paths import make_path
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.waypoints import Path as SwimPath
from seastar_gym.evaluation.swim import HELD_OUT_SEED, TIME_LIMIT
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import complete
from seastar_gym.scene.checks import (
    as_finite,
    as_floats,
    is_finite_number,
    require_count,
    require_flag,
    require_kind,
    require_number,
    require_period,
    require_seed,
    shown,
)
from seastar_gym.scene.number import MISSING, at, check_numbers, numbers_of, whole, with_numbers
from seastar_gym.version import __version__

Floats = NDArray[np.float64]

PARTS = ("robot", "fluid", "actuator", "numerics", "contact")
"""Parts of a scene that an axis may replace as a whole."""
MOST_VALUES = 1_000_000
"""Most values of an axis that are spaced evenly."""


@dataclass(frozen=True)
class Range:
    """Axis of all numbers from `low` to `high`, evenly spread, or their logarithms are if `is_log`."""

    name: str
    low: float
    high: float
    is_log: bool = False

    def __post_init__(self) -> None:
        _require_name(self.name)
        require_flag("is_log", self.is_log)
        if not is_finite_number(self.low) or not is_finite_number(self.high) or self.low >= self.high:
            raise ValueError(f"{self.name} must go from a finite number to a larger one, not {shown(self)}.")
        if self.is_log and self.low <= 0.0:
            raise ValueError(f"Logarithms need positive numbers, and {self.name} begins at {shown(self.low)}.")

    def at(self, share: Floats) -> Floats:
        """Numbers at shares of the way from `low` to `high`."""
        share = as_finite("share", share, ())
        if self.is_log:
            low, high = math.log(self.low), math.log(self.high)
            return np.clip(np.exp(low + share * (high - low)), self.low, self.high)
        return self.low + share * (self.high - self.low)

    def spaced(self, n: int) -> Choices:
        """Axis of n of its numbers, both ends included."""
        require_count("n", n, 1, MOST_VALUES)
        return Choices(self.name, tuple(self.at(np.linspace(0.0, 1.0, n)).tolist()))


@dataclass(frozen=True)
class Choices:
    """Axis of a few values: numbers, names or parts of a scene.

    labels: Texts or numbers that stand for the values in results; by default the values themselves, or their kinds.
    """

    name: str
    values: tuple[Any, ...]
    labels: tuple[Any, ...] = field(default=())

    def __post_init__(self) -> None:
        _require_name(self.name)
        require_kind("labels", self.labels, tuple, "a tuple")
        if not isinstance(self.values, tuple) or not self.values:
            raise ValueError(f"{self.name} needs a tuple of values to choose from, not {shown(self.values)}.")
        labels = self.labels or tuple(map(_label, self.values))
        object.__setattr__(self, "labels", labels)
        known = all(isinstance(label, str | int | float) for label in labels)
        if not known or len(labels) != len(self.values) or len(set(labels)) < len(labels):
            raise ValueError(f"Values of {self.name} need labels that differ, not {shown(labels)}.")

    @property
    def is_numeric(self) -> bool:
        """Whether all values are finite numbers."""
        return all(map(is_finite_number, self.values))


Axis: TypeAlias = Range | Choices


def _require_name(name: object) -> None:
    """Refuse what is no name of an axis."""
    if not isinstance(name, str) or not name:
        raise ValueError(f"The name of an axis must be a text, not {shown(name)}.")


def _label(value: Any) -> Any:
    return value if isinstance(value, str | int | float) else type(value).__name__


def require_known(scene: Scene, name: str) -> None:
    """ValueError unless an axis of this name can change the scene."""
    if name in (*PARTS, "fidelity", "gait", "controller"):
        return
    owner, _, _ = name.rpartition(".")
    known = owner.split(".")[0] in PARTS and is_dataclass(at(scene, owner)) and at(scene, name) is not MISSING
    if not known:
        raise ValueError(f"{shown(name)} is nothing that a sweep can vary in this scene, such as robot.limb_length.")


DECISION = 0.1
"""Time between the commands of gaits in time [s]."""


class Gait(NamedTuple):
    """Commands that are repeated. commands: One tuple per interval. interval: Its length [s], None for a stroke."""

    commands: tuple[tuple[float, ...], ...]
    interval: float | None = None

    @property
    def per_stroke(self) -> int:
        """Intervals that count as a stroke: one, or all of a gait in time, which lasts a second."""
        return 1 if self.interval is None else len(self.commands)


TIMED = "lagged", "thrifty"
"""Gaits in time."""


def gait_of(what: str | ArrayLike, scene: Scene) -> Gait:
    """Gait for a scene's robot. ValueError if it has none.

    what: "straight", "lagged", "thrifty", a pair such as "2+,5-", or commands, shape (n_strokes, n_limbs).
    """
    n_limbs = scene.robot.n_limbs
    if not isinstance(what, str):
        commands = as_floats("gait", what)
        if commands.ndim != 2 or commands.shape[1] != n_limbs or not len(commands):
            raise ValueError(f"A gait needs rows of commands of {n_limbs} limbs, not {shown(what)}.")
        return Gait(_rows(commands))
    if what in TIMED:
        if not complete(scene.actuator).has_memory:
            raise ValueError(f'The gait "{what}" heats limbs in the middle of strokes: use an actuator like SmaWires.')
        return Gait(_rows(GAITS[what](n_limbs, DECISION)), DECISION)
    return Gait(_rows(gaits.straight_gait(n_limbs) if what == "straight" else _stroke(what, n_limbs)))


def _rows(commands: gaits.Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, commands.tolist()))


def _stroke(text: str, n_limbs: int) -> gaits.Floats:
    """One stroke that heats what the text says, such as "2+,5-"."""
    command = np.zeros((1, n_limbs))
    for limb in text.split(","):
        number, sign = limb[:-1], limb[-1:]
        if sign not in ("+", "-") or not number.isdecimal() or not 1 <= int(number) <= n_limbs:
            known = ", ".join(["straight", *TIMED])
            raise ValueError(f"A gait is one of {known}, or limbs of {n_limbs} such as 1+,2-, not {shown(text)}.")
        if command[0, int(number) - 1]:
            raise ValueError(f"A gait turns a limb one way in a stroke, and {shown(text)} names limb {number} twice.")
        command[0, int(number) - 1] = 1.0 if sign == "+" else -1.0
    return command


@dataclass(frozen=True)
class Route:
    """What controllers swim: a path, once, from rest.

    path: Name of a path, or waypoints [m]. One that is drawn, such as "random", is the same for all designs.
    seconds: Time limit [s].
    decision_period: Time between decisions [s]. None means a stroke.
    """

    path: SwimPath = "pentagon"
    seconds: float = TIME_LIMIT
    decision_period: float | None = None

    def __post_init__(self) -> None:
        require_number("seconds", self.seconds, "s")
        make_path(self.path, np.random.default_rng(HELD_OUT_SEED))
        require_period(self.decision_period)


@dataclass(frozen=True)
class Controller:
    """A controller, and what it swims.

    name: As in `seastar_gym.controllers.registry`. digest: SHA-256 of the files that it is made of. waypoints: [m].
    decisions: Decisions at most. decision_period: Time between them [s]. None means a stroke.
    """

    name: str
    digest: str
    waypoints: tuple[tuple[float, float], ...]
    decisions: int
    decision_period: float | None

    def policy(self, scene: Scene) -> Policy:
        """The policy, new. ValueError where its files are others than when the sweep was planned.

        scene: Of the frame: what robots have of their own is not known to controllers.
        """
        if _digest(files_of(self.name, self.decision_period)) != self.digest:
            raise ValueError(f"The controller {self.name} is another one here than where the sweep was planned.")
        return load_agent(self.name, SeastarSwimEnv(scene=scene, decision_period=self.decision_period))


def controller_of(name: Any, route: Route, scene: Scene) -> Controller:
    """Controller of a name for a scene.

    ValueError, or FileNotFoundError, where there is none or a learned one does not fit. Whether agents of one's own
    fit, their first batch says: they are not made here.
    """
    if not isinstance(name, str):
        raise ValueError(f"A controller is the name of an agent, such as learned, not {shown(name)}.")
    seconds = checked_decision_period(route.decision_period, scene)
    period = None if seconds == scene.actuator.period else seconds
    files, file = files_of(name, period), learned_file(name, period)
    if file is not None:
        policy = load(file)
        require_fit(policy, scene, policy.actions, period)
    elif name not in AGENTS and not files:
        scripted(name, n_limbs=scene.robot.n_limbs, decision_period=period)
    waypoints = make_path(route.path, np.random.default_rng(HELD_OUT_SEED))
    return Controller(
        name, _digest(files), tuple(map(tuple, waypoints.tolist())), decisions_in(route.seconds, seconds), period
    )


def _digest(files: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


FORM = 3
"""Form of the results. Parts of another form are other parts."""


@dataclass(frozen=True)
class Configuration:
    """Scene and gait, or controller, of a lane batch, before its robots get their own numbers.

    gait: Of robots without a controller. settling, measured: Its strokes before and during the measurement.
    labels: What was chosen, by the name of the axis: texts or numbers.
    controller: Controller, None for a gait.
    """

    scene: Scene
    gait: Gait
    settling: int
    measured: int
    labels: tuple[tuple[str, Any], ...]
    controller: Controller | None = None

    @cached_property
    def text(self) -> str:
        """All that results depend on except the numbers of robots, as JSON."""
        told = {"scene": self.scene.to_dict(), "labels": self.labels, "version": __version__, "form": FORM}
        if self.controller is None:
            told |= {"commands": self.gait.commands, "interval": self.gait.interval}
            told |= {"settling": self.settling, "measured": self.measured}
        else:
            told["pilot"] = asdict(self.controller)
        return json.dumps(told, sort_keys=True)

    @property
    def strokes(self) -> int:
        """Strokes that every robot swims; 0 for controllers, which end when they arrive."""
        return self.settling + self.measured if self.controller is None else 0

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of the text."""
        return hashlib.sha256(self.text.encode()).digest()


def scene_with(scene: Scene, values: dict[str, Any]) -> Scene:
    """Scene with other values by name: first whole parts, then a fidelity, then single numbers."""
    parts = {name: value for name, value in values.items() if name in PARTS}
    changed = replace(scene, **parts) if parts else scene
    if "fidelity" in values:
        preset = Scene.preset(values["fidelity"])
        nodes, discretisation = preset.robot.nodes_per_limb, preset.robot.discretisation
        robot = replace(changed.robot, nodes_per_limb=nodes, discretisation=discretisation)
        changed = replace(changed, robot=robot, numerics=preset.numerics)
    numbers = {name: value for name, value in values.items() if "." in name}
    return with_numbers(changed, numbers)


@dataclass(frozen=True)
class Batch:
    """One lane batch. numbers: Numbers of each robot by name, shape (n_robots,) each; () where all are alike."""

    configuration: Configuration
    numbers: dict[str, Floats]
    n_robots: int

    @cached_property
    def name(self) -> str:
        """Digest of the scene with its numerics, the commands, the numbers and the package's version."""
        digest = hashlib.sha256(self.configuration.digest)
        digest.update(str(self.n_robots).encode())
        for name, values in self.numbers.items():
            digest.update(name.encode() + b"\0" + np.ascontiguousarray(values, np.float64).tobytes())
        return digest.hexdigest()[:40]


CHECKED = 256
"""Frames that are made before the first batch runs, so that bad choices are refused at once."""
MOST_NUMBERS = 20_000_000
"""Numbers of a Latin hypercube, which is drawn as a whole: 160 MB."""


@dataclass(frozen=True)
class Sweep:
    """Designs of all combinations of choices; with ranges, `samples` of a Latin hypercube for every combination.

    Numbers that may differ from robot to robot are simulated side by side, as many designs as `robots` in a batch. All
    other choices make batches of their own. Batches are made one by one: memory does not grow with their number.

    scene: Scene for one robot that is varied.
    axes: What differs.
    gait: What every robot does unless an axis says it, see `gait_of`.
    settling, measured: Strokes before and during the measurement; of gaits in time, their periods of a second.
    samples: Designs of the Latin hypercube.
    seed: Of the Latin hypercube.
    robots: Designs of a batch at most.
    route: What controllers swim, if there is an axis of them. Gaits and their strokes are of no matter then.
    """

    scene: Scene
    axes: tuple[Axis, ...]
    gait: Any = "straight"
    settling: Annotated[int, whole(0, 1_000_000)] = 2
    measured: Annotated[int, whole(1, 1_000_000)] = 8
    samples: Annotated[int, whole(0, MOST_NUMBERS)] = 0
    seed: int = 0
    robots: Annotated[int, whole(1, 1_000_000)] = 256
    route: Route = Route()

    def __post_init__(self) -> None:
        if not isinstance(self.scene, Scene) or self.scene.n_robots is not None:
            raise ValueError(f"A sweep varies a Scene for one robot, not {shown(self.scene)}.")
        if not isinstance(self.axes, tuple) or not all(isinstance(axis, Range | Choices) for axis in self.axes):
            raise ValueError(f"axes must be a tuple of Range and Choices, not {shown(self.axes)}.")
        names = [axis.name for axis in self.axes]
        if len(set(names)) < len(names):
            raise ValueError(f"Every axis may be named once, not {shown(names)}.")
        if {"gait", "controller"} <= set(names):
            raise ValueError("Robots follow a gait or a controller: take one of these axes.")
        check_numbers(self)
        require_seed(self.seed)
        self._check_axes()
        self._check_ends(next(self.configurations()))
        for _ in itertools.islice(self.configurations(), CHECKED):
            pass

    def _check_axes(self) -> None:
        for axis in self.axes:
            require_known(self._first, axis.name)
        for axis in self.ranges:
            if axis.name not in numbers_of(self._first):
                raise ValueError(f"{axis.name} cannot differ within a batch: give it values, such as 1,2,3 or 1:3:5.")
        if self.ranges:
            require_count("samples", self.samples, 1, MOST_NUMBERS // len(self.ranges))
        elif self.samples:
            raise ValueError("A Latin hypercube needs a range to draw from, such as robot.limb_length=0.05:0.15.")

    def _check_ends(self, frame: Configuration) -> None:
        """Refuse numbers of robots of which neither the first nor the last ones can be modelled together."""
        ends = [
            {axis.name: axis.at(np.array(end)) for axis in self.ranges}
            | {axis.name: axis.values[-int(end)] for axis in self.of_robots}
            for end in (0.0, 1.0)
        ]
        refusals = []
        for numbers in ends:
            try:
                with_numbers(frame.scene, {name: float(value) for name, value in numbers.items()})
            except ValueError as refused:
                refusals.append(refused)
        if len(refusals) == len(ends):
            raise refusals[0]

    @cached_property
    def _first(self) -> Scene:
        """Scene with the first of every choice of a part, which tells what numbers there are."""
        parts = [axis for axis in self.axes if isinstance(axis, Choices) and "." not in axis.name]
        return scene_with(self.scene, {axis.name: axis.values[0] for axis in parts})

    @cached_property
    def ranges(self) -> tuple[Range, ...]:
        """Axes of the Latin hypercube."""
        return tuple(axis for axis in self.axes if isinstance(axis, Range))

    @cached_property
    def of_robots(self) -> tuple[Choices, ...]:
        """Choices of numbers that may differ from robot to robot."""
        choices = [axis for axis in self.axes if isinstance(axis, Choices)]
        return tuple(axis for axis in choices if axis.is_numeric and axis.name in numbers_of(self._first))

    @cached_property
    def _values(self) -> dict[str, Floats]:
        """Values of `of_robots`, as arrays."""
        return {axis.name: np.array(axis.values, np.float64) for axis in self.of_robots}

    @cached_property
    def of_configurations(self) -> tuple[Choices, ...]:
        """Choices of which every combination needs batches of its own."""
        choices = [axis for axis in self.axes if isinstance(axis, Choices)]
        return tuple(axis for axis in choices if axis not in self.of_robots)

    @property
    def n_configurations(self) -> int:
        """Number of combinations of choices that need batches of their own."""
        return math.prod(len(axis.values) for axis in self.of_configurations)

    @property
    def designs_per_configuration(self) -> int:
        """Number of designs of each such combination."""
        return math.prod(len(axis.values) for axis in self.of_robots) * max(1, self.samples)

    @property
    def n_designs(self) -> int:
        """Number of designs."""
        return self.n_configurations * self.designs_per_configuration

    @property
    def n_batches(self) -> int:
        """Number of batches."""
        return self.n_configurations * -(-self.designs_per_configuration // self.robots)

    def configurations(self) -> Iterator[Configuration]:
        """Configurations of all combinations of choices. ValueError for one that cannot be modelled."""
        for places in itertools.product(*(range(len(axis.values)) for axis in self.of_configurations)):
            yield self.configuration(places)

    def configuration(self, places: tuple[int, ...]) -> Configuration:
        """Configuration of one combination. places: Which value of every one of `of_configurations`."""
        chosen = list(zip(self.of_configurations, places, strict=True))
        values = {axis.name: axis.values[place] for axis, place in chosen}
        try:
            scene = scene_with(self.scene, values)
            controller = controller_of(values["controller"], self.route, scene) if "controller" in values else None
            gait = gait_of(values.get("gait", self.gait), scene) if controller is None else Gait(())
        except TypeError as unfit:
            raise ValueError(f"{shown(values)} do not fit the scene: {unfit}.") from None
        labels = tuple((axis.name, axis.labels[place]) for axis, place in chosen)
        frame = Configuration(scene, gait, self.settling, self.measured, labels, controller)
        of_robots: tuple[Axis, ...] = (*self.ranges, *self.of_robots)
        missing = {axis.name for axis in of_robots} - set(numbers_of(frame.scene))
        if missing:
            raise ValueError(f"With {shown(dict(frame.labels))}, no number is called {', '.join(sorted(missing))}.")
        return frame

    def batches(self) -> Iterator[Batch]:
        """All batches, one after the other."""
        for index, frame in enumerate(self.configurations()):
            drawn = self._drawn(index)
            for begin in range(0, self.designs_per_configuration, self.robots):
                places = np.arange(begin, min(begin + self.robots, self.designs_per_configuration))
                yield Batch(frame, self._numbers(places, drawn), len(places))

    def _drawn(self, index: int) -> Floats:
        """Latin hypercube of a frame, shares of the ranges, shape (samples, n_ranges)."""
        from scipy.stats import qmc  # takes half a second

        if not self.ranges:
            return np.zeros((1, 0))
        generator = np.random.default_rng([self.seed, index])
        return np.asarray(qmc.LatinHypercube(len(self.ranges), seed=generator).random(self.samples))

    def _numbers(self, places: NDArray[np.int64], drawn: Floats) -> dict[str, Floats]:
        """Numbers of the designs of a frame at these places, by name."""
        places, sample = np.divmod(places, len(drawn))
        numbers = {axis.name: axis.at(drawn[sample, k]) for k, axis in enumerate(self.ranges)}
        for axis in reversed(self.of_robots):
            places, which = np.divmod(places, len(axis.values))
            numbers[axis.name] = self._values[axis.name][which]
        return numbers
