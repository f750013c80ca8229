"""Numbers of parts, declared once: the annotation of a field says the unit of its number and what it may be.

    density: Annotated[Numbers, not_negative("kg/m^3")] = 1000.0

`check_numbers` refuses what was not declared. Numbers of the type `Numbers` may differ from robot to robot;
those of the type `Profile` may differ along a limb. Results of sweeps have the units.

Such a number is one for all robots, or an array of shape (n_robots,). Arrays are kept as tuples (`PerRobot`), so that
parts are frozen, hashable and equal by value.
"""

import dataclasses
from collections.abc import Callable, Hashable, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, partial
from typing import Any, NamedTuple, TypeAlias, TypeVar, get_args, get_origin, get_type_hints

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


Part = TypeVar("Part")

MISSING = ...
"""What a name stands for that a part has not."""


def column(numbers: Numbers, n_axes: int = 1) -> Any:
    """Numbers of each robot as an array of shape (n_robots, 1, ..), with n_axes axes of length 1; others unchanged."""
    if isinstance(numbers, float) or np.ndim(numbers) == 0:
        return numbers
    return np.asarray(numbers, dtype=float).reshape(-1, *(1,) * n_axes)


def of_robot(numbers: Numbers, index: int) -> float:
    """Number of one robot."""
    return float(numbers[index]) if isinstance(numbers, PerRobot) else float(numbers)


def numbers_of(part: Any) -> dict[str, Any]:
    """Numbers of a part that may differ from robot to robot, by name, such as "robot.limbs.0.length".

    Values are None for what is not modelled.
    """
    found, free = {}, _free(part)
    for name, value in _contents(part).items():
        if name in free:
            if not _is_profile(value):
                found[name] = value
        else:
            found.update({f"{name}.{inner}": number for inner, number in numbers_of(value).items()})
    return found


def _free(part: Any) -> set[str]:
    """Names of fields whose numbers may differ from robot to robot."""
    return {name for name, each in declared(part.__class__).items() if each.is_per_robot}


def _contents(part: Any) -> dict[str, Any]:
    """Fields of a part by name, or elements of a tuple of parts by index; empty for everything else."""
    if dataclasses.is_dataclass(part):
        return {field.name: getattr(part, field.name) for field in dataclasses.fields(part) if field.compare}
    is_tuple_of_parts = isinstance(part, tuple) and part and all(map(dataclasses.is_dataclass, part))
    return {str(k): one for k, one in enumerate(part)} if is_tuple_of_parts else {}


def _is_profile(value: Any) -> bool:
    return isinstance(value, tuple) and not isinstance(value, PerRobot)


def at(part: Any, name: str) -> Any:
    """What stands in a part at a name such as "robot.limbs.0.length"; MISSING for nothing."""
    for step in name.split("."):
        if isinstance(part, tuple):
            part = part[int(step)] if step.isdigit() and int(step) < len(part) else MISSING
        else:
            own = dataclasses.fields(part) if dataclasses.is_dataclass(part) else ()
            part = getattr(part, step) if step in {field.name for field in own if field.init} else MISSING
    return part


def unit_of(part: Any, name: str) -> str | None:
    """Unit of the number that stands in a part at a name; None if it declares none."""
    owner, _, last = name.rpartition(".")
    known = declared(at(part, owner).__class__).get(last)
    return None if known is None else known.number.unit


def with_numbers(part: Part, numbers: dict[str, Any]) -> Part:
    """Part with other values of numbers, named as by `numbers_of`. Elements of any tuple may be replaced, too."""
    inner: dict[str, dict[str, Any]] = {}
    own = {}
    for name, value in numbers.items():
        first, _, rest = name.partition(".")
        if rest:
            inner.setdefault(first, {})[rest] = value
        else:
            own[first] = value
    if isinstance(part, tuple):
        own.update({name: with_numbers(part[int(name)], values) for name, values in inner.items()})
        return tuple(own.get(str(k), one) for k, one in enumerate(part))  # type: ignore[return-value]
    own.update({name: with_numbers(getattr(part, name), values) for name, values in inner.items()})
    return dataclasses.replace(part, **own) if own else part  # type: ignore[type-var]


def side_by_side(parts: Sequence[Part]) -> Part:
    """Part for a batch in which robot k has the numbers of parts[k]. All parts must have one frame, see `frame_of`."""
    columns = {name: [numbers_of(part)[name] for part in parts] for name in numbers_of(parts[0])}
    return with_numbers(parts[0], {name: PerRobot(values) for name, values in columns.items() if len(set(values)) > 1})


def batch_size(part: Any) -> int | None:
    """Number of robots for which a part has numbers, or None if it suits any number."""
    sizes = {name: len(value) for name, value in numbers_of(part).items() if isinstance(value, PerRobot)}
    if len(set(sizes.values())) > 1:
        raise ValueError(f"Numbers that differ from robot to robot must be for equally many robots, not {sizes}.")
    return next(iter(sizes.values()), None)


def chosen(part: Part, choose: Callable[[tuple[float, ...]], float]) -> Part:
    """Part in which `choose` has replaced the numbers of each robot by one number."""
    numbers = numbers_of(part)
    return with_numbers(part, {name: choose(value) for name, value in numbers.items() if isinstance(value, PerRobot)})


def frame_of(part: Any) -> Any:
    """Frame of a part: its kind and fields, nested, without the values that may differ from robot to robot.

    Of such values it keeps only whether they are None. Scenes of equal frames run the same code on memory of the same
    shape.
    """
    contents, free = _contents(part), _free(part)
    if not contents:
        return part
    is_free = {name: name in free and not _is_profile(value) for name, value in contents.items()}
    return type(part), *(
        (name, value is None if is_free[name] else frame_of(value)) for name, value in contents.items()
    )
