"""Refusals of arguments, with one sentence each."""

import math

import numpy as np


def is_finite_number(value: object) -> bool:
    """Whether a value is a plain, finite number."""
    is_number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    return is_number and math.isfinite(value)  # type: ignore[arg-type]


def require_finite(name: str, value: float, unit: str) -> None:
    if not is_finite_number(value):
        raise ValueError(f"{name} must be a finite number [{unit}], not {value!r}.")


def require_number(name: str, value: float, unit: str, *, zero_allowed: bool = False) -> None:
    if not is_finite_number(value) or value < 0 or (value == 0 and not zero_allowed):
        kind = "a finite number, not negative" if zero_allowed else "a positive, finite number"
        raise ValueError(f"{name} must be {kind} [{unit}], not {value!r}.")


def require_count(name: str, value: int, smallest: int, largest: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not smallest <= value <= largest:
        raise ValueError(f"{name} must be a whole number from {smallest} to {largest}, not {value!r}.")


def require_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}, not {value!r}.")
