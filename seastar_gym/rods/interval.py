"""An interval between two corners of a time grid, covered by steps that every robot halves for itself.

A whole sequence of time intervals for many robots, in one compiled call.
"""

from seastar_gym.lanes.compile import entry_point, kernel
from seastar_gym.lanes.registers import (
    absolute,
    add_product,
    any_lane,
    borrow,
    load,
    load_number,
    select,
    splat,
    store,
)
from seastar_gym.rods.body import move_roots
from seastar_gym.rods.contact.pairs import deepest_overlap
from seastar_gym.rods.guard import come_to_rest
from seastar_gym.rods.potential import fill_moments
from seastar_gym.rods.star import edge_geometry, half_angle, larger, tail_node
from seastar_gym.rods.step import (
    COVERED,
    ENERGY_CUTS,
    HALVINGS,
    LARGEST_OVERLAP,
    MOMENTS,
    MOST_HALVINGS,
    PEAK_MOMENT,
    SMALLEST_FRACTION,
    SMALLEST_HUB_T,
    STEPS,
    WORK,
    Step,
    add_to_report,
    forget_accelerations,
    iterations_spent,
    try_step,
)

FALLBACK_AFTER = 4.0  # halvings, a choice: from there on a robot's steps are implicit Euler's


@kernel
def note_hub_angles(rods, q, robots, report):
    """Keep the smallest tan(phi/2) of the hub hinges of the robots in the mask, but for gaps of more than pi."""
    smallest = load(report, SMALLEST_HUB_T)
    edges = rods.edges_per_limb
    last = rods.n_limbs - 1
    first = edge_geometry(q, tail_node(rods, last * edges), last * edges + 1)
    for limb in range(rods.n_limbs):
        second = edge_geometry(q, tail_node(rods, limb * edges), limb * edges + 1)
        t = half_angle(first, second, rods.hub.side)
        narrow = rods.hub.side * load(rods.hub.angle, limb - 1 if limb > 0 else last) >= 0.0
        smallest = select(robots & narrow & (t < smallest), t, smallest)
        first = second
    store(report, SMALLEST_HUB_T, smallest)


@kernel
def note_overlap(rods, work, q, robots, report):
    """Keep the largest overlap at the ends of the steps of the robots in the mask, in scenes with contact."""
    if rods.contact is None:
        return
    largest, now = load(report, LARGEST_OVERLAP), deepest_overlap(rods, work, q)
    store(report, LARGEST_OVERLAP, select(robots & (now > largest), now, largest))


@kernel
def cover_interval(rods, work, scheme, fallback, actuation, q, v, a, duration, alive, limits, report):
    """Advance the robots in `alive` over an interval of `duration` [s], in place.

    A robot whose step does not converge in `limits.max_iterations`, or creates energy, halves it, alone, as often as it
    takes, and still covers the whole interval. After each halving it has as many more iterations and starts them where
    it stands; after FALLBACK_AFTER halvings it goes on with the scheme `fallback` (implicit Euler). After MOST_HALVINGS
    the robot comes to rest within itself, see guard.py, and tries once more; if that fails it has failed and stays at
    its last good place. So has one that needs more than `limits.most_iterations` in the stroke.

    No step is below SMALLEST_FRACTION: a robot that is stuck there tries again, and the halving counts. Steps are
    dyadic fractions of the interval, on the grid of their own size, so their sums are exact.

    Returns the mask of the robots that arrived.
    """
    zero, one = splat(0.0), splat(1.0)
    start, size, halvings = zero, one, zero
    moving, rested = alive, one < zero
    while any_lane(moving):
        # Robots do not wait for each other: those on the fallback go on when no other is left.
        on_scheme = moving & (halvings < FALLBACK_AFTER)
        going, tableau = moving, fallback
        if any_lane(on_scheme):
            going, tableau = on_scheme, scheme
        retrying = going & (halvings > 0.0)
        step = Step(start, size, size * duration, (1.0 + halvings) * limits.max_iterations, retrying)
        accepted = try_step(rods, work, tableau, actuation, q, v, a, step, going, limits, report)
        note_hub_angles(rods, q, going, report)
        note_overlap(rods, work, q, accepted, report)
        stuck = going & ~accepted
        on_fallback = going & ~on_scheme
        if any_lane(stuck | on_fallback):
            forget_accelerations(rods, scheme, a, stuck | on_fallback)
        add_to_report(report, STEPS, select(accepted, one, zero))
        add_to_report(report, HALVINGS, select(stuck, one, zero))
        add_to_report(report, COVERED, select(accepted, step.h, zero))
        start = select(accepted, start + size, start)
        size = select(stuck & (size > SMALLEST_FRACTION), 0.5 * size, size)
        spent = iterations_spent(report) >= limits.most_iterations
        failed = stuck & ((halvings >= MOST_HALVINGS) | spent)
        rested = rested & ~accepted
        if any_lane(failed & ~rested & ~spent):
            resting = come_to_rest(rods, work, q, v, failed & ~rested & ~spent)
            add_to_report(report, ENERGY_CUTS, select(resting, one, zero))
            rested, failed = rested | resting, failed & ~resting
        halvings += select(stuck, one, zero)
        alive = alive & ~failed
        moving = moving & ~failed & (start < 1.0)
    return alive


STUCK, SPENT = 1.0, 3.0  # SolverStatus.NOT_CONVERGED and ITERATION_LIMIT


@kernel
def shape_of_limb(shape, n_turning, k, limb):
    """Rotation of a limb at time k, from the rows of `n_turning` limbs for each time; 0: all robots turn alike."""
    return load(shape, k if n_turning == 0 else k * n_turning + limb % n_turning)


@kernel
def begin_effort(rods, work, actuation, q, effort):
    """Fill the rows of the moments at the beginning of an interval."""
    fill_moments(rods, work, actuation, q, work.hub.moment)
    for limb in range(rods.n_limbs):
        store(effort, MOMENTS + limb, load(work.hub.moment, limb))


@kernel
def end_effort(rods, work, actuation, q, robots, effort):
    """Add the work of the actuators in an interval that ends at q, by the trapezoidal rule, for the robots in the mask.

    Leaves the rotations of its end as those of the beginning of the next, and what limbs turned in their place.
    """
    done, largest = load(effort, WORK), load(effort, PEAK_MOMENT)
    for limb in range(rods.n_limbs):
        start, end = load(actuation.delta_psi_start, limb), load(actuation.delta_psi_end, limb)
        store(actuation.delta_psi_start, limb, end)
        store(actuation.delta_psi_end, limb, end - start)
    fill_moments(rods, work, actuation, q, work.hub.moment)
    for limb in range(rods.n_limbs):
        before, after = load(effort, MOMENTS + limb), load(work.hub.moment, limb)
        done = add_product(done, 0.5 * (before + after), load(actuation.delta_psi_end, limb))
        largest = larger(largest, larger(absolute(before), absolute(after)))
        store(effort, MOMENTS + limb, after)
    store(effort, WORK, select(robots, done, load(effort, WORK)))
    store(effort, PEAK_MOMENT, select(robots, largest, load(effort, PEAK_MOMENT)))


@kernel
def cover_intervals(
    rods, work, scheme, fallback, actuation, q, v, a, peaks, times, n_intervals, shape, n_turning, failed, report,
    limits, effort, asked,
):  # fmt: skip
    """Advance a lane group through the intervals between `times`; rows and numbers of one group, see `advance`.

    n_turning: Limbs with a shape of their own: 0, 1 or n_limbs. asked: Whether somebody asks for `effort`.
    """
    move_roots(rods, q, v)
    status = load(failed, 0)
    alive = status < 1.0
    for k in range(n_intervals):
        for limb in range(rods.n_limbs):
            peak = load(peaks, limb)
            store(actuation.delta_psi_start, limb, peak * shape_of_limb(shape, n_turning, k, limb))
            store(actuation.delta_psi_end, limb, peak * shape_of_limb(shape, n_turning, k + 1, limb))
        if asked and k == 0:
            begin_effort(rods, work, actuation, q, effort)
        duration = load_number(times, k + 1) - load_number(times, k)
        alive = cover_interval(rods, work, scheme, fallback, actuation, q, v, a, duration, alive, limits, report)
        if asked:
            end_effort(rods, work, actuation, q, alive, effort)
    spent = iterations_spent(report) >= limits.most_iterations
    reason = select(spent, splat(SPENT), splat(STUCK))
    store(failed, 0, select(alive, splat(0.0), larger(status, reason)))


@kernel
def rows_of(shape, group, like):
    """The shape's rows of a lane group, or of all, of the form of other rows."""
    if shape.ndim == 1:
        return borrow(shape)
    return borrow(shape[group])


@entry_point
def advance(
    rods, work, scheme, fallback, actuation, q, v, a, peaks, times, shape, n_turning, failed, report, limits, effort
):
    """Advance lane groups through the intervals between `times`, in place.

    scheme, fallback: Tableaux of the time steps, and of the steps of robots that had to retry often (one stage).
    q, v: Positions and velocities [m, m/s], shape (n_groups, 2 n_nodes, N_LANES).
    a: Memory from one time step to the next: accelerations of its stages [m/s^2], and their shares in the next guess,
        shape (n_groups, n_stages (2 n_nodes + 1), N_LANES); more with a body, see `share_of_body` in step.py.
    peaks: Share of `shape` that every limb follows, shape (n_groups, n_limbs, N_LANES).
    times: Ends of the intervals [s], shape (n_intervals + 1,).
    shape: Rotation of the limbs at those times [rad], shape (n_intervals + 1,) if all limbs turn alike, else
        (n_groups, (n_intervals + 1) n_turning, N_LANES), time by time. n_turning: 0, n_limbs, or 1 if those of a
        robot turn alike.
    failed: 0 for robots that go on, else their SolverStatus, shape (n_groups, 1, N_LANES).
    report: Counts and extremes, added to, shape (n_groups, len(REPORT_ROWS), N_LANES).
    limits: Tolerances and bounds, see newton.py.
    effort: Work and moments of the actuators, added to, shape (n_groups, MOMENTS + n_limbs, N_LANES), see report.py;
        (n_groups, 0, N_LANES) where nobody asks for them.
    """
    rods_rows, memory, rotation = borrow(rods), borrow(work), borrow(actuation)
    tableau, fallback_tableau, bounds = borrow(scheme), borrow(fallback), borrow(limits)
    for group in range(q.shape[0]):
        cover_intervals(
            rods_rows, memory, tableau, fallback_tableau, rotation, borrow(q[group]), borrow(v[group]),
            borrow(a[group]), borrow(peaks[group]), borrow(times), times.shape[0] - 1, rows_of(shape, group, rotation),
            n_turning, borrow(failed[group]), borrow(report[group]), bounds, borrow(effort[group]),
            effort.shape[1] > 0,
        )  # fmt: skip
