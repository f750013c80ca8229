"""Time steps of a stroke."""

from itertools import pairwise

import numpy as np

SAME_TIME = 1e-9
"""Fraction of a step. A shorter remainder before a corner is rounding of the division, not a step."""


def step_times(corners: tuple[float, ...], step: float) -> np.ndarray:
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
