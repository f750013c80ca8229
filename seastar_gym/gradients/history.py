"""What a swim leaves of each time step for `replay.py`, which differentiates it: where it began, and its solutions.

`swim_and_keep` advances as `advance` of der/stepping/stroke.py does, to the same bits, on the lanes of `Simulator`.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba.core.compiler_lock import global_compiler_lock
from numpy.typing import NDArray

from seastar_gym.der.body.body import move_roots
from seastar_gym.der.stepping import interval, steps
from seastar_gym.der.stepping.interval import FALLBACK_AFTER, cover_interval
from seastar_gym.der.stepping.newton import minimise
from seastar_gym.der.stepping.steps import try_step
from seastar_gym.der.stepping.stroke import shape_of_limb
from seastar_gym.simd import compilation, lanes
from seastar_gym.simd.compilation import entry_point, kernel
from seastar_gym.simd.lanes import any_lane, borrow, load, load_number, select, splat, store, store_number
from seastar_gym.simd.modules import COMPILATION, LANES, KernelModules

INTERVAL, START, SIZE, LIMIT, RETRYING, FALLBACK, OF_STEP = range(7)
"""Rows of a step: number of its interval between two times, its beginning and its length as shares of that, its
iteration limit, and whether it was retried or taken by the fallback. Behind them stand q, v and a at its beginning and,
stage by stage, OF_STAGE rows and the solution q."""
PHI, SETBACKS, OF_STAGE = range(3)
"""Rows of a stage: Phi before its last Newton step, and how many of its steps were shortened or regularised."""
N_STEPS, CAPACITY, STAGE, NOW, COUNTERS = range(5)
"""Whole numbers of a history: steps that it has, and room for; stage and interval at hand."""


class Kept(NamedTuple):
    """History of a lane group.

    counters: Whole numbers, see above. rows: Of all steps, n_rows each. n_q, n_a: Rows of q, as many of v, and of a.
    """

    counters: NDArray[np.float64]
    rows: NDArray[np.float64]
    n_rows: int
    n_q: int
    n_a: int


def n_numbers(n_q: int, n_a: int, n_stages: int, n_points: int) -> int:
    """Numbers of a step with these numbers of rows of q and a, of stages, and of points of the rods."""
    return OF_STEP + 2 * n_q + n_a + n_stages * (OF_STAGE + 2 * n_points)


@kernel
def keep(kept, row, value):
    """Keep a number of the step at hand."""
    store(kept.rows, int(load_number(kept.counters, N_STEPS)) * kept.n_rows + row, value)


@kernel
def try_and_keep(rods, work, scheme, actuation, q, v, a, step, active, limits, report):
    """try_step, which leaves in work.kept where it began."""
    kept = work.kept
    for row in range(kept.n_q):
        keep(kept, OF_STEP + row, load(q, row))
        keep(kept, OF_STEP + kept.n_q + row, load(v, row))
    for row in range(kept.n_a):
        keep(kept, OF_STEP + 2 * kept.n_q + row, load(a, row))
    keep(kept, INTERVAL, splat(load_number(kept.counters, NOW)))
    keep(kept, START, step.start)
    keep(kept, SIZE, step.size)
    keep(kept, LIMIT, step.iteration_limit)
    keep(kept, RETRYING, select(step.retrying, splat(1.0), splat(0.0)))
    of_fallback = step.iteration_limit > FALLBACK_AFTER * limits.max_iterations
    keep(kept, FALLBACK, select(of_fallback, splat(1.0), splat(0.0)))
    store_number(kept.counters, STAGE, 0.0)
    good, accepted, error_rate = try_step(rods, work, scheme, actuation, q, v, a, step, active, limits, report)
    n = load_number(kept.counters, N_STEPS)
    if any_lane(accepted) and n < load_number(kept.counters, CAPACITY):
        store_number(kept.counters, N_STEPS, n + 1.0)
    return good, accepted, error_rate


@kernel
def minimise_and_keep(rods, work, stage, active, tolerance, iteration_limit):
    """minimise, which leaves in work.kept what it has found."""
    found = minimise(rods, work, stage, active, tolerance, iteration_limit)
    kept, n_solution = work.kept, 2 * rods.n_points
    k = int(load_number(kept.counters, STAGE))
    row = OF_STEP + 2 * kept.n_q + kept.n_a + k * (OF_STAGE + n_solution)
    keep(kept, row + PHI, found[1])
    keep(kept, row + SETBACKS, found[3] + found[4])
    for coordinate in range(n_solution):
        keep(kept, row + OF_STAGE + coordinate, load(work.q, coordinate))
    store_number(kept.counters, STAGE, k + 1.0)
    return found


@kernel
def swim_and_keep(rods, work, scheme, fallback, actuation, q, v, a, times, n_intervals, shape, limits, report):
    """Advance a lane group through the intervals between `times`, see `advance` of der/stepping/stroke.py."""
    move_roots(rods, q, v)
    alive = splat(0.0) < 1.0
    for k in range(n_intervals):
        for limb in range(rods.n_limbs):
            store(actuation.delta_psi_start, limb, splat(1.0) * shape_of_limb(shape, rods.n_limbs, k, limb))
            store(actuation.delta_psi_end, limb, splat(1.0) * shape_of_limb(shape, rods.n_limbs, k + 1, limb))
        store_number(work.kept.counters, NOW, float(k))
        duration = load_number(times, k + 1) - load_number(times, k)
        alive = cover_interval(rods, work, scheme, fallback, actuation, q, v, a, duration, alive, limits, report)


class KeepingKernels(KernelModules):
    """The kernels on the lanes of `Simulator`, whose steps leave what they began with and what they found."""

    def __init__(self) -> None:
        super().__init__({LANES: lanes, COMPILATION: compilation})
        vars(self._module_of(interval.__name__))["try_step"] = self(try_and_keep)
        vars(self._module_of(steps.__name__))["minimise"] = self(minimise_and_keep)


swim_on_keeping_lanes: Any = None
"""`swim_and_keep` with kernels that keep, once somebody has asked for it."""


@entry_point
def _swim_and_keep(rods, work, scheme, fallback, actuation, q, v, a, times, shape, limits, report):
    swim_on_keeping_lanes(  # there when it is compiled
        borrow(rods), borrow(work), borrow(scheme), borrow(fallback), borrow(actuation), borrow(q), borrow(v),
        borrow(a), borrow(times), times.shape[0] - 1, borrow(shape), borrow(limits), borrow(report),
    )  # fmt: skip


@global_compiler_lock
@cache
def keeping_swim() -> Callable[..., None]:
    """The entry point; `work` has a history in its field `kept`."""
    globals()["swim_on_keeping_lanes"] = KeepingKernels()(swim_and_keep)
    return _swim_and_keep
