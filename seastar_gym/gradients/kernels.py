"""The kernels of a swim once more, on dual lanes: `advance_slopes` does what `advance` of der/stepping/stroke.py does.

Rows of memory that robots do not share hold N_LANES numbers and as many slopes. Everything is compiled when it is first
asked for, and kept on disk.
"""

from collections.abc import Callable
from functools import cache

from numba.core import config
from numba.core.compiler_lock import global_compiler_lock

from seastar_gym.der.stepping.steps import solve_stages
from seastar_gym.der.stepping.stroke import advance
from seastar_gym.gradients.implicit import correct_slopes
from seastar_gym.simd import compilation, dual_lanes
from seastar_gym.simd.compilation import entry_point, kernel
from seastar_gym.simd.modules import COMPILATION, LANES, KernelModules

groups_on_dual_lanes: Callable[..., None]
"""`advance` on dual lanes, once somebody has asked for it."""


class DualKernels(KernelModules):
    """The kernels on dual lanes. Where stages correct their momentum they correct their slopes as well."""

    def __init__(self) -> None:
        super().__init__({LANES: dual_lanes, COMPILATION: compilation})
        vars(self._module_of(solve_stages.__module__))["correct_momentum"] = self(correct_slopes)


@entry_point
def _with_slopes(
    rods, work, scheme, fallback, actuation, q, v, a, peaks, times, shape, n_turning, failed, report, limits, effort
):  # fmt: skip
    groups_on_dual_lanes(  # noqa: F821 - there when it is compiled
        rods, work, scheme, fallback, actuation, q, v, a, peaks, times, shape, n_turning, failed, report, limits, effort
    )  # fmt: skip


@global_compiler_lock
@cache
def advance_slopes() -> Callable[..., None]:
    """The entry point; its arguments are those of `advance`, with rows of 2 N_LANES numbers."""
    if config.DISABLE_JIT:
        raise RuntimeError("With NUMBA_DISABLE_JIT=1 nothing is compiled, and swims have no derivatives.")
    # The twin's own entry point would find the code of `advance` on disk, whose arguments have the same types.
    globals()["groups_on_dual_lanes"] = kernel(DualKernels()(advance).py_func)
    return _with_slopes
