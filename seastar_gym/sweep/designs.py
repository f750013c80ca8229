"""`Sweep`: designs of a grid or a Latin hypercube, and their batches, one after the other."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_count, require_seed, shown
from seastar_gym.scene.number import check_numbers, whole
from seastar_gym.scene.per_robot import numbers_of, with_numbers
from seastar_gym.sweep.axes import Axis, Choices, Range, require_known
from seastar_gym.sweep.batches import Batch
from seastar_gym.sweep.configurations import Configuration, Swim, configuration_with, scene_with
from seastar_gym.sweep.controllers import Route

Floats = NDArray[np.float64]

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
    settling, measured: Intervals of the gait, such as strokes, before and during the measurement.
    samples: Designs of the Latin hypercube.
    seed: Of the Latin hypercube.
    robots: Designs of a batch at most.
    route: What controllers swim, if there is an axis of them. Gaits and their intervals are of no matter then.
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
        choices = {
            axis.name: (axis.values[place], axis.labels[place])
            for axis, place in zip(self.of_configurations, places, strict=True)
        }
        frame = configuration_with(self.scene, self.gait, Swim(self.settling, self.measured), choices, self.route)
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
