"""Numbers that may differ from robot to robot in a batch.

A part of a scene names them in `PER_ROBOT`. Each is a number, or an array of shape (n_robots,), which is kept as
`PerRobot`, a tuple, so that parts stay equal by value, hashable and frozen.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np

Part = TypeVar("Part")

Numbers: TypeAlias = float | Any
"""A number for all robots, or an array or tuple of shape (n_robots,) with one for each.

Any stands for the latter: whoever reads the scene of one robot reads a float, and need not say so.
"""


class PerRobot(tuple[float, ...]):
    """Numbers of each robot; a plain tuple may be something else, such as a profile along a limb."""

    __slots__ = ()


def require_each(part: Any, name: str, check: Callable[[str, float], None]) -> None:
    """Check a number of a part, or that of each robot, and keep an array as a tuple, numbers of numpy as Python's."""
    value = getattr(part, name)
    if not isinstance(value, np.ndarray | tuple):
        check(name, value)
        object.__setattr__(part, name, _plain(value))
        return
    numbers = value.tolist() if isinstance(value, np.ndarray) else list(map(_plain, value))
    if not isinstance(numbers, list) or not numbers or isinstance(numbers[0], list):
        raise ValueError(f"{name} must be a number, or one for every robot of shape (n_robots,), not {value!r}.")
    for number in numbers:
        check(name, number)
    object.__setattr__(part, name, PerRobot(numbers))


def _plain(number: Any) -> Any:
    """A number of numpy as Python's: one of single precision would go on computing to single precision."""
    return number.item() if isinstance(number, np.generic) else number


def column(numbers: Numbers, n_axes: int = 1) -> Any:
    """A number as it is, numbers of each robot as an array of shape (n_robots, 1, ..), with n_axes axes of length 1."""
    return numbers if np.ndim(numbers) == 0 else np.asarray(numbers, dtype=float).reshape(-1, *(1,) * n_axes)


def of_robot(numbers: Numbers, index: int) -> float:
    """The number of one robot."""
    return float(numbers[index]) if isinstance(numbers, PerRobot) else float(numbers)


def numbers_of(part: Any) -> dict[str, Any]:
    """The numbers that may differ from robot to robot, by their names, "fluid.density" or "robot.limbs.0.length", with
    None for what is not modelled."""
    found = {}
    for name, value in _contents(part).items():
        if name in getattr(part, "PER_ROBOT", ()):
            if not _is_profile(value):
                found[name] = value
        else:
            found.update({f"{name}.{inner}": number for inner, number in numbers_of(value).items()})
    return found


def _contents(part: Any) -> dict[str, Any]:
    """What a part is made of, by name; nothing for what is no part."""
    if dataclasses.is_dataclass(part):
        return {field.name: getattr(part, field.name) for field in dataclasses.fields(part) if field.compare}
    is_tuple_of_parts = isinstance(part, tuple) and part and all(map(dataclasses.is_dataclass, part))
    return {str(k): one for k, one in enumerate(part)} if is_tuple_of_parts else {}


def _is_profile(value: Any) -> bool:
    return isinstance(value, tuple) and not isinstance(value, PerRobot)


def with_numbers(part: Part, numbers: dict[str, Any]) -> Part:
    """The part with some of its numbers changed, named as `numbers_of` names them; also an element of any tuple."""
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
    """The part of a batch of robots, each with the numbers of one of the parts, all of one frame (see `frame_of`)."""
    columns = {name: [numbers_of(part)[name] for part in parts] for name in numbers_of(parts[0])}
    return with_numbers(parts[0], {name: PerRobot(values) for name, values in columns.items() if len(set(values)) > 1})


def batch_size(part: Any) -> int | None:
    """Robots that the numbers of a part are for, or None if they are for any number of robots."""
    sizes = {name: len(value) for name, value in numbers_of(part).items() if isinstance(value, PerRobot)}
    if len(set(sizes.values())) > 1:
        raise ValueError(f"Numbers that differ from robot to robot must be for equally many robots, not {sizes}.")
    return next(iter(sizes.values()), None)


def chosen(part: Part, choose: Callable[[tuple[float, ...]], float]) -> Part:
    """The part with one number chosen of each that differs from robot to robot."""
    numbers = numbers_of(part)
    return with_numbers(part, {name: choose(value) for name, value in numbers.items() if isinstance(value, PerRobot)})


def frame_of(part: Any) -> Any:
    """A part's kind and fields, nested, with only whether they are modelled for those that may differ from robot to
    robot: equal for scenes that run the same code on memory of the same shape."""
    contents, free = _contents(part), getattr(part, "PER_ROBOT", ())
    if not contents:
        return part
    is_free = {name: name in free and not _is_profile(value) for name, value in contents.items()}
    return type(part), *(
        (name, value is None if is_free[name] else frame_of(value)) for name, value in contents.items()
    )
