"""`Setting`: a resolution and numerics, with the errors and the speed of one scene."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast, get_args

from seastar_gym.scene import Numerics, Scene
from seastar_gym.scene.checks import require_choice, require_count, require_number, shown
from seastar_gym.scene.numerics import Resolution, SchemeName
from seastar_gym.scene.robot import Discretisation

LARGEST_GROWTH = 1.5
"""Growth of the kinetic energy over a long swim above which `Certificate.for_error` does not choose a setting."""


@dataclass(frozen=True)
class Setting:
    """A resolution and numerics, with the errors and the speed of one scene.

    Errors are fractions of the hub's path in the continuum, over ten strokes from rest, each the largest of all
    sequences of a class. An error is the sum of that of space, of N nodes per limb with very short steps, and that of
    time, of the steps with the same nodes. The sum is told also where the two cancel. In a current, the path is the way
    through the water, and robots begin at rest in the water.

    nodes_per_limb, scheme, step [s], newton_tolerance, path_tolerance, damping, discretisation: See `Numerics` and
        `Seastar`.
    errors: Sum of the errors of space and time, by class of commands, see `Certificate`.
    typical: The same, the median of all sequences of a class. {} where medians were not measured.
    space_error, time_error: Largest errors of all classes that the certificate promises.
    speed: Simulated time over computing time, for a batch on one core.
    energy_growth: Kinetic energy late in swims of 200 strokes over that early in them, the largest of some gaits.
    heading_error, end_error: Errors of the heading [deg] and of the hub after the last stroke, over the same commands
        as `space_error`.

    NaN stands for what was not measured, where it is the default. A failed swim has the error inf. Anything else that
    is no number from 0 on is refused with a ValueError.
    """

    nodes_per_limb: int
    scheme: str
    step: float
    newton_tolerance: float
    errors: Mapping[str, float]
    typical: Mapping[str, float]
    space_error: float
    time_error: float
    speed: float = math.nan
    energy_growth: float = math.nan
    heading_error: float = math.nan
    end_error: float = math.nan
    path_tolerance: float | None = None
    discretisation: str = "continuum"
    damping: float = 0.0

    def __post_init__(self) -> None:
        require_choice("discretisation", self.discretisation, get_args(Discretisation))
        require_count("nodes_per_limb", self.nodes_per_limb, 2, 10_000)
        if is_measured(self.speed):
            require_number("speed", self.speed, "1")
        _require_classes("errors", self.errors)
        if self.typical != {}:
            _require_classes("typical", self.typical)
            if set(self.errors) != set(self.typical):
                raise ValueError("errors and typical must have the same classes of commands.")
        for name in ("space_error", "time_error"):
            require_measured(name, getattr(self, name))
        for name in ("energy_growth", "heading_error", "end_error"):
            if is_measured(getattr(self, name)):
                require_measured(name, getattr(self, name))
        _ = self.resolution

    @cached_property
    def resolution(self) -> Resolution:
        """Discretisation, nodes per limb and numerics."""
        numerics = Numerics(
            cast(SchemeName, self.scheme), self.step, self.newton_tolerance,
            path_tolerance=self.path_tolerance, damping=self.damping,
        )  # fmt: skip
        return Resolution(cast(Discretisation, self.discretisation), self.nodes_per_limb, numerics)

    @property
    def numerics(self) -> Numerics:
        """Numerics of the setting."""
        return self.resolution.numerics

    @property
    def is_energy_stable(self) -> bool:
        """Whether long swims gather no energy, as far as was measured: errors of ten strokes would not show it."""
        return not self.energy_growth > LARGEST_GROWTH

    def error(self, classes: Iterable[str]) -> float:
        """Largest error over some classes; NaN of none."""
        return _largest(self.errors, classes)

    def typical_error(self, classes: Iterable[str]) -> float:
        """Median error, of the class where it is largest: half of the sequences of every class have less.

        NaN of no classes, and where medians were not measured.
        """
        return _largest(self.typical, classes)

    def __str__(self) -> str:
        adapted = "" if self.path_tolerance is None else f" adapted to {100 * self.path_tolerance:g} %"
        return f'"{self.scheme}" at {1e3 * self.step:g} ms{adapted} with {self.nodes_per_limb} nodes per limb'


def is_measured(number: object) -> bool:
    """Whether a number is not the NaN that stands for what was not measured."""
    return not isinstance(number, float) or not math.isnan(number)


def _largest(errors: Mapping[str, float], classes: Iterable[str]) -> float:
    asked = set(classes)
    return max(errors[name] for name in asked) if asked and asked.issubset(errors) else math.nan


def _require_classes(name: str, errors: Any) -> None:
    """Refuse what is no error by class of commands."""
    if not isinstance(errors, Mapping) or not errors:
        raise ValueError(f"{name} must be numbers by class of commands, not {shown(errors)}.")
    for each in errors.values():
        require_measured(name, each)


def require_measured(name: str, error: float) -> None:
    """Refuse what is no measured error: a number from 0 on, or inf for a swim that failed."""
    if not (isinstance(error, float) and error == math.inf):
        require_number(name, error, "1", zero_allowed=True)


def at(scene: Scene, resolution: Resolution) -> Scene:
    """The scene with a discretisation, nodes per limb and numerics."""
    discretisation, nodes_per_limb, numerics = resolution
    robot = replace(scene.robot, nodes_per_limb=nodes_per_limb, discretisation=discretisation, hub_hinge="opening")
    return replace(scene, robot=robot, numerics=numerics)


def resolved(scene: Scene, nodes_per_limb: int, numerics: Numerics) -> Scene:
    """The scene with nodes per limb of the continuum's discretisation, and numerics."""
    return at(scene, Resolution("continuum", nodes_per_limb, numerics))


def physics(scene: Scene) -> Scene:
    """The scene with one resolution and numerics for all: what a certificate is about."""
    return resolved(scene, 10, Numerics())
