"""A whole sequence of time intervals for many robots, in one compiled call."""

from seastar_gym.der.body.body import move_roots
from seastar_gym.der.energy import fill_moments
from seastar_gym.der.geometry import larger
from seastar_gym.der.stepping.interval import cover_interval
from seastar_gym.der.stepping.report import MOMENTS, PEAK_MOMENT, WORK, iterations_spent
from seastar_gym.simd.compilation import entry_point, kernel
from seastar_gym.simd.lanes import absolute, add_product, borrow, load, load_number, select, splat, store

STUCK, SPENT = 1.0, 3.0  # SolverStatus.NOT_CONVERGED and ITERATION_LIMIT


@kernel
def shape_of_limb(shape, n_turning, k, limb):
    """Rotation of a limb at time k, from the rows of `n_turning` limbs for each time; 0: all robots turn alike."""
    return load(shape, k if n_turning == 0 else k * n_turning + limb % n_turning)


@kernel
def begin_effort(rods, work, actuation, q, effort):
    """Fill the rows of the moments at the beginning of an interval."""
    fill_moments(rods, work, actuation, q, work.hub_moment)
    for limb in range(rods.n_limbs):
        store(effort, MOMENTS + limb, load(work.hub_moment, limb))


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
    fill_moments(rods, work, actuation, q, work.hub_moment)
    for limb in range(rods.n_limbs):
        before, after = load(effort, MOMENTS + limb), load(work.hub_moment, limb)
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
    a: Memory from one time step to the next: accelerations of its stages [m/s^2], their shares in the next guess, its
        length and size, shape (n_groups, n_stages (2 n_nodes + 1) + 2, N_LANES); more with a body, see stages.py.
    peaks: Share of `shape` that every limb follows, shape (n_groups, n_limbs, N_LANES).
    times: Ends of the intervals [s], shape (n_intervals + 1,).
    shape: Rotation of the limbs at those times [rad], shape (n_intervals + 1,) if all limbs turn alike, else
        (n_groups, (n_intervals + 1) n_turning, N_LANES), time by time. n_turning: 0, n_limbs, or 1 if those of a
        robot turn alike.
    failed: 0 for robots that go on, else their SolverStatus, shape (n_groups, 1, N_LANES).
    report: Counts and extremes, added to, shape (n_groups, len(REPORT_ROWS), N_LANES).
    limits: Tolerances and bounds, see scales.py.
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
