"""What a swim leaves of each time step for `replay.py`, which differentiates it: where it began, and its solutions.

`advance` of rods/interval.py at the form `KEPT` leaves it, to the same bits and on the lanes of `Simulator`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import (
    N_LANES,
    Form,
    any_lane,
    load,
    load_number,
    registers,
    select,
    splat,
    store,
    store_number,
)
from seastar_gym.rods.guard import come_to_rest, correct_momentum
from seastar_gym.rods.interval import FALLBACK_AFTER, cover_interval
from seastar_gym.rods.newton import minimise
from seastar_gym.rods.step import try_step

INTERVAL, START, SIZE, LIMIT, RETRYING, FALLBACK, OF_STEP = range(7)
"""Numbers of a step: that of its interval between two times, its beginning and its length as shares of that, its
iteration limit, and whether it was retried or taken by the fallback. Behind them stand q, v and a at its beginning and,
stage by stage, OF_STAGE numbers and the solution q."""
PHI, SETBACKS, OF_STAGE = range(3)
"""Numbers of a stage: Phi before its last Newton step, and how many of its steps were shortened or regularised."""
N_STEPS, CAPACITY, STAGE, NOW, COUNTERS = range(5)
"""Whole numbers of a history: steps that it has, and room for; stage and interval at hand."""


class Kept(NamedTuple):
    """History of the first robot of a lane group.

    counters: Whole numbers, see above. rows, numbers: Memory of the step at hand, shape (n_rows, N_LANES), and the same
    memory in one row. steps: Numbers of all steps, one after the other, n_rows each. n_q, n_a: Rows of q, as many of v,
    and of a.
    """

    counters: NDArray[np.float64]
    rows: NDArray[np.float64]
    numbers: NDArray[np.float64]
    steps: NDArray[np.float64]
    n_rows: int
    n_q: int
    n_a: int


def n_numbers(n_q: int, n_a: int, n_stages: int, n_points: int) -> int:
    """Numbers of a step with these numbers of rows of q and a, of stages, and of points of the rods."""
    return OF_STEP + 2 * n_q + n_a + n_stages * (OF_STAGE + 2 * n_points)


@kernel
def try_and_keep(rods, work, scheme, actuation, q, v, a, step, active, limits, report):
    """try_step, which leaves in work.kept where it began and, once it is accepted, all of it."""
    kept = work.kept
    for row in range(kept.n_q):
        store(kept.rows, OF_STEP + row, load(q, row))
        store(kept.rows, OF_STEP + kept.n_q + row, load(v, row))
    for row in range(kept.n_a):
        store(kept.rows, OF_STEP + 2 * kept.n_q + row, load(a, row))
    store(kept.rows, INTERVAL, splat(load_number(kept.counters, NOW)))
    store(kept.rows, START, step.start)
    store(kept.rows, SIZE, step.size)
    store(kept.rows, LIMIT, step.iteration_limit)
    store(kept.rows, RETRYING, select(step.retrying, splat(1.0), splat(0.0)))
    of_fallback = step.iteration_limit > FALLBACK_AFTER * limits.max_iterations
    store(kept.rows, FALLBACK, select(of_fallback, splat(1.0), splat(0.0)))
    store_number(kept.counters, STAGE, 0.0)
    accepted = try_step(rods, work, scheme, actuation, q, v, a, step, active, limits, report)
    n = load_number(kept.counters, N_STEPS)
    if any_lane(accepted) and n < load_number(kept.counters, CAPACITY):
        for row in range(kept.n_rows):
            store_number(kept.steps, int(n) * kept.n_rows + row, load_number(kept.numbers, row * N_LANES))
        store_number(kept.counters, N_STEPS, n + 1.0)
    return accepted


@kernel
def row_of_stage(rods, kept):
    """First row of the stage at hand."""
    k = int(load_number(kept.counters, STAGE))
    return OF_STEP + 2 * kept.n_q + kept.n_a + k * (OF_STAGE + 2 * rods.n_points)


@kernel
def minimise_and_keep(rods, work, stage, active, tolerance, iteration_limit):
    """minimise, which leaves in work.kept what it has found, but for the solution."""
    found = minimise(rods, work, stage, active, tolerance, iteration_limit)
    row = row_of_stage(rods, work.kept)
    store(work.kept.rows, row + PHI, found[1])
    store(work.kept.rows, row + SETBACKS, found[3] + found[4])
    return found


@kernel
def correct_and_keep(rods, work, scheme, k, stage, q_0, v_0, h, robots):
    """correct_momentum, which leaves the solution in work.kept."""
    correct_momentum(rods, work, scheme, k, stage, q_0, v_0, h, robots)
    row = row_of_stage(rods, work.kept) + OF_STAGE
    for coordinate in range(2 * rods.n_points):
        store(work.kept.rows, row + coordinate, load(work.q, coordinate))
    store_number(work.kept.counters, STAGE, load_number(work.kept.counters, STAGE) + 1.0)


@kernel
def cover_and_count(rods, work, scheme, fallback, actuation, q, v, a, duration, alive, limits, report):
    """cover_interval, which leaves in work.kept how many intervals are behind."""
    alive = cover_interval(rods, work, scheme, fallback, actuation, q, v, a, duration, alive, limits, report)
    store_number(work.kept.counters, NOW, load_number(work.kept.counters, NOW) + 1.0)
    return alive


@kernel
def stay_stuck(rods, work, q, v, robots):
    """In place of come_to_rest: nobody does, as no derivative leads through it, and the robot has failed."""
    return robots & ~robots


KEPT = Form("kept", registers, instead={
    cover_interval: cover_and_count, try_step: try_and_keep, minimise: minimise_and_keep,
    correct_momentum: correct_and_keep, come_to_rest: stay_stuck,
})  # fmt: skip
"""Rows of `Simulator` whose steps leave what they began with and what they found in a field `kept` of `work`."""
