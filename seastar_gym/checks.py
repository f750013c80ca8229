"""Checks of what a scene is made of; what is no such number or choice is refused with a sentence that names it."""

import math
import sys

import numpy as np


def is_finite_number(value: object) -> bool:
    """Whether the value is a number, not a flag, finite, and no larger than a float can be."""
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) <= sys.float_info.max
    return isinstance(value, float | np.integer | np.floating) and math.isfinite(value)


def require_number(name: str, value: float, unit: str, *, zero_allowed: bool = False) -> None:
    """A positive, finite number, or zero where that is allowed."""
    if not is_finite_number(value) or value < 0 or (value == 0 and not zero_allowed):
        kind = "a finite number, not negative" if zero_allowed else "a positive, finite number"
        raise ValueError(f"{name} must be {kind} [{unit}], not {value!r}.")


def require_finite(name: str, value: float, unit: str) -> None:
    """A finite number."""
    if not is_finite_number(value):
        raise ValueError(f"{name} must be a finite number [{unit}], not {value!r}.")


def require_count(name: str, value: int, smallest: int, largest: int) -> None:
    """A whole number within bounds."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not smallest <= value <= largest:
        raise ValueError(f"{name} must be a whole number from {smallest} to {largest}, not {value!r}.")


def require_flag(name: str, value: object) -> None:
    """True or False, and nothing that Python takes for one of them."""
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} must be True or False, not {value!r}.")


def require_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    """One of the choices."""
    if value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}, not {value!r}.")


def require_numbers(name: str, values: object, unit: str) -> None:
    """A tuple of finite numbers."""
    if not isinstance(values, tuple) or not all(map(is_finite_number, values)):
        raise ValueError(f"{name} must be a tuple of finite numbers [{unit}], not {values!r}.")
