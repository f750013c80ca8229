"""A whole sequence of time intervals for many robots, in one compiled call."""

from seastar_gym.der.compilation import entry_point
from seastar_gym.der.lanes import borrow, load, select, splat, store
from seastar_gym.der.stages import cover_interval


@entry_point
def advance(rods, work, scheme, fallback, actuation, q, v, a, peaks, times, shape, failed, report, limits):
    """Advance lane groups through the intervals between `times`, in place.

    scheme, fallback: How time steps are made, and how they are made where they give trouble (with one stage).
    q, v: Positions and velocities [m, m/s], shape (n_groups, 2 n_nodes, N_LANES).
    a: What a time step leaves for the next: accelerations of its stages [m/s^2], their shares in the next guess, length
        and size, shape (n_groups, n_stages (2 n_nodes + 1) + 2, N_LANES).
    peaks: Rotation of every limb at full shape [rad], shape (n_groups, n_limbs, N_LANES).
    times: Ends of the intervals [s], shape (n_intervals + 1,). shape: Share of the peak at those times, same shape.
    failed: 0 for robots that go on, 1 for those that have failed, shape (n_groups, 1, N_LANES).
    report: Counts and extremes, added to, shape (n_groups, len(REPORT_ROWS), N_LANES).
    limits: What the solution has to keep.
    """
    rods_rows, memory, rotation = borrow(rods), borrow(work), borrow(actuation)
    tableau, fallback_tableau = borrow(scheme), borrow(fallback)
    for group in range(q.shape[0]):
        q_rows, v_rows, a_rows, peak_rows = borrow(q[group]), borrow(v[group]), borrow(a[group]), borrow(peaks[group])
        failed_rows, report_rows = borrow(failed[group]), borrow(report[group])
        alive = load(failed_rows, 0) < 1.0
        for k in range(times.shape[0] - 1):
            for limb in range(rods.n_limbs):
                peak = load(peak_rows, limb)
                store(rotation.delta_psi_start, limb, peak * shape[k])
                store(rotation.delta_psi_end, limb, peak * shape[k + 1])
            alive = cover_interval(
                rods_rows, memory, tableau, fallback_tableau, rotation, q_rows, v_rows, a_rows, times[k + 1] - times[k],
                alive, limits, report_rows,
            )  # fmt: skip
        store(failed_rows, 0, select(alive, splat(0.0), 1.0))
