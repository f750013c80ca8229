"""Intervals that pause: what is looked at meanwhile, and what they return in the end."""

import contextlib
from collections.abc import Callable, Generator
from typing import TypeVar

Result = TypeVar("Result")


def pausing(
    steps: Generator[float, None, Result], look: Callable[[float], float | None]
) -> Generator[float, None, Result]:
    """Yields what `look` makes of the time [s] at every pause of an interval, but for None; returns what it returns.

    Closing or dropping it closes the interval, as an exception in `look` does.
    """
    with contextlib.closing(steps):
        while True:
            try:
                time = next(steps)
            except StopIteration as over:
                return over.value
            if (pause := look(time)) is not None:
                yield pause


def completed(steps: Generator[float, None, Result], look: Callable[[float], object] = lambda _: None) -> Result:
    """What an interval returns in the end. look: Called with the time [s] at every pause."""

    def unseen(time: float) -> None:
        look(time)

    try:
        next(pausing(steps, unseen))
    except StopIteration as over:
        return over.value
    raise AssertionError("It has no pauses of its own.")
