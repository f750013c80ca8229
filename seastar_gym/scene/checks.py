"""Checks of what a scene is made of; what is no such number or choice is refused with a sentence that names it."""

import math
import sys
from reprlib import Repr

import numpy as np
from numpy.typing import NDArray

LONGEST_SHOWN = 200
"""Characters of a value that a sentence shows."""

_SHORT = Repr()
"""Writes the beginnings of large lists, tuples and dicts only."""
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = 100
_SHORT.maxstring = _SHORT.maxlong = _SHORT.maxother = 2 * LONGEST_SHOWN


def shown(value: object) -> str:
    """Text of a value for a sentence: on one line and cut where it is long."""
    if isinstance(value, int) and abs(value) > sys.float_info.max:
        return "a number beyond all floats"
    try:
        text = " ".join(_SHORT.repr(value).split())
    except ValueError:  # Python writes out no integers of thousands of digits, not even within a list
        return f"a {type(value).__name__}"
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def is_whole_number(value: object) -> bool:
    """Whether the value is a whole number, not a flag and not a time."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)


def is_finite_number(value: object) -> bool:
    """Whether the value is a number, not a flag, and finite in double precision."""
    if not (is_whole_number(value) or isinstance(value, float | np.floating)):
        return False
    try:
        return math.isfinite(float(value))  # type: ignore[arg-type]
    except OverflowError:
        return False


def require_number(name: str, value: float, unit: str, *, zero_allowed: bool = False) -> None:
    """A positive, finite number, or zero where that is allowed."""
    if not is_finite_number(value) or value < 0 or (value == 0 and not zero_allowed):
        kind = "a finite number, not negative" if zero_allowed else "a positive, finite number"
        raise ValueError(f"{name} must be {kind} [{unit}], not {shown(value)}.")


def require_finite(name: str, value: float, unit: str) -> None:
    """A finite number."""
    if not is_finite_number(value):
        raise ValueError(f"{name} must be a finite number [{unit}], not {shown(value)}.")


def require_count(name: str, value: int, smallest: int, largest: int) -> None:
    """A whole number within bounds."""
    if not is_whole_number(value) or not smallest <= value <= largest:
        raise ValueError(f"{name} must be a whole number from {smallest} to {largest}, not {shown(value)}.")


def require_seed(seed: object) -> None:
    """A whole number that is not negative, or None."""
    if seed is not None and (not is_whole_number(seed) or seed < 0):  # type: ignore[operator]
        raise ValueError(f"A seed is a whole number that is not negative, or None, not {shown(seed)}.")


def require_flag(name: str, value: object) -> None:
    """True or False, and nothing that Python takes for one of them."""
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} must be True or False, not {value!r}.")


def require_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    """One of the choices."""
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}, not {shown(value)}.")


def require_numbers(name: str, values: object, unit: str) -> None:
    """A tuple of finite numbers."""
    if not isinstance(values, tuple) or not all(map(is_finite_number, values)):
        raise ValueError(f"{name} must be a tuple of finite numbers [{unit}], not {shown(values)}.")


def as_floats(name: str, value: object) -> NDArray[np.float64]:
    """Value as an array of floats, of whatever shape. ValueError if it is not made of numbers."""
    try:
        array = np.asarray(value)
    except ValueError as ragged:
        raise ValueError(f"{name} must be an array of numbers, not rows of different lengths.") from ragged
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} must be numbers, not {array.dtype} values.")
    return array.astype(float)
