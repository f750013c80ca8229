"""The kernels as plain Python, beside the compiled ones: to be called one by one, stepped through, counted.

    potential, c_speed, c_over_speed = drag_slopes.plain(Lanes(0.3), Lanes(wx), Lanes(wy))

The modules of `der` are loaded a second time, on numpy_lanes.py and without a compiler.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from seastar_gym.simd import numpy_lanes
from seastar_gym.simd.modules import COMPILATION, FOLDER, LANES, KernelModules, made_module
from seastar_gym.simd.width import N_LANES


class PlainKernels(KernelModules):
    """The kernels once more, as plain functions.

    n_lanes: Number of robots in a row of memory. folder: Source of `der`. functions: Replacements for functions of the
    interface that numpy_lanes.py describes, by name.
    """

    def __init__(self, n_lanes: int = N_LANES, folder: Path = FOLDER, **functions: Callable):
        interface = {name: getattr(numpy_lanes, name) for name in numpy_lanes.FUNCTIONS} | functions
        quiet = np.errstate(all="ignore")  # as machine code is where it divides by zero
        lanes = made_module(LANES, N_LANES=n_lanes, WIDTH=n_lanes, **interface)
        decorators = made_module(COMPILATION, kernel=_itself, inlined_kernel=_itself, entry_point=quiet)
        super().__init__({LANES: lanes, COMPILATION: decorators}, folder)


def _itself(function: Callable) -> Callable:
    return function


@cache
def plain_kernels() -> PlainKernels:
    """The kernels on N_LANES robots, loaded when first asked for."""
    return PlainKernels()
