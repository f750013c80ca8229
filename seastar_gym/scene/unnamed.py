"""Values that nobody named, so that a fidelity may choose them. Until it does, they are those of "balanced"."""

from typing import Any


class Unnamed:
    """Mark of a value that nobody named. It compares and computes like any other, and is None in plain data."""


class UnnamedCount(Unnamed, int):
    """Whole number that nobody named."""


class UnnamedChoice(Unnamed, str):
    """Choice that nobody named."""


def is_named(value: Any) -> bool:
    """Whether somebody named a value."""
    return value is not None and not isinstance(value, Unnamed)
