"""Measured errors and speeds of resolutions and numerics of the chapter's robot.

They are stored in `presets.json`, and were measured by `python -m studies.accuracy --store` for the chapter's robot in
the chapter's water, over ten strokes from rest. For example, promise("fast").path_error is 0.03 if the hub strays from
the continuum's path, that of infinitely many nodes and infinitely short steps, by at most 3 % of the path's length.

An error is the largest of those sequences of commands that `measured_over()` counts, so it is no bound for all others:
it bounds 95 % of random sequences with 93 % confidence. docs/accuracy.md says how many of fresh ones exceed it. A
typical error is their median.
"""

import json
import math
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from seastar_gym.scene.checks import require_choice, require_count, require_error, shown

PRESETS = Path(__file__).with_name("presets.json")
TIMED_PRESETS = Path(__file__).with_name("timed_presets.json")
"""Errors of the presets where commands come several times a second, see `TimedPromise`."""
NOT_MEASURED = (
    "Errors were measured for the chapter's robot in the chapter's water only, so nothing can be promised for {}: "
    "`python -m seastar_gym.certify` measures it."
)
"""Refusal to promise errors of another robot or scene."""


@dataclass(frozen=True)
class Promise:
    """Measured errors and speed of a resolution and numerics.

    Errors are sums of the error in space, that of N nodes per limb with infinitely short steps against infinitely many
    nodes, and of the error in time, that of the steps against infinitely short ones with the same nodes. Where the two
    cancel, the sum is promised all the same.

    discretisation, nodes_per_limb: Resolution of the robot, see `Seastar`.
    scheme, step [s], newton_tolerance, path_tolerance: See `Numerics`.
    space_error, time_error: Largest distance of the hub from its path at the ends of strokes, as a fraction of the
        path's length: the largest over the straight swim, the four pairs of Fig. 13.8, the pentagon, and random
        commands, of -1, 0 and 1 or from between.
    path_error: The sum of the two.
    gait_error: Such a sum, the largest over repetitions of any command and alternations of two, and half as much again
        for those that were not measured.
    slow_error: The same for random and repeated commands of a tenth of the amplitude, whose paths are short. No choice
        by error heeds it.
    straight_error: Such a sum, of the straight swim.
    heading_error: Such a sum for the heading [deg], the largest over the swims of path_error.
    end_error: Such a sum for the hub after the last stroke, the largest over the swims of path_error.
    speed: Simulated time over computing time, for a batch on one core of the machine named in presets.json.
    typical_error: Median of the sum of both errors over the random commands of path_error; of presets alone.
    typical_gait_error, typical_slow_error: The same over the commands of gait_error and of slow_error.
    """

    discretisation: str
    nodes_per_limb: int
    scheme: str
    step: float
    newton_tolerance: float
    path_tolerance: float | None
    space_error: float
    time_error: float
    path_error: float
    gait_error: float
    slow_error: float
    straight_error: float
    heading_error: float
    end_error: float
    speed: float
    typical_error: float = math.nan
    typical_gait_error: float = math.nan
    typical_slow_error: float = math.nan

    def __str__(self) -> str:
        adapted = "" if self.path_tolerance is None else f" adapted to {100 * self.path_tolerance:g} %"
        return f'"{self.scheme}" at {1e3 * self.step:g} ms{adapted} with {self.nodes_per_limb} nodes per limb'


@dataclass(frozen=True)
class TimedPromise:
    """Measured errors of a preset where wires (`SmaWires`) are commanded several times a second.

    Largest distances of the hub from its path at whole seconds, as fractions of the path's length, or of a tenth of a
    limb length per second where that is longer: `python -m studies.accuracy.timed --store` measures them.

    space_error, time_error: Largest errors over random commands.
    gait_error: Sum of such errors, the largest over random seconds that are repeated.
    typical_error, typical_gait_error: Medians of the sum over the same commands.
    """

    space_error: float
    time_error: float
    gait_error: float
    typical_error: float
    typical_gait_error: float

    @property
    def path_error(self) -> float:
        """The sum of the errors of space and time."""
        return self.space_error + self.time_error


class Robot(Protocol):
    """Resolution of a robot."""

    @property
    def discretisation(self) -> str: ...
    @property
    def nodes_per_limb(self) -> int: ...


class Numbers(Protocol):
    """Fields of `Numerics` on which errors depend."""

    @property
    def scheme(self) -> str: ...
    @property
    def step(self) -> float: ...
    @property
    def newton_tolerance(self) -> float: ...
    @property
    def path_tolerance(self) -> float | None: ...


class Measurable(Protocol):
    """Parts of a `Scene` on which errors depend."""

    @property
    def robot(self) -> Robot: ...
    @property
    def numerics(self) -> Numbers: ...
    @property
    def is_chapters(self) -> bool: ...


@cache
def _stored() -> dict[str, Any]:
    stored: dict[str, Any] = json.loads(PRESETS.read_text(encoding="utf-8"))
    return stored


def machine() -> str:
    """Name of the machine on which the speeds were measured."""
    return str(_stored()["machine"])


def measured_over() -> dict[str, Any]:
    """Numbers of command sequences that the stored errors are the largest of, by error and kind; and the confidence."""
    return dict(_stored()["measured_over"])


def promises() -> tuple[Promise, ...]:
    """Stored settings, fastest first. None of equal resolution beats another in both errors and speed."""
    return tuple(Promise(**row) for row in _stored()["settings"])


def promise(setting: str | Measurable) -> Promise:
    """Errors and speed of a preset or a `Scene`. ValueError if it was not measured."""
    presets = _presets()
    if isinstance(setting, str):
        if setting not in presets:
            raise ValueError(f"A preset is one of {', '.join(map(repr, presets))}, not {shown(setting)}.")
        return presets[setting]
    if not hasattr(setting, "is_chapters"):
        raise ValueError(f"promise needs the name of a preset or a Scene, not {shown(setting)}.")
    if not setting.is_chapters:
        raise ValueError(NOT_MEASURED.format(shown(setting)))
    known = measured(setting)
    if known is None:
        raise ValueError(f"Nothing was measured, so nothing can be promised, for {shown(setting)}.")
    return known


def measured(scene: Measurable) -> Promise | None:
    """Errors and speed of a `Scene`, or None if it was not measured."""
    if not scene.is_chapters:
        return None
    known = (*_presets().values(), *promises())
    wanted = (_resolution(scene.robot), _setting(scene.numerics))
    return next((row for row in known if (_resolution(row), _setting(row)) == wanted), None)


def timed_promise(preset: str, decision_period: float) -> TimedPromise | None:
    """Errors of a preset for a time between decisions [s]: the larger ones of the measured times around it.

    None outside of the measured times, and for presets that were not measured.
    """
    rows = {float(period): TimedPromise(**row) for period, row in _stored_in_time().get(preset, {}).items()}
    shorter = [period for period in rows if period <= decision_period * (1.0 + 1e-9)]
    longer = [period for period in rows if period >= decision_period * (1.0 - 1e-9)]
    if not shorter or not longer:
        return None
    around = rows[max(shorter)], rows[min(longer)]
    names = [field.name for field in fields(TimedPromise)]
    return TimedPromise(**{name: max(getattr(row, name) for row in around) for name in names})


@cache
def _stored_in_time() -> dict[str, Any]:
    stored: dict[str, Any] = json.loads(TIMED_PRESETS.read_text(encoding="utf-8"))
    return dict(stored["presets"])


def _presets() -> dict[str, Promise]:
    return {name: Promise(**row) for name, row in _stored()["presets"].items()}


def _resolution(robot: Robot) -> tuple[str, int]:
    return robot.discretisation, robot.nodes_per_limb


def _setting(numerics: Numbers) -> tuple[str, float, float, float | None]:
    return numerics.scheme, numerics.step, numerics.newton_tolerance, numerics.path_tolerance


def cheapest(
    error: float, any_gait: bool = False, discretisation: str | None = None, nodes_per_limb: int | None = None
) -> Promise:
    """Fastest stored setting whose path error is at most `error`. ValueError if there is none.

    any_gait: Require it for gait_error, too.
    discretisation, nodes_per_limb: Resolution to keep. None chooses it.
    """
    require_error(error)
    if not isinstance(any_gait, bool | np.bool_):
        raise ValueError(f"any_gait must be True or False, not {shown(any_gait)}.")
    if discretisation is not None:
        require_choice("discretisation", discretisation, ("chapter", "continuum"))
    if nodes_per_limb is not None:
        require_count("nodes_per_limb", nodes_per_limb, 2, 10_000)
    known = sorted(_of_resolution(discretisation, nodes_per_limb), key=lambda row: -row.speed)

    def kept(row: Promise) -> float:
        return max(row.path_error, row.gait_error) if any_gait else row.path_error

    for row in known:
        if kept(row) <= error:
            return row
    best = min(known, key=kept)
    raise ValueError(
        f"No measured setting keeps the path error below {100 * error:g} %: "
        f"the best, {best}, keeps {100 * kept(best):g} %."
    )


def _of_resolution(discretisation: str | None, nodes_per_limb: int | None) -> list[Promise]:
    """Stored settings of a resolution; ValueError if there are none."""
    alike = [row for row in promises() if discretisation in (None, row.discretisation)]
    found = [row for row in alike if nodes_per_limb in (None, row.nodes_per_limb)]
    if not found:
        measured_nodes = ", ".join(str(n) for n in sorted({row.nodes_per_limb for row in alike}))
        raise ValueError(
            f"Errors were measured with {measured_nodes or 'no'} nodes per limb for "
            f"discretisation={shown(discretisation)}, not with {shown(nodes_per_limb)}."
        )
    return found
