"""Reverse differentiation of a swim: its time steps once more, from the last to the first, on a tape.

A step is replayed from what history.py has kept of it, on the lanes of simd/tape_lanes.py. Newton's solution of a stage
is read instead of found, and is differentiated as solved exactly, as in implicit.py: q becomes q - H^-1 g, q and H
constant, so no second slope is on the tape. The tape of H^-1 g holds the elimination of the star, so that reading it
from its end is the transposed solution. What steps leave for each other (q, v and a) takes derivatives from each step
to the one before.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba.core.compiler_lock import global_compiler_lock
from numpy.typing import NDArray

from seastar_gym.der import potential
from seastar_gym.der.body.body import carry_roots, gather_roots, move_roots, place_roots
from seastar_gym.der.contact.contact import PRESSED, SLOT_ROWS, add_gap_gradient, gap, n_listed
from seastar_gym.der.contact.coupled import solve_again_coupled
from seastar_gym.der.energy import fill_moments
from seastar_gym.der.linear import rigid_hub, star_matrix
from seastar_gym.der.linear.star_matrix import eliminate_node, eliminate_root, store_root
from seastar_gym.der.linear.star_solution import solve_again, substitute_star
from seastar_gym.der.potential import factorise
from seastar_gym.der.stepping import steps
from seastar_gym.der.stepping.momentum import correct_momentum
from seastar_gym.der.stepping.steps import Step, try_step
from seastar_gym.gradients.history import (
    FALLBACK,
    INTERVAL,
    LIMIT,
    OF_STAGE,
    OF_STEP,
    PHI,
    RETRYING,
    SETBACKS,
    SIZE,
    START,
)
from seastar_gym.simd import compilation, tape_lanes
from seastar_gym.simd.compilation import entry_point, kernel
from seastar_gym.simd.lanes import any_lane, borrow, load, load_number, splat, store, store_number, subtract_product
from seastar_gym.simd.modules import COMPILATION, LANES, KernelModules
from seastar_gym.simd.tape_lanes import (
    begin_tape,
    constant,
    end_of_tape,
    less_step,
    pause_tape,
    resume_tape,
    tape_is_full,
)


@kernel
def read_solution(rods, work, stage, active, tolerance, iteration_limit):
    """What minimise has found in the stage at hand, from work.solution: a number for the stage, then what was kept."""
    k, n = int(load_number(work.solution, 0)), 2 * rods.n_points
    row = 1 + k * (OF_STAGE + n)
    for coordinate in range(n):
        store(work.q, coordinate, load_number(work.solution, row + OF_STAGE + coordinate))
    store_number(work.solution, 0, k + 1.0)
    phi, setbacks = load_number(work.solution, row + PHI), load_number(work.solution, row + SETBACKS)
    return active, splat(phi), splat(0.0), splat(setbacks), splat(0.0)


@kernel
def correct_on_tape(rods, work, scheme, k, stage, q_0, v_0, h, robots):
    """Settle the momentum, see momentum.py, and put the solution of stage k of a step on the tape."""
    pause_tape()
    correct_momentum(rods, work, scheme, k, stage, q_0, v_0, h, robots)
    resume_tape()
    factorise(rods, work, stage, None)
    substitute_star(rods, work, work.step)
    solve_contact(rods, work)
    for row in range(2 * rods.n_nodes):
        store(work.q, row, less_step(load(work.q, row), load(work.step, row)))
    if rods.body is not None:
        row = 2 * rods.n_nodes
        arc = load(rods.body.scale, 0) * load(work.step, row)
        store(work.q, row, less_step(load(work.q, row), arc))
    place_roots(rods, work.q)


@kernel
def solve_contact(rods, work):
    """From x = H^-1 g of the star, in work.step, to the solution with contact's part of the Hessian, see coupled.py.

    That is x - sum over the pairs of (H + C K C^T)^-1 c k (c x), c the gradient of a pair's gap: on the tape c x alone.
    """
    if work.contact is None or n_listed(work) == 0:
        return
    if not any_lane(load(work.contact.touching, 0) > 0.0):
        return
    rows, star, x, c = 2 * rods.n_free, work.contact.x, work.contact.ends, work.contact.seen
    carry_roots(rods, work, work.step)
    for row in range(2 * rods.n_points):
        store(star, row, load(work.step, row))
        store(x, row, load(work.step, row))
    for slot in range(n_listed(work)):
        k = load(work.contact.slots, SLOT_ROWS * slot + PRESSED)
        if any_lane(k > 0.0):
            y = k * gap(rods, work, slot, star)
            pause_tape()
            for row in range(2 * rods.n_points):
                store(c, row, 0.0)
            add_gap_gradient(rods, work, slot, splat(1.0), c)
            gather_roots(rods, work, c)
            solve_again(rods, work, c, work.step)
            solve_again_coupled(rods, work, work.step)
            resume_tape()
            for row in range(rows):
                store(x, row, subtract_product(load(x, row), y, load(work.step, row)))
    for row in range(rows):
        store(work.step, row, load(x, row))


@kernel
def replay_step(rods, work, scheme, fallback, actuation, q, v, a, numbers, h, limits, report):
    """Take the step of these numbers (see history.py) again; returns whether it was accepted, as it was then."""
    everybody = splat(0.0) < 1.0
    retrying = everybody & (splat(load_number(numbers, RETRYING)) > 0.0)
    size = load_number(numbers, SIZE)
    limit = splat(load_number(numbers, LIMIT))
    step = Step(splat(load_number(numbers, START)), splat(size), splat(h), limit, retrying)
    tableau = scheme
    if load_number(numbers, FALLBACK) > 0.0:
        tableau = fallback
    _, accepted, _ = try_step(rods, work, tableau, actuation, q, v, a, step, everybody, limits, report)
    return any_lane(accepted)


@kernel
def moments_on_tape(rods, work, actuation, q, moments):
    """What resists the actuators [N m], see energy.py."""
    fill_moments(rods, work, actuation, q, moments)


@kernel
def roots_on_tape(rods, q, v):
    """Put roots of limbs on a body where hub and angle say."""
    move_roots(rods, q, v)


@kernel
def constant_block(block):
    return constant(block[0]), constant(block[1]), constant(block[2])


@kernel
def constant_coupling(block):
    return constant(block[0]), constant(block[1]), constant(block[2]), constant(block[3])


@kernel
def eliminate_right_hand_side(work, node, D, B, C, r, D_1, B_1, D_2, r_1, r_2):
    """eliminate_node, with a matrix of constants."""
    return eliminate_node(
        work, node, constant_block(D), constant_coupling(B), constant_coupling(C), r, constant_block(D_1),
        constant_coupling(B_1), constant_block(D_2), r_1, r_2,
    )  # fmt: skip


@kernel
def eliminate_root_of_constants(
    work, root, D, N, E, H, r, D_next, H_next, r_next, D_last, H_last, r_last, D_hub, r_hub
):
    """eliminate_root, with a matrix of constants."""
    return eliminate_root(
        work, root, constant_block(D), constant_coupling(N), constant_coupling(E), constant_coupling(H), r,
        constant_block(D_next), constant_coupling(H_next), r_next, constant_block(D_last), constant_coupling(H_last),
        r_last, constant_block(D_hub), r_hub,
    )  # fmt: skip


@kernel
def store_root_of_constants(work, limb, D, H, r):
    """store_root, with a matrix of constants."""
    store_root(work, limb, constant_block(D), constant_coupling(H), r)


class TapeKernels(KernelModules):
    """The kernels on a tape. Stages read what Newton's method has found, and put their solution on the tape."""

    def __init__(self) -> None:
        super().__init__({LANES: tape_lanes, COMPILATION: compilation})
        instead = {
            "minimise": self(read_solution),
            "correct_momentum": self(correct_on_tape),
            "eliminate_node": self(eliminate_right_hand_side),
            "eliminate_root": self(eliminate_root_of_constants),
            "store_root": self(store_root_of_constants),
        }
        for module in (steps, potential, star_matrix, rigid_hub):
            names = vars(self._module_of(module.__name__))
            names.update({name: own for name, own in instead.items() if name in names})


replay_step_on_tape: Any = None
fill_moments_on_tape: Any = None
move_roots_on_tape: Any = None
"""Kernels on a tape, once somebody has asked for them."""


@kernel
def read_tape(entries, parents, slopes, first, end):
    """Take the slopes of what is on the tape to what stands at places below `first`, and leave zeros behind."""
    for place in range(end - 1, first - 1, -1):
        slope = slopes[place]
        if slope != 0.0:
            slopes[place] = 0.0
            slopes[parents[place, 0]] += entries[place, 1] * slope
            slopes[parents[place, 1]] += entries[place, 2] * slope
    slopes[0] = 0.0


class Rows(NamedTuple):
    """Rows on a tape: q, v, a, the limbs' rotations at both ends of an interval, and moments, shape (.., 2) each.

    Or the same memory as whole numbers.
    """

    q: NDArray[Any]
    v: NDArray[Any]
    a: NDArray[Any]
    start: NDArray[Any]
    end: NDArray[Any]
    moments: NDArray[Any]


class Tape(NamedTuple):
    """Memory of a tape.

    entries, parents: Its entries, and the same memory as int32. slopes: Those of all places.
    first: Place of q; v, a and rotations stand behind it, coefficients before it, whose slopes are added up.
    """

    entries: NDArray[np.float64]
    parents: NDArray[np.int32]
    slopes: NDArray[np.float64]
    first: int


class Slopes(NamedTuple):
    """Slopes in q, v and a, in rotations, shape (n_intervals + 1, n_limbs), and in the actuators' work."""

    q: NDArray[np.float64]
    v: NDArray[np.float64]
    a: NDArray[np.float64]
    shape: NDArray[np.float64]
    work: float


@kernel
def put_rows(rows, places, numbers, begin, first):
    """Put numbers from `begin` on into rows, as what stands on the tape from place `first` on.

    Returns the place behind them.
    """
    for row in range(rows.shape[0]):
        rows[row, 0] = numbers[begin + row]
        places[row, 1] = first + row
    return first + rows.shape[0]


@kernel
def put_state(rows, places, step, first):
    """Put q, v and a at the beginning of a step on the tape, see put_rows."""
    n_q = rows.q.shape[0]
    behind = put_rows(rows.q, places.q, step, OF_STEP, first)
    behind = put_rows(rows.v, places.v, step, OF_STEP + n_q, behind)
    return put_rows(rows.a, places.a, step, OF_STEP + 2 * n_q, behind)


@kernel
def seed(tape, places, of_rows):
    """Give what stands in rows its slopes."""
    for row in range(places.shape[0]):
        tape.slopes[places[row, 1]] += of_rows[row]
        of_rows[row] = 0.0


@kernel
def take_slopes(tape, first, of_rows):
    """Move the slopes from place `first` on to those of rows; returns the place behind them."""
    for row in range(of_rows.shape[0]):
        of_rows[row] += tape.slopes[first + row]
        tape.slopes[first + row] = 0.0
    return first + of_rows.shape[0]


@kernel
def pull_through_step(scene, tape, rows, places, step, h, start, end, of, k):
    """Take slopes through a step of interval k, of length h [s]. start, end: Rotations at both ends of the interval.

    Returns 0; 1 if the tape is too short, 2 if the step was not the one that was kept.
    """
    rods, work, scheme, fallback, actuation, limits, report = scene
    at_start = put_state(rows, places, step, tape.first)
    behind = put_rows(rows.end, places.end, end, 0, put_rows(rows.start, places.start, start, 0, at_start))
    begin = OF_STEP + 2 * rows.q.shape[0] + rows.a.shape[0]
    work.solution[0] = 0.0
    for row in range(step.shape[0] - begin):
        work.solution[1 + row] = step[begin + row]
    report[:] = 0.0
    begin_tape(tape.entries, behind)
    same = replay_step_on_tape(
        borrow(rods), borrow(work), borrow(scheme), borrow(fallback), borrow(actuation), borrow(rows.q),
        borrow(rows.v), borrow(rows.a), borrow(step), h, borrow(limits), borrow(report),
    )  # fmt: skip
    if tape_is_full() != 0:
        return 1
    if not same:
        return 2
    seed(tape, places.q, of.q)
    seed(tape, places.v, of.v)
    seed(tape, places.a, of.a)
    read_tape(tape.entries, tape.parents, tape.slopes, behind, end_of_tape())
    at_a = take_slopes(tape, take_slopes(tape, tape.first, of.q), of.v)
    at_end = take_slopes(tape, take_slopes(tape, at_a, of.a), of.shape[k])
    take_slopes(tape, at_end, of.shape[k + 1])
    return 0


@kernel
def pull_through_work(scene, tape, rows, places, step, shape, of, k):
    """Take the slope in work to the state where interval k begins; returns 0, or 1 if the tape is too short.

    The work is the sum of (m_k + m_k+1)(shape_k+1 - shape_k)/2, m the moments where intervals begin and end.
    """
    rods, work, _, _, actuation, _, _ = scene
    at_start = put_rows(rows.q, places.q, step, OF_STEP, tape.first)
    at_end = put_rows(rows.start, places.start, shape[k], 0, at_start)
    behind = put_rows(rows.end, places.end, shape[k], 0, at_end)
    begin_tape(tape.entries, behind)
    fill_moments_on_tape(borrow(rods), borrow(work), borrow(actuation), borrow(rows.q), borrow(rows.moments))
    if tape_is_full() != 0:
        return 1
    for limb in range(shape.shape[1]):
        half = 0.5 * of.work * rows.moments[limb, 0]
        for other in (k, k - 1):  # the intervals that begin and that end here
            if 0 <= other < shape.shape[0] - 1:
                turned = shape[other + 1, limb] - shape[other, limb]
                tape.slopes[places.moments[limb, 1]] += 0.5 * of.work * turned
                of.shape[other + 1, limb] += half
                of.shape[other, limb] -= half
    read_tape(tape.entries, tape.parents, tape.slopes, behind, end_of_tape())
    take_slopes(tape, tape.first, of.q)
    take_slopes(tape, at_start, of.shape[k])
    take_slopes(tape, at_end, of.shape[k])
    return 0


@kernel
def pull_through_roots(scene, tape, rows, places, step, of):
    """Take slopes through what puts roots of limbs on a body before the first step."""
    behind = put_state(rows, places, step, tape.first)
    begin_tape(tape.entries, behind)
    move_roots_on_tape(borrow(scene[0]), borrow(rows.q), borrow(rows.v))
    seed(tape, places.q, of.q)
    seed(tape, places.v, of.v)
    read_tape(tape.entries, tape.parents, tape.slopes, behind, end_of_tape())
    take_slopes(tape, take_slopes(tape, tape.first, of.q), of.v)


@entry_point
def _pull_back(scene, tape, rows, places, kept, times, shape, of):
    """Take slopes at the end of a swim through some intervals to its beginning, in place.

    scene: rods, work, scheme, fallback, actuation, limits and report, on a tape.
    kept: What history.py has kept of every step, shape (n_steps + 1, n_rows); the last begins where the swim ended.
    times, shape: Ends of the intervals [s], shape (n + 1,), and rotations then [rad], shape (n + 1, n_limbs).
    of: Slopes at the end, then at the beginning; those in rotations are added to.

    Returns 0; 1 if the tape is too short, 2 if a step was not the one that was kept.
    """
    last = kept.shape[0] - 1
    for n in range(last, -1, -1):
        step, outcome = kept[n], 0
        k = int(step[INTERVAL])
        if n < last:
            h = step[SIZE] * (times[k + 1] - times[k])
            outcome = pull_through_step(scene, tape, rows, places, step, h, shape[k], shape[k + 1], of, k)
        if outcome == 0 and of.work != 0.0 and (n == 0 or kept[n - 1, INTERVAL] != k):
            outcome = pull_through_work(scene, tape, rows, places, step, shape, of, k)
        if outcome != 0:
            return outcome
    pull_through_roots(scene, tape, rows, places, kept[0], of)
    return 0


@global_compiler_lock
@cache
def pulling_back() -> Callable[..., int]:
    """The entry point."""
    kernels = TapeKernels()
    globals()["replay_step_on_tape"] = kernels(replay_step)
    globals()["fill_moments_on_tape"] = kernels(moments_on_tape)
    globals()["move_roots_on_tape"] = kernels(roots_on_tape)
    return _pull_back
