"""Checks of single values. Each refuses a bad value with a ValueError of one sentence that names it."""

import math
import sys
from os import PathLike
from reprlib import Repr
from types import UnionType
from typing import Any, Union, get_args, get_origin

import numpy as np
from numpy.typing import NDArray

LONGEST_SHOWN = 200
"""Largest number of characters of a value in a sentence."""
DEEPEST = 3
"""Depth of lists within lists in which masked entries are looked for: no argument has more axes."""

_SHORT = Repr()
"""Writer of values that writes only the beginning of large lists, tuples and dicts."""
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
    """Whether a value is a whole number. Flags and time differences are none."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)


def is_finite_number(value: object) -> bool:
    """Whether a value is a number that is finite in double precision. Flags are none."""
    if type(value) is float:  # nearly all are, of a million robots too
        return math.isfinite(value)
    if not (is_whole_number(value) or isinstance(value, float | np.floating)):
        return False
    try:
        return math.isfinite(float(value))  # type: ignore[arg-type]
    except OverflowError:
        return False


def as_float(value: Any) -> Any:
    """A finite number as a Python float: other kinds could compute otherwise. Anything else unchanged."""
    return float(value) if type(value) is not float and is_finite_number(value) else value


def as_typed(value: Any, kind: Any) -> Any:
    """Value whose finite numbers are floats where a type says so, at any depth of tuples. Anything else unchanged."""
    kinds = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    if float in kinds:
        value = as_float(value)
    for inner in (get_args(each) for each in kinds if get_origin(each) is tuple and type(value) is tuple):
        if inner[-1:] == (...,):
            return tuple(as_typed(one, inner[0]) for one in value)
        if len(inner) == len(value):
            return tuple(map(as_typed, value, inner))
    return value


def require_number(name: str, value: float, unit: str, *, zero_allowed: bool = False) -> None:
    """Refuse what is no positive, finite number. Zero may be allowed. unit: Unit in the sentence."""
    if not is_finite_number(value) or value < 0 or (value == 0 and not zero_allowed):
        kind = "a finite number, not negative" if zero_allowed else "a positive, finite number"
        raise ValueError(f"{name} must be {kind} [{unit}], not {shown(value)}.")


def require_period(value: float | None, name: str = "decision_period") -> None:
    """Refuse what is no time between decisions [s], and not None either, which means a stroke."""
    if value is not None:
        require_number(name, value, "s")


def require_finite(name: str, value: float, unit: str) -> None:
    """Refuse what is no finite number. unit: Unit in the sentence."""
    if not is_finite_number(value):
        raise ValueError(f"{name} must be a finite number [{unit}], not {shown(value)}.")


def require_within(name: str, value: float, low: float, high: float) -> None:
    """Refuse what is no number from `low` to `high`."""
    if not is_finite_number(value) or not low <= value <= high:
        raise ValueError(f"{name} must be from {low:g} to {high:g}, not {shown(value)}.")


def require_range(name: str, value: object, unit: str, zero_allowed: bool = False) -> None:
    """Refuse what is not a smallest and a largest number above zero. unit: Unit in the sentence."""
    pair = isinstance(value, tuple) and len(value) == 2 and all(map(is_finite_number, value))
    if not pair or not (0.0 <= value[0] <= value[1]) or (value[0] == 0.0 and not zero_allowed):  # type: ignore[index]
        raise ValueError(f"{name} must be the smallest and the largest number [{unit}], not {shown(value)}.")


def require_error(error: object) -> None:
    """Refuse what is no error that can be asked for."""
    if not is_finite_number(error) or error <= 0.0:  # type: ignore[operator]
        raise ValueError(f"error must be a positive, finite share of the path's length, not {shown(error)}.")


MOST_LIMBS = 12
"""Most limbs of a robot."""


def require_kind(name: str, value: object, kind: Any, words: str) -> None:
    """Refuse what is not of a kind. words: What it must be, such as "a Scene"."""
    if not isinstance(value, kind) or (isinstance(value, type) and kind is not type):
        raise ValueError(f"{name} must be {words}, not {shown(value)}.")


def require_callable(name: str, value: object) -> None:
    """Refuse what is no function."""
    if not callable(value):
        raise ValueError(f"{name} must be a function, not {shown(value)}.")


def require_limbs(n_limbs: object) -> None:
    """Refuse what is no number of limbs that a robot may have."""
    require_count("n_limbs", n_limbs, 1, MOST_LIMBS)


def require_texts(name: str, values: object) -> None:
    """Refuse what is no sequence of texts, such as a single text."""
    if not isinstance(values, list | tuple) or not all(isinstance(value, str) for value in values):
        raise ValueError(f"{name} must be a list of texts, not {shown(values)}.")


def require_file(name: str, file: object) -> None:
    """Refuse what is no path of a file or folder, such as an empty one or one of several lines."""
    if not isinstance(file, str | PathLike) or not (str(file) and str(file).isprintable()):
        raise ValueError(f"{name} must be a path, not {shown(file)}.")


def require_count(name: str, value: object, smallest: int, largest: int) -> None:
    """Refuse what is no whole number from `smallest` to `largest`."""
    if not is_whole_number(value) or not smallest <= value <= largest:  # type: ignore[operator]
        raise ValueError(f"{name} must be a whole number from {smallest} to {largest}, not {shown(value)}.")


def require_seed(seed: object) -> None:
    """Refuse what is neither None nor a whole number that is not negative."""
    if seed is not None and (not is_whole_number(seed) or seed < 0):  # type: ignore[operator]
        raise ValueError(f"A seed is a whole number that is not negative, or None, not {shown(seed)}.")


def require_flag(name: str, value: object) -> None:
    """Refuse what is neither True nor False, such as 0 or 1."""
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} must be True or False, not {shown(value)}.")


def require_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    """Refuse what is not one of the choices."""
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}, not {shown(value)}.")


def require_numbers(name: str, values: object, unit: str) -> None:
    """Refuse what is no tuple of finite numbers. unit: Unit in the sentence."""
    if not isinstance(values, tuple) or not all(map(is_finite_number, values)):
        raise ValueError(f"{name} must be a tuple of finite numbers [{unit}], not {shown(values)}.")


def require_few(name: str, values: object, most: int) -> None:
    """Refuse a list, a tuple or an array of more than `most` entries, before anybody looks at each."""
    counts = isinstance(values, list | tuple) or (isinstance(values, np.ndarray) and values.ndim > 0)
    if counts and len(values) > most:  # type: ignore[arg-type]
        raise ValueError(f"{name} has {len(values):,} entries: {most:,} are the most.")  # type: ignore[arg-type]


def require_unmasked(name: str, value: object) -> None:
    """Refuse masked arrays with masked entries, also in lists: numpy would take the numbers that they hide."""
    if _is_masked(value, DEEPEST):
        raise ValueError(f"{name} must be without masked entries: fill them, or leave them out.")


def _is_masked(value: object, depth: int) -> bool:
    if isinstance(value, np.ma.MaskedArray):
        return bool(np.ma.is_masked(value))
    return depth > 0 and isinstance(value, list | tuple) and any(_is_masked(part, depth - 1) for part in value)


def as_array(name: str, value: object) -> NDArray[Any]:
    """Value as an array, of whatever shape and numbers. ValueError if rows differ in length or entries are masked."""
    require_unmasked(name, value)
    try:
        return np.asarray(value)
    except ValueError as ragged:
        raise ValueError(f"{name} must be one array of numbers or flags, not rows of different lengths.") from ragged


def as_floats(name: str, value: object) -> NDArray[np.float64]:
    """Value as an array of floats, of whatever shape. ValueError if it is not made of numbers."""
    array = as_array(name, value)
    if array.dtype == np.float64:
        return array.copy()
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} must be numbers, not {array.dtype} values.")
    with np.errstate(over="ignore"):  # what no float can hold is infinite, and refused where it must be finite
        return array.astype(float)


def as_finite(name: str, value: object, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Value as an array of finite floats. shape: The last axes, None for one of any length; more may go before them."""
    array = as_floats(name, value)
    last = array.shape[array.ndim - len(shape) :] if array.ndim >= len(shape) else None
    if last is None or any(wanted not in (None, length) for wanted, length in zip(shape, last, strict=True)):
        wanted = ", ".join("n" if length is None else str(length) for length in shape)
        raise ValueError(f"{name} must be numbers of shape (..., {wanted}), not {array.shape}.")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite numbers.")
    return array
