"""Reverse differentiation of a swim: its time steps once more, from the last to the first, on a tape.

A step is replayed from what history.py has kept of it, on the lanes of simd/tape_lanes.py. Newton's solution of a stage
is read instead of found, and is differentiated as solved exactly, as in implicit.py: q becomes q - H^-1 g, q and H
constant. The tape has g alone. It ends there, and goes on from q as from what has no parents. Where it is read, slopes
s in q become slopes -H^-1 s in g, as H is symmetric; H is made and eliminated on the lanes of `Simulator`. What steps leave for each other (q, v and a) takes derivatives from each step to the one before.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba.core.compiler_lock import global_compiler_lock
from numpy.typing import NDArray

from seastar_gym.der import potential
from seastar_gym.der.body.body import move_roots, place_roots
from seastar_gym.der.contact.coupled import solve_again_coupled
from seastar_gym.der.energy import fill_moments
from seastar_gym.der.linear.star_matrix import load_pair, store_pair
from seastar_gym.der.linear.star_solution import solve_again
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import Rods, Work
from seastar_gym.der.stepping import steps
from seastar_gym.der.stepping.schemes import Scheme
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.der.stepping.steps import Step, try_step
from seastar_gym.der.terms.hub import Actuation
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
from seastar_gym.simd.lanes import N_LANES, any_lane, borrow, load, load_number, splat, store, store_number
from seastar_gym.simd.modules import COMPILATION, LANES, KernelModules
from seastar_gym.simd.tape_lanes import ROW, at_place, begin_tape, end_of_tape, leave_places, tape_is_full


class Replayed(NamedTuple):
    """What a step is replayed from, and what is left of its stages.

    numbers: Number of the stage at hand, then what was kept of all, see history.py. first: Places of their solutions
    begin here. residual: g of every stage, as rows on a tape. memory: All rows of `work`. lists: All that is in it and
    that robots share. of_stages, lists_of_stages: The same when every stage was left, as rows of `Simulator`, whose
    `work` has the last stage's.
    """

    numbers: NDArray[np.float64]
    first: NDArray[np.float64]
    residual: NDArray[np.float64]
    memory: NDArray[np.float64]
    lists: NDArray[np.float64]
    of_stages: NDArray[np.float64]
    lists_of_stages: NDArray[np.float64]
    n_rows: int
    n_lists: int
    n_stages: int


@kernel
def read_minimum(rods, work, stage, active, tolerance, iteration_limit):
    """What minimise has found in the stage at hand, but for the solution."""
    numbers = work.replayed.numbers
    row = 1 + int(load_number(numbers, 0)) * (OF_STAGE + 2 * rods.n_points)
    phi, setbacks = load_number(numbers, row + PHI), load_number(numbers, row + SETBACKS)
    return active, splat(phi), splat(0.0), splat(setbacks), splat(0.0)


@kernel
def put_solution(rods, work, scheme, k, stage, q_0, v_0, h, robots):
    """Put the solution of stage k of a step on the tape, and what else stands in work beside it."""
    numbers, replayed, n = work.replayed.numbers, work.replayed, 2 * rods.n_free
    row = 1 + int(load_number(numbers, 0)) * (OF_STAGE + 2 * rods.n_points) + OF_STAGE
    store_number(numbers, 0, load_number(numbers, 0) + 1.0)
    for coordinate in range(2 * rods.n_points):
        store(work.q, coordinate, load_number(numbers, row + coordinate))
        store(work.q_hat, coordinate, load(stage.q_hat, coordinate))
        store(work.v_hat, coordinate, load(stage.v_hat, coordinate))
    place_roots(rods, work.q)
    to = k + replayed.n_stages - scheme.n_stages
    copy(replayed.memory, ROW, replayed.of_stages, to * replayed.n_rows, N_LANES, replayed.n_rows)
    copy(replayed.lists, 1, replayed.lists_of_stages, to * replayed.n_lists, 1, replayed.n_lists)
    factorise(rods, work, stage, None)
    first = end_of_tape()
    leave_places(n)
    store_number(replayed.first, k, float(first))
    for row in range(n):
        store(replayed.residual, k * n + row, load(work.step, row))
        store(work.q, row, at_place(load(work.q, row), first + row))
    place_roots(rods, work.q)


@kernel
def copy(rows, stride, to, first, to_stride, n):
    """Copy the first n of numbers that stand a stride apart, to behind `first` such strides."""
    for row in range(n):
        store_number(to, (first + row) * to_stride, load_number(rows, row * stride))


@kernel
def solve_for_slopes(rods, work, scheme, k, h):
    """From slopes in the solution of stage k of a step to those in its g but for the sign, in work.step.

    On the lanes of `Simulator`.
    """
    gamma = splat(load_number(scheme.a, k * scheme.n_stages + k) * h)
    factorise(rods, work, Stage(work.q_hat, work.v_hat, gamma, 1.0 / gamma, not scheme.stiffly_accurate), None)
    if rods.body is not None:
        row = 2 * rods.n_nodes
        store(work.step, row, load(rods.body.scale, 0) * load(work.step, row))
    solve_again(rods, work, work.step, work.step)
    solve_again_coupled(rods, work, work.step)


@kernel
def replay_step(rods, work, scheme, actuation, q, v, a, numbers, h, limits, report):
    """Take the step of these numbers (see history.py) again; returns whether it was accepted, as it was then."""
    everybody = splat(0.0) < 1.0
    retrying = everybody & (splat(load_number(numbers, RETRYING)) > 0.0)
    size = load_number(numbers, SIZE)
    limit = splat(load_number(numbers, LIMIT))
    step = Step(splat(load_number(numbers, START)), splat(size), splat(h), limit, retrying)
    _, accepted, _ = try_step(rods, work, scheme, actuation, q, v, a, step, everybody, limits, report)
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
def leave_right_hand_side(work, node, D, B, C, r, D_1, B_1, D_2, r_1, r_2):
    """In place of eliminate_node: the right-hand side goes to work.step, nothing is eliminated, the matrix is gone."""
    zero = splat(0.0)
    block, coupling = (zero, zero, zero), (zero, zero, zero, zero)
    store_pair(work.step, 2 * node, r)
    return block, coupling, block, r_1, r_2, zero, zero


@kernel
def leave_right_hand_sides_of_hub(rods, work, D_hub, r_hub):
    """In place of solve_hub: right-hand sides of it and of root nodes go to work.step."""
    store_pair(work.step, 0, r_hub)
    for limb in range(rods.n_limbs):
        store_pair(work.step, 2 * (limb * rods.edges_per_limb + 1), load_pair(work.ring, 2 * limb))
    if rods.body is not None:
        store_pair(work.step, 2 * rods.n_nodes, (load(work.body.system, 3), splat(0.0)))
    return splat(0.0), splat(0.0)


@kernel
def leave_right_hand_side_of_root(work, limb, D, H, r):
    """In place of store_root: nothing but the right-hand side."""
    store_pair(work.ring, 2 * limb, r)


class TapeKernels(KernelModules):
    """The kernels on a tape. Stages read what Newton's method has found, and put their solution on the tape."""

    def __init__(self) -> None:
        super().__init__({LANES: tape_lanes, COMPILATION: compilation})
        of_steps = {"minimise": read_minimum, "correct_momentum": put_solution}
        of_potential = {
            "eliminate_node": leave_right_hand_side,
            "store_root": leave_right_hand_side_of_root,
            "solve_hub": leave_right_hand_sides_of_hub,
        }
        for module, instead in ((steps, of_steps), (potential, of_potential)):
            vars(self._module_of(module.__name__)).update({name: self(own) for name, own in instead.items()})


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


class Scene(NamedTuple):
    """What kernels get on a tape, and coefficients and memory on the lanes of `Simulator`."""

    rods: Any
    work: Any
    scheme: Scheme
    fallback: Scheme
    actuation: Actuation
    limits: Any
    report: NDArray[np.float64]
    own_rods: Rods
    own_work: Work


class Rows(NamedTuple):
    """Rows on a tape: q, v, a, rotations at both ends of an interval, moments, g of all stages, shape (.., ROW) each.

    Or the same memory as whole numbers.
    """

    q: NDArray[Any]
    v: NDArray[Any]
    a: NDArray[Any]
    start: NDArray[Any]
    end: NDArray[Any]
    moments: NDArray[Any]
    residual: NDArray[Any]


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
        rows[row, 2] = 1.0
    return first + rows.shape[0]


@kernel
def put_state(rows, places, step, first):
    """Put q, v and a at the beginning of a step on the tape, see put_rows."""
    n_q = rows.q.shape[0]
    behind = put_rows(rows.q, places.q, step, OF_STEP, first)
    behind = put_rows(rows.v, places.v, step, OF_STEP + n_q, behind)
    return put_rows(rows.a, places.a, step, OF_STEP + 2 * n_q, behind)


@kernel
def seed(tape, rows, places, of_rows):
    """Give what stands in rows its slopes."""
    for row in range(places.shape[0]):
        tape.slopes[places[row, 1]] += rows[row, 2] * of_rows[row]
        of_rows[row] = 0.0


@kernel
def take_slopes(tape, first, of_rows):
    """Move the slopes from place `first` on to those of rows; returns the place behind them."""
    for row in range(of_rows.shape[0]):
        of_rows[row] += tape.slopes[first + row]
        tape.slopes[first + row] = 0.0
    return first + of_rows.shape[0]


@kernel
def pull_through_stage(scene, tape, rows, places, tableau, k, h, end):
    """Take slopes from the end of the tape through the solution of stage k of a step of length h [s].

    Returns where the tape ends before it.
    """
    replayed, own_rods, own_work = scene.work.replayed, scene.own_rods, scene.own_work
    n, first, last = 2 * scene.rods.n_free, int(replayed.first[k]), replayed.n_stages - 1
    read_tape(tape.entries, tape.parents, tape.slopes, first + n, end)
    if k < tableau.n_stages - 1:
        for memory in (replayed.of_stages, replayed.lists_of_stages):
            size = memory.size // replayed.n_stages
            memory[last * size :] = memory[k * size : (k + 1) * size]
    for row in range(n):
        own_work.step[row, 0] = tape.slopes[first + row]
        tape.slopes[first + row] = 0.0
    solve_for_slopes(borrow(own_rods), borrow(own_work), borrow(tableau), k, h)
    for row in range(n):
        of = k * n + row
        tape.slopes[places.residual[of, 1]] -= rows.residual[of, 2] * own_work.step[row, 0]
    return first


@kernel
def pull_through_step(scene, tape, rows, places, step, h, start, end, of, k):
    """Take slopes through a step of interval k, of length h [s]. start, end: Rotations at both ends of the interval.

    Returns 0; 1 if the tape is too short, 2 if the step was not the one that was kept.
    """
    tableau = scene.scheme
    if step[FALLBACK] > 0.0:
        tableau = scene.fallback
    at_start = put_state(rows, places, step, tape.first)
    behind = put_rows(rows.end, places.end, end, 0, put_rows(rows.start, places.start, start, 0, at_start))
    begin = OF_STEP + 2 * rows.q.shape[0] + rows.a.shape[0]
    scene.work.replayed.numbers[0] = 0.0
    for row in range(step.shape[0] - begin):
        scene.work.replayed.numbers[1 + row] = step[begin + row]
    scene.report[:] = 0.0
    begin_tape(tape.entries, behind)
    same = replay_step_on_tape(
        borrow(scene.rods), borrow(scene.work), borrow(tableau), borrow(scene.actuation), borrow(rows.q),
        borrow(rows.v), borrow(rows.a), borrow(step), h, borrow(scene.limits), borrow(scene.report),
    )  # fmt: skip
    if tape_is_full() != 0:
        return 1
    if not same:
        return 2
    seed(tape, rows.q, places.q, of.q)
    seed(tape, rows.v, places.v, of.v)
    seed(tape, rows.a, places.a, of.a)
    end = end_of_tape()
    for stage in range(tableau.n_stages - 1, -1, -1):
        end = pull_through_stage(scene, tape, rows, places, tableau, stage, h, end)
    read_tape(tape.entries, tape.parents, tape.slopes, behind, end)
    at_a = take_slopes(tape, take_slopes(tape, tape.first, of.q), of.v)
    at_end = take_slopes(tape, take_slopes(tape, at_a, of.a), of.shape[k])
    take_slopes(tape, at_end, of.shape[k + 1])
    return 0


@kernel
def pull_through_work(scene, tape, rows, places, step, shape, of, k):
    """Take the slope in work to the state where interval k begins; returns 0, or 1 if the tape is too short.

    The work is the sum of (m_k + m_k+1)(shape_k+1 - shape_k)/2, m the moments where intervals begin and end.
    """
    at_start = put_rows(rows.q, places.q, step, OF_STEP, tape.first)
    at_end = put_rows(rows.start, places.start, shape[k], 0, at_start)
    behind = put_rows(rows.end, places.end, shape[k], 0, at_end)
    begin_tape(tape.entries, behind)
    fill_moments_on_tape(
        borrow(scene.rods), borrow(scene.work), borrow(scene.actuation), borrow(rows.q), borrow(rows.moments)
    )
    if tape_is_full() != 0:
        return 1
    for limb in range(shape.shape[1]):
        half = 0.5 * of.work * rows.moments[limb, 0]
        for other in (k, k - 1):  # the intervals that begin and that end here
            if 0 <= other < shape.shape[0] - 1:
                turned = shape[other + 1, limb] - shape[other, limb]
                tape.slopes[places.moments[limb, 1]] += rows.moments[limb, 2] * (0.5 * of.work * turned)
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
    move_roots_on_tape(borrow(scene.rods), borrow(rows.q), borrow(rows.v))
    seed(tape, rows.q, places.q, of.q)
    seed(tape, rows.v, places.v, of.v)
    read_tape(tape.entries, tape.parents, tape.slopes, behind, end_of_tape())
    take_slopes(tape, take_slopes(tape, tape.first, of.q), of.v)


@entry_point
def _pull_back(scene, tape, rows, places, kept, times, shape, of):
    """Take slopes at the end of a swim through some intervals to its beginning, in place.

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
