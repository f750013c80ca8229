"""Reverse differentiation of a swim: its time steps once more, from the last to the first, on a tape.

A step is replayed from what history.py has kept of it, on the lanes of simd/tape_lanes.py. Newton's solution of a stage
is read instead of found, and is differentiated as solved exactly, as in implicit.py: q becomes q - H^-1 g, q and H
constant, so no second slope is on the tape. The tape of H^-1 g holds the elimination of the star, so that reading it
from its end is the transposed solution. What steps leave for each other (q, v and a) takes derivatives from each step
to the one before.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

from numba.core.compiler_lock import global_compiler_lock

from seastar_gym.der import potential
from seastar_gym.der.body.body import move_roots, place_roots
from seastar_gym.der.energy import fill_moments
from seastar_gym.der.linear import rigid_hub, star_matrix
from seastar_gym.der.linear.star_matrix import eliminate_node, eliminate_root, store_root
from seastar_gym.der.linear.star_solution import substitute_star
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
from seastar_gym.simd.lanes import any_lane, borrow, load, load_number, splat, store, store_number
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
    for row in range(2 * rods.n_nodes):
        store(work.q, row, less_step(load(work.q, row), load(work.step, row)))
    if rods.body is not None:
        row = 2 * rods.n_nodes
        arc = load(rods.body.scale, 0) * load(work.step, row)
        store(work.q, row, less_step(load(work.q, row), arc))
    place_roots(rods, work.q)


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


@kernel
def put_rows(rows, places, numbers, begin, first):
    """Put numbers from `begin` on into rows, as what stands on the tape from place `first` on."""
    for row in range(rows.shape[0]):
        rows[row, 0] = numbers[begin + row]
        places[row, 1] = first + row


@kernel
def seed(slopes, places, of_rows):
    for row in range(places.shape[0]):
        slopes[places[row, 1]] += of_rows[row]


@kernel
def take_slopes(slopes, first, of_rows):
    """Move the slopes from place `first` on to rows."""
    for row in range(of_rows.shape[0]):
        of_rows[row] = slopes[first + row]
        slopes[first + row] = 0.0


@entry_point
def _pull_back(
    rods, work, scheme, fallback, actuation, limits, report, rows, places, kept, times, shape, of_work, entries,
    parents, slopes, first, of_q, of_v, of_a, of_shape,
):  # fmt: skip
    """Take slopes at the end of a swim through some intervals to its beginning, in place: to those in the state, in the
    rotations of limbs and, added up, in coefficients.

    rows, places: q, v, a, both rotations of an interval and moments, shape (.., 2) each, and the same memory as whole
        numbers.
    kept: What history.py has kept of every step, shape (n_steps + 1, n_rows); the last begins where the swim ended.
    times, shape: Ends of the intervals [s], shape (n + 1,), and rotations then [rad], shape (n + 1, n_limbs).
    of_work: Slope in the actuators' work in these intervals.
    entries, parents: Memory of the tape, and the same as int32. slopes: Those of all places.
    first: Place of q; coefficients stand before it, and their slopes are added up.
    of_q, of_v, of_a: Slopes in the state at the end, then at the beginning. of_shape: Those in `shape`, added to.

    Returns 0; 1 if the tape is too short, 2 if a step was not the one that was kept.
    """
    q, v, a, start, end, moments = rows
    q_places, v_places, a_places, start_places, end_places, moment_places = places
    n_q, n_a, n_limbs = q.shape[0], a.shape[0], start.shape[0]
    at_v, at_a, at_start = first + n_q, first + 2 * n_q, first + 2 * n_q + n_a
    at_end = at_start + n_limbs
    behind = at_end + n_limbs
    numbers, n_intervals = kept.shape[1], times.shape[0] - 1
    for n in range(kept.shape[0] - 1, -1, -1):
        step = kept[n]
        k = int(step[INTERVAL])
        if n < kept.shape[0] - 1:
            put_rows(q, q_places, step, OF_STEP, first)
            put_rows(v, v_places, step, OF_STEP + n_q, at_v)
            put_rows(a, a_places, step, OF_STEP + 2 * n_q, at_a)
            put_rows(start, start_places, shape[k], 0, at_start)
            put_rows(end, end_places, shape[k + 1], 0, at_end)
            work.solution[0] = 0.0
            begin = OF_STEP + 2 * n_q + n_a
            for row in range(numbers - begin):
                work.solution[1 + row] = step[begin + row]
            report[:] = 0.0
            begin_tape(entries, behind)
            h = step[SIZE] * (times[k + 1] - times[k])
            same = replay_step_on_tape(
                borrow(rods), borrow(work), borrow(scheme), borrow(fallback), borrow(actuation), borrow(q), borrow(v),
                borrow(a), borrow(step), h, borrow(limits), borrow(report),
            )  # fmt: skip
            if tape_is_full() != 0:
                return 1
            if not same:
                return 2
            seed(slopes, q_places, of_q)
            seed(slopes, v_places, of_v)
            seed(slopes, a_places, of_a)
            read_tape(entries, parents, slopes, behind, end_of_tape())
            take_slopes(slopes, first, of_q)
            take_slopes(slopes, at_v, of_v)
            take_slopes(slopes, at_a, of_a)
            for limb in range(n_limbs):
                of_shape[k, limb] += slopes[at_start + limb]
                of_shape[k + 1, limb] += slopes[at_end + limb]
                slopes[at_start + limb] = 0.0
                slopes[at_end + limb] = 0.0
        if of_work != 0.0 and (n == 0 or kept[n - 1, INTERVAL] != k):
            # Moments m at the ends of intervals: the work is the sum of (m_k + m_k+1)(shape_k+1 - shape_k)/2.
            put_rows(q, q_places, step, OF_STEP, first)
            put_rows(start, start_places, shape[k], 0, at_start)
            put_rows(end, end_places, shape[k], 0, at_end)
            begin_tape(entries, behind)
            fill_moments_on_tape(borrow(rods), borrow(work), borrow(actuation), borrow(q), borrow(moments))
            for limb in range(n_limbs):
                turned, half = 0.0, 0.5 * of_work * moments[limb, 0]
                if k < n_intervals:
                    turned += shape[k + 1, limb] - shape[k, limb]
                    of_shape[k + 1, limb] += half
                    of_shape[k, limb] -= half
                if k > 0:
                    turned += shape[k, limb] - shape[k - 1, limb]
                    of_shape[k, limb] += half
                    of_shape[k - 1, limb] -= half
                slopes[moment_places[limb, 1]] += 0.5 * of_work * turned
            if tape_is_full() != 0:
                return 1
            read_tape(entries, parents, slopes, behind, end_of_tape())
            for row in range(n_q):
                of_q[row] += slopes[first + row]
                slopes[first + row] = 0.0
            for limb in range(n_limbs):
                of_shape[k, limb] += slopes[at_start + limb] + slopes[at_end + limb]
                slopes[at_start + limb] = 0.0
                slopes[at_end + limb] = 0.0
    put_rows(q, q_places, kept[0], OF_STEP, first)
    put_rows(v, v_places, kept[0], OF_STEP + n_q, at_v)
    begin_tape(entries, behind)
    move_roots_on_tape(borrow(rods), borrow(q), borrow(v))
    seed(slopes, q_places, of_q)
    seed(slopes, v_places, of_v)
    read_tape(entries, parents, slopes, behind, end_of_tape())
    take_slopes(slopes, first, of_q)
    take_slopes(slopes, at_v, of_v)
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
