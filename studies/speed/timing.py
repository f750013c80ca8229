"""Timing of repeated runs on this machine."""

import time
from collections.abc import Callable


def repeat(run: Callable[[], object], seconds: float, at_least: int = 5) -> list[float]:
    """Durations of repeated runs [s], after a first run that does not count, for about `seconds` [s]."""
    run()
    durations: list[float] = []
    while len(durations) < at_least or sum(durations) < seconds:
        start = time.perf_counter()
        run()
        durations.append(time.perf_counter() - start)
    return durations
