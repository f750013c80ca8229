"""Time steps of a stroke, and of any other interval."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from seastar_gym.scene.checks import require_number
from seastar_gym.scene.numerics import MAX_STEPS, SHORTEST

SAME_TIME = 1e-9
"""Fraction of a step. A shorter remainder before a corner is rounding of the division, not a step."""

ROUNDING = 1e-12
"""Fraction of a time. An end of a step that is no nearer to it is the next one."""


def require_duration(duration: float, step: float, name: str = "duration") -> None:
    """Refuse the length of an interval [s] if it is no time, or too short or too long for steps of this length [s]."""
    require_number(name, duration, "s")
    if not SHORTEST * step <= duration <= MAX_STEPS * step:
        raise ValueError(
            f"{name} must be from {SHORTEST * step:.4g} to {MAX_STEPS * step:.4g} s, with steps of {step:.4g} s, not "
            f"{duration:.4g} s."
        )


def step_times(corners: Sequence[float], step: float) -> np.ndarray:
    """Ends of the time steps [s] from the first corner to the last, shape (n_steps + 1,).

    All steps have the length `step` [s], except that the last one before a corner is shortened, since no step may
    straddle a corner. The ramp of Fig. 13.5b has its corners at 0, 0.1 and 1.0 s.
    """
    times = [np.array([corners[0]])]
    for begin, end in pairwise(corners):
        n_whole = int(np.floor((end - begin) / step + SAME_TIME))
        whole = begin + step * np.arange(1, n_whole + 1)
        if n_whole and end - whole[-1] <= SAME_TIME * step:
            whole = whole[:-1]
        times += [whole, np.array([end])]
    return np.concatenate(times)


def interval_times(corners: Sequence[float], step: float, begin: float, duration: float) -> np.ndarray:
    """Ends of the time steps [s] of an interval, from `begin` to begin + duration, shape (n_steps + 1,).

    They are those of `step_times` since the first corner, so that an interval in pieces has the steps of the whole,
    save that a step in which a piece ends is cut in two. What differs by rounding is one time.

    corners: Increasing times [s]; the first is not later than `begin`.
    """
    end, same = begin + duration, SAME_TIME * step
    end = max((corner for corner in corners if abs(corner - end) <= same), default=end)
    times = step_times([*(corner for corner in corners if corner < end), end], step)
    first = int(np.searchsorted(times, begin + same, side="right"))
    on_grid = begin - times[first - 1] <= same
    return times[first - 1 :] if on_grid else np.append(begin, times[first:])


def ends_of_parts(times: np.ndarray, parts: int) -> np.ndarray:
    """Steps with which about equal parts of an interval end, whose steps end at these times [s] since it began."""
    return ends_at(times, times[-1] * np.arange(1, parts + 1) / parts)


def ends_at(times: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Steps at whose ends these times [s] are first reached; other arguments as of `ends_of_parts`."""
    return np.unique(np.clip(np.searchsorted(times, wanted * (1.0 - ROUNDING)), 1, len(times) - 1))
