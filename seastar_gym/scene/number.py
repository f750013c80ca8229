"""Numbers of parts, declared once: the annotation of a field says the unit of its number and what it may be.

    density: Annotated[Numbers, not_negative("kg/m^3")] = 1000.0

`check_numbers` refuses what was not declared. Numbers of the type `Numbers` may differ from robot to robot, see
per_robot.py; those of the type `Profile` may differ along a limb. Results of sweeps have the units.
"""

from collections.abc import Callable, Hashable
from dataclasses import fields, is_dataclass
from functools import cache, partial
from typing import Any, NamedTuple, TypeAlias, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import (
    as_float,
    as_typed,
    require_count,
    require_few,
    require_finite,
    require_number,
    require_numbers,
    require_range,
    require_within,
    shown,
)

Numbers: TypeAlias = float | Any
"""Number for all robots, or an array or tuple of shape (n_robots,) with one for each.

Typed as Any for the latter, so that code for the scene of one robot may read a float.
"""
Profile: TypeAlias = float | tuple[float, ...]
"""Number, or positive numbers at equally spaced points of a limb from hub to tip (both included), linear in between."""
MOST_ENTRIES = 100_000
"""Most entries of a tuple of a part, such as loads or points of a curve; not of numbers of each robot."""
Range: TypeAlias = tuple[float, float]
"""Smallest and largest number of a uniform draw."""


class Unnamed:
    """Mark of a value that nobody named, so that a fidelity may choose it; until then it is that of "balanced".

    It compares and computes like any other, and is None in plain data.
    """


class UnnamedCount(Unnamed, int):
    """Whole number that nobody named."""


class UnnamedChoice(Unnamed, str):
    """Choice that nobody named."""


def is_named(value: Any) -> bool:
    """Whether somebody named a value."""
    return value is not None and not isinstance(value, Unnamed)


class PerRobot(tuple[float, ...]):
    """Numbers of each robot, shape (n_robots,). Plain tuples may be something else, such as profiles along a limb."""

    __slots__ = ()


class Number(NamedTuple):
    """Declaration of a number.

    unit: "1" for ratios and counts.
    require: Check of a value, given its name for the sentence that refuses it.
    whose: Beginning of that name, such as "A limb's ".
    """

    unit: str
    require: Callable[[str, Any], None]
    whose: str = ""


def positive(unit: str, whose: str = "") -> Number:
    """Positive, finite number."""
    return Number(unit, partial(require_number, unit=unit), whose)


def not_negative(unit: str, whose: str = "") -> Number:
    """Finite number, zero or more."""
    return Number(unit, partial(require_number, unit=unit, zero_allowed=True), whose)


def finite(unit: str, whose: str = "") -> Number:
    """Any finite number."""
    return Number(unit, partial(require_finite, unit=unit), whose)


def ranging(unit: str, zero_allowed: bool = False) -> Number:
    """A `Range` of positive numbers."""
    return Number(unit, partial(require_range, unit=unit, zero_allowed=zero_allowed))


def within(low: float, high: float) -> Number:
    """Ratio from `low` to `high`."""
    return Number("1", partial(require_within, low=low, high=high))


def whole(smallest: int, largest: int) -> Number:
    """Whole number from `smallest` to `largest`."""
    return Number("1", partial(require_count, smallest=smallest, largest=largest))


class Declared(NamedTuple):
    """A field's number, and whether it may differ from robot to robot, be None, or be a profile along a limb."""

    number: Number
    is_per_robot: bool
    is_optional: bool
    may_be_profile: bool


@cache
def declared(kind: Hashable) -> dict[str, Declared]:
    """Numbers that the annotations of a dataclass declare, by the names of its fields; none of other classes."""
    own = fields(kind) if is_dataclass(kind) else ()
    hints = get_type_hints(kind, include_extras=True) if own else {}
    found = {}
    for field in own:
        for number in getattr(hints.get(field.name), "__metadata__", ()):
            kinds = get_args(hints[field.name].__origin__)
            is_profile = any(get_origin(each) is tuple for each in kinds)
            is_optional = field.default is None or type(None) in kinds
            found[field.name] = Declared(number, {float, Any} <= {*kinds}, is_optional, is_profile)
    return {name: each for name, each in found.items() if isinstance(each.number, Number)}


def make_floats(part: Any) -> None:
    """Make floats of a dataclass's finite numbers where its annotations say float; refuse tuples that are too long."""
    for name, hint in annotated(part.__class__).items():
        value = getattr(part, name)
        if type(value) is tuple:
            require_few(name, value, MOST_ENTRIES)
        object.__setattr__(part, name, as_typed(value, hint))


@cache
def annotated(kind: Hashable) -> dict[str, Any]:
    """Annotations of a dataclass's fields; none of other classes."""
    own = fields(kind) if is_dataclass(kind) else ()
    hints = get_type_hints(kind) if own else {}
    return {field.name: hints[field.name] for field in own}


def check_numbers(part: Any, whose: str = "") -> None:
    """Refuse numbers of a part that are not as it declares, and store those of each robot as `PerRobot`.

    Whole numbers become floats first, where the annotations say float.

    whose: Beginning of the names in sentences, such as "Prey.".
    """
    make_floats(part)
    for name, (number, is_per_robot, is_optional, may_be_profile) in declared(part.__class__).items():
        value = getattr(part, name)
        if value is None and is_optional:
            continue
        if type(value) is tuple and may_be_profile:
            _require_profile(f"{whose or number.whose}{name}", value, number.unit)
            continue
        if is_per_robot and isinstance(value, np.ndarray | tuple):
            value = _of_robots(name, value)
            object.__setattr__(part, name, value)
        called = f"{whose or number.whose}{name}"
        for one in value if isinstance(value, PerRobot) else (value,):
            number.require(called, one)


def _require_profile(name: str, profile: tuple[float, ...], unit: str) -> None:
    require_numbers(name, profile, unit)
    if not profile or min(profile) <= 0.0:
        raise ValueError(f"{name} must be positive all along it [{unit}], not {shown(profile)}.")


def as_tuple(profile: Profile) -> tuple[float, ...]:
    """Profile as a tuple of numbers."""
    return profile if isinstance(profile, tuple) else (profile,)


def profile_at(profile: tuple[float, ...], share: NDArray[np.float64]) -> list[float]:
    """Values of a profile at fractions of the length from hub to tip."""
    if len(profile) == 1:
        return [*profile] * len(share)
    return np.interp(share, np.linspace(0.0, 1.0, len(profile)), profile).tolist()


def _of_robots(name: str, value: Any) -> PerRobot:
    numbers = value.tolist() if isinstance(value, np.ndarray) else list(value)
    if not isinstance(numbers, list) or not numbers or isinstance(numbers[0], list):
        raise ValueError(f"{name} must be a number, or one for every robot of shape (n_robots,), not {shown(value)}.")
    return PerRobot(map(as_float, numbers))
