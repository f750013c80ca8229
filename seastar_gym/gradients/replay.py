"""Reverse differentiation of a swim: its time steps once more, from the last to the first, on a tape.

Steps are replayed from what history.py has kept of them, side by side on the lanes of lanes/tape.py, as if each
were of another robot. Newton's solution of a stage is read instead of found, and is differentiated as solved exactly,
as in tape.py: q becomes q - H^-1 g, q and H constant. The tape has g alone. It ends there, and goes on from q as
from what has no parents. Where it is read, slopes s in q become slopes -H^-1 s in g, as H is symmetric; H is made and
eliminated on the lanes of `Simulator`. The tape is read for one step after the other: what steps leave for each other
(q, v and a) takes derivatives from each to the one before.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.gradients.history import FALLBACK, INTERVAL, OF_STEP, SIZE
from seastar_gym.gradients.tape import TAPED, replay_steps
from seastar_gym.lanes.compile import entry_point, kernel
from seastar_gym.lanes.registers import N_LANES, PLAIN, borrow, load, load_number, store
from seastar_gym.lanes.tape import ENTRY, FACTOR, PLACE, begin_tape, end_of_tape, tape_is_full
from seastar_gym.rods.body import move_roots
from seastar_gym.rods.bundles import Rods, Work
from seastar_gym.rods.contact.coupled import solve_again_coupled
from seastar_gym.rods.linear import solve_again
from seastar_gym.rods.potential import factorise, fill_moments
from seastar_gym.rods.step import Scheme, Stage
from seastar_gym.rods.terms.hub import Actuation

on_lanes, on_tape = borrow.at(PLAIN), borrow.at(TAPED)
"""Arrays as rows of `Simulator`, and as rows on a tape."""


@kernel
def factorise_stage(rods, work, scheme, k, h):
    """Make and eliminate H of stage k of steps of length h [s], on the lanes of `Simulator`."""
    gamma = load_number(scheme.a, k * scheme.n_stages + k) * load(h, 0)
    factorise(rods, work, Stage(work.q_hat, work.v_hat, gamma, 1.0 / gamma, not scheme.stiffly_accurate), None)


@kernel
def solve_for_slopes(rods, work):
    """From slopes in the solution of a stage to those in its g but for the sign, in work.step."""
    if rods.body is not None:
        row = 2 * rods.n_nodes
        store(work.step, row, load(rods.body.scale, 0) * load(work.step, row))
    solve_again(rods, work, work.step, work.step)
    solve_again_coupled(rods, work, work.step)


@kernel
def read_tape(tape, lane, first, end):
    """Take the slopes of what is on the tape to what stands at places below `first`, and leave zeros behind."""
    of_first, of_second = np.uint64(1 + lane), np.uint64(1 + N_LANES + lane)
    for back in range(1, end - first + 1):
        place = np.uint64(end - back)
        slope = tape.slopes[place]
        if slope != 0.0:
            tape.slopes[place] = 0.0
            entry = place * np.uint64(ENTRY)
            parents = entry + entry
            tape.slopes[tape.parents[parents]] += tape.entries[entry + of_first] * slope
            tape.slopes[tape.parents[parents + np.uint64(1)]] += tape.entries[entry + of_second] * slope
    tape.slopes[0] = 0.0


class Scene(NamedTuple):
    """What kernels get on a tape; coefficients, memory and the length of steps on the lanes of `Simulator`."""

    rods: Any
    work: Any
    scheme: Scheme
    fallback: Scheme
    actuation: Actuation
    turned: Actuation
    limits: Any
    report: NDArray[np.float64]
    own_rods: Rods
    own_work: Work
    own_h: NDArray[np.float64]


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

    entries, parents: Its entries, one after the other, and the same memory as uint32. slopes: Those of all places.
    first: Place of q; v, a and rotations stand behind it, coefficients before it, whose slopes are added up.
    """

    entries: NDArray[np.float64]
    parents: NDArray[np.uint32]
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
def put_rows(rows, lane, numbers, begin):
    """Put numbers from `begin` on into a lane of rows."""
    for row in range(rows.shape[0]):
        rows[row, lane] = numbers[begin + row]


@kernel
def place_rows(rows, places, first):
    """Let rows stand on the tape from place `first` on; returns the place behind them."""
    for row in range(rows.shape[0]):
        places[row, PLACE] = first + row
        rows[row, FACTOR:PLACE] = 1.0
    return first + rows.shape[0]


@kernel
def seed(tape, rows, places, lane, of_rows):
    """Give what stands in a lane of rows its slopes."""
    for row in range(of_rows.shape[0]):
        tape.slopes[places[row, PLACE]] += rows[row, FACTOR + lane] * of_rows[row]
        of_rows[row] = 0.0


@kernel
def take_slopes(tape, first, of_rows):
    """Move the slopes from place `first` on to those of rows; returns the place behind them."""
    for row in range(of_rows.shape[0]):
        of_rows[row] += tape.slopes[first + row]
        tape.slopes[first + row] = 0.0
    return first + of_rows.shape[0]


@kernel
def put_step(scene, rows, lane, step, times, shape):
    """Put what was kept of a step into a lane."""
    n_q, n_a, k, replayed = rows.q.shape[0], rows.a.shape[0], int(step[INTERVAL]), scene.work.replayed
    put_rows(rows.q, lane, step, OF_STEP)
    put_rows(rows.v, lane, step, OF_STEP + n_q)
    put_rows(rows.a, lane, step, OF_STEP + 2 * n_q)
    put_rows(rows.start, lane, shape[k], 0)
    put_rows(rows.end, lane, shape[k + 1], 0)
    put_rows(replayed.stages, lane, step, OF_STEP + 2 * n_q + n_a)
    put_rows(replayed.step[:OF_STEP], lane, step, 0)
    replayed.step[OF_STEP, lane] = scene.own_h[0, lane] = step[SIZE] * (times[k + 1] - times[k])


@kernel
def has_guess(work):
    """Whether the first guess of a stage, which is from `a`, has a part in what it solves."""
    if work.normals is not None or work.current is not None:
        return True
    return work.contact is not None or work.body is not None


@kernel
def write_tape(scene, tableau, tape, rows, places, steps, times, shape):
    """Replay steps, N_LANES or fewer, by a scheme. Returns (outcome, end): where the tape ends.

    outcome: 0; 1 if the tape is too short, 2 if a step was not the one that was kept.
    """
    for lane in range(N_LANES):
        put_step(scene, rows, lane, steps[min(lane, steps.shape[0] - 1)], times, shape)
    behind = place_rows(rows.v, places.v, place_rows(rows.q, places.q, tape.first))
    behind = place_rows(rows.a, places.a, behind)
    if not has_guess(scene.own_work):
        rows.a[:, FACTOR:] = 0.0
    behind = place_rows(rows.end, places.end, place_rows(rows.start, places.start, behind))
    scene.work.replayed.stage[0] = 0.0
    scene.report[:] = 0.0
    begin_tape(tape.entries, behind)
    same = replay_steps(
        on_tape(scene.rods), on_tape(scene.work), on_tape(tableau), on_tape(scene.actuation), on_tape(rows.q),
        on_tape(rows.v), on_tape(rows.a), on_tape(scene.limits), on_tape(scene.report),
    )  # fmt: skip
    for k in range(tableau.n_stages):
        take_slot(scene.work.replayed, k, -1)
        factorise_stage(on_lanes(scene.own_rods), on_lanes(scene.own_work), on_lanes(tableau), k, on_lanes(scene.own_h))
        take_slot(scene.work.replayed, -1, k)
    return 1 if tape_is_full() != 0 else 0 if same else 2, end_of_tape()


@kernel
def take_slot(replayed, k, to):
    """Copy slot k of the stages to another one, of which the last is that of the memory that kernels get (-1)."""
    for memory, size in ((replayed.of_stages, replayed.n_rows * N_LANES), (replayed.of_lists, replayed.n_lists)):
        slots = memory.reshape(-1, size) if size > 0 else memory.reshape(0, 1)
        if slots.shape[0] > 1:
            for number in range(size):
                slots[to, number] = slots[k, number]


@kernel
def pull_through_stage(scene, tape, rows, places, lane, k, end):
    """Take slopes from the end of the tape through the solution of stage k; returns where the tape ends before it."""
    replayed, own_work, n = scene.work.replayed, scene.own_work, 2 * scene.rods.n_free
    first = int(replayed.first[k])
    read_tape(tape, lane, first + n, end)
    take_slot(replayed, k, -1)
    own_work.step[:] = 0.0
    for row in range(n):
        own_work.step[row, lane] = tape.slopes[first + row]
        tape.slopes[first + row] = 0.0
    solve_for_slopes(on_lanes(scene.own_rods), on_lanes(own_work))
    for row in range(n):
        of = k * n + row
        tape.slopes[places.residual[of, PLACE]] -= rows.residual[of, FACTOR + lane] * own_work.step[row, lane]
    return first


@kernel
def pull_through_step(scene, tableau, tape, rows, places, lane, end, of, k):
    """Take slopes through a step of interval k that stands in a lane of the tape."""
    seed(tape, rows.q, places.q, lane, of.q)
    seed(tape, rows.v, places.v, lane, of.v)
    seed(tape, rows.a, places.a, lane, of.a)
    for stage in range(tableau.n_stages - 1, -1, -1):
        end = pull_through_stage(scene, tape, rows, places, lane, stage, end)
    n = 2 * of.q.shape[0] + of.a.shape[0] + 2 * of.shape.shape[1]
    read_tape(tape, lane, tape.first + n, end)
    at_a = take_slopes(tape, take_slopes(tape, tape.first, of.q), of.v)
    at_end = take_slopes(tape, take_slopes(tape, at_a, of.a), of.shape[k])
    take_slopes(tape, at_end, of.shape[k + 1])


@kernel
def pull_through_work(scene, tape, rows, places, step, shape, of, behind):
    """Take the slope in work to the state where an interval begins; returns 0, or 1 if the tape is too short.

    The work is the sum of (m_k + m_k+1)(shape_k+1 - shape_k)/2, m the moments where intervals begin and end.
    rows: Not those of steps. behind: Where the tape of steps ends, which stays as it is.
    """
    k = int(step[INTERVAL])
    put_rows(rows.q, 0, step, OF_STEP)
    put_rows(rows.start, 0, shape[k], 0)
    put_rows(rows.end, 0, shape[k], 0)
    at_start = place_rows(rows.q, places.q, tape.first)
    at_end = place_rows(rows.start, places.start, at_start)
    behind = max(behind, place_rows(rows.end, places.end, at_end))
    begin_tape(tape.entries, behind)
    fill_moments(
        on_tape(scene.rods), on_tape(scene.work), on_tape(scene.turned), on_tape(rows.q), on_tape(rows.moments)
    )
    if tape_is_full() != 0:
        return 1
    for limb in range(shape.shape[1]):
        half = 0.5 * of.work * rows.moments[limb, 0]
        for other in (k, k - 1):  # the intervals that begin and that end here
            if 0 <= other < shape.shape[0] - 1:
                turned = shape[other + 1, limb] - shape[other, limb]
                slope = rows.moments[limb, FACTOR] * (0.5 * of.work * turned)
                tape.slopes[places.moments[limb, PLACE]] += slope
                of.shape[other + 1, limb] += half
                of.shape[other, limb] -= half
    read_tape(tape, 0, behind, end_of_tape())
    take_slopes(tape, tape.first, of.q)
    take_slopes(tape, at_start, of.shape[k])
    take_slopes(tape, at_end, of.shape[k])
    return 0


@kernel
def pull_through_roots(scene, tape, rows, places, step, of):
    """Take slopes through what puts roots of limbs on a body before the first step."""
    put_rows(rows.q, 0, step, OF_STEP)
    put_rows(rows.v, 0, step, OF_STEP + rows.q.shape[0])
    behind = place_rows(rows.v, places.v, place_rows(rows.q, places.q, tape.first))
    begin_tape(tape.entries, behind)
    move_roots(on_tape(scene.rods), on_tape(rows.q), on_tape(rows.v))
    seed(tape, rows.q, places.q, 0, of.q)
    seed(tape, rows.v, places.v, 0, of.v)
    read_tape(tape, 0, behind, end_of_tape())
    take_slopes(tape, take_slopes(tape, tape.first, of.q), of.v)


@kernel
def begins(kept, n):
    """Whether an interval begins with step n, or behind the last."""
    return n == 0 or kept[n - 1, INTERVAL] != kept[n, INTERVAL]


@entry_point
def pull_back(scene, tape, rows, places, beside, places_beside, kept, times, shape, of):
    """Take slopes at the end of a swim through some intervals to its beginning, in place.

    rows, beside: Rows of steps, and of where intervals begin, and the same as whole numbers.
    kept: What history.py has kept of every step, shape (n_steps + 1, n_rows); the last begins where the swim ended.
    times, shape: Ends of the intervals [s], shape (n + 1,), and rotations then [rad], shape (n + 1, n_limbs).
    of: Slopes at the end, then at the beginning; those in rotations are added to.

    Returns 0; 1 if the tape is too short, 2 if a step was not the one that was kept.
    """
    n = kept.shape[0] - 1
    if of.work != 0.0 and begins(kept, n):
        outcome = pull_through_work(scene, tape, beside, places_beside, kept[n], shape, of, tape.first)
        if outcome != 0:
            return outcome
    while n > 0:
        first = n - 1
        while first > max(0, n - N_LANES) and kept[first - 1, FALLBACK] == kept[n - 1, FALLBACK]:
            first -= 1
        tableau = scene.fallback if kept[first, FALLBACK] > 0.0 else scene.scheme
        outcome, end = write_tape(scene, tableau, tape, rows, places, kept[first:n], times, shape)
        if outcome != 0:
            return outcome
        for lane in range(n - first - 1, -1, -1):
            step = kept[first + lane]
            pull_through_step(scene, tableau, tape, rows, places, lane, end, of, int(step[INTERVAL]))
            if of.work != 0.0 and begins(kept, first + lane):
                outcome = pull_through_work(scene, tape, beside, places_beside, step, shape, of, end)
                if outcome != 0:
                    return outcome
        n = first
    pull_through_roots(scene, tape, rows, places, kept[0], of)
    return 0
