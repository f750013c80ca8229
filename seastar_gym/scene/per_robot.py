"""Numbers of a scene that may differ from robot to robot in a batch: those that a part declares as `Numbers`.

Each is one number for all robots, or an array of shape (n_robots,). Arrays are kept as tuples (`PerRobot`), so that
parts are frozen, hashable and equal by value.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from seastar_gym.scene.number import Numbers, PerRobot, declared

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
