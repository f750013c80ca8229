"""Timing of repeated runs on this machine."""

import os
import platform
import time
from collections.abc import Callable

from seastar_gym.simd.lanes import N_LANES


def repeat(run: Callable[[], object], seconds: float, at_least: int = 5) -> list[float]:
    """Durations of repeated runs [s], after a first run that does not count, for about `seconds` [s]."""
    run()
    durations: list[float] = []
    while len(durations) < at_least or sum(durations) < seconds:
        start = time.perf_counter()
        run()
        durations.append(time.perf_counter() - start)
    return durations


def machine() -> str:
    """Text about the machine: cores, architecture, lanes and Python."""
    return f"{os.cpu_count()} cores, {platform.machine()}, {N_LANES} lanes, Python {platform.python_version()}"
