"""Time steps: a scheme's implicit stages, and the halving of steps that do not converge or create energy."""

from typing import Any, NamedTuple

from seastar_gym.der.geometry import edge_geometry, half_angle
from seastar_gym.der.star import n_nodes
from seastar_gym.der.stepping.guard import (
    LARGEST_CUT,
    add_work_of_loads,
    allowed_energy,
    frame_velocity,
    hold_to_energy,
    may_gain,
    put_back,
    set_aside,
    through_poles,
)
from seastar_gym.der.stepping.momentum import settle_momentum
from seastar_gym.der.stepping.newton import minimise
from seastar_gym.der.stepping.report import (
    BACKTRACKS,
    COVERED,
    ENERGY_CUTS,
    HALVINGS,
    NEWTON_ITERATIONS,
    REJECTIONS,
    REPAIRS,
    SMALLEST_HUB_T,
    STEPS,
)
from seastar_gym.der.terms.crossing import those_uncrossed
from seastar_gym.der.terms.damping import freeze_strains
from seastar_gym.der.terms.fluid import add_work_of_current, freeze_fluid
from seastar_gym.der.terms.hub import set_natural_hub_angles
from seastar_gym.der.terms.near_pairs import freeze_contact
from seastar_gym.simd.compilation import inlined_kernel, kernel
from seastar_gym.simd.lanes import add_product, any_lane, floor, load, load_number, select, splat, sqrt, store


class Stage(NamedTuple):
    """An implicit stage: q_hat [m] and v_hat [m/s], rows per coordinate, gamma [s] and its reciprocal, lanes.

    ahead: Whether the scheme asks in the middle of a step, so that contact has to look ahead, see contact.py.
    """

    q_hat: Any
    v_hat: Any
    gamma: Any
    inverse_gamma: Any
    ahead: bool


MOST_HALVINGS = 12.0  # a robot that is stuck once more has failed
TURNABLE = 8.0  # after so many halvings, hinges may go through their poles, see guard.py
CAUTIOUS = 4.0  # from so many halvings on, a robot's steps are implicit Euler's

SMALLEST_FRACTION = 2.0**-12  # of an interval: there is no shorter step
SOONEST_GROWTH = 4.0  # steps after trouble before a step is doubled; the next doubling waits twice as long
FIRST_FRACTION = 2.0**-3  # of an interval: an adapted stroke begins with this step
GROWTH_MARGIN = 5.0  # a step is doubled when its error rate is this many times below the limit

# Rows of `a` behind the accelerations and their shares, where steps are adapted: the length of the last step [s], and
# the next step's share of its interval.
LAST_STEP, SIZE = 0, 1


@kernel
def memory_row(rods, scheme, which):
    """Row of `a` where a step leaves LAST_STEP or SIZE for the next."""
    return (2 * n_nodes(rods) + 1) * scheme.n_stages + which


@inlined_kernel
def begin_stage(rods, work, scheme, k, q_0, v_0, a, h):
    """Stage k of a step; the iterate starts at (13.10) plus a share of what the last acceleration adds."""
    gamma = load_number(scheme.a, k * scheme.n_stages + k) * h
    rows = 2 * n_nodes(rods)
    share = gamma * load(a, scheme.n_stages * rows + k)
    for row in range(rows):
        q_hat, v_hat = load(q_0, row), load(v_0, row)
        for other in range(k):
            weight = load_number(scheme.a, k * scheme.n_stages + other) * h
            q_hat = add_product(q_hat, weight, load(work.stage_v, other * rows + row))
            v_hat = add_product(v_hat, weight, load(a, other * rows + row))
        if k > 0:
            store(work.q_hat, row, q_hat)
            store(work.v_hat, row, v_hat)
        velocity = add_product(v_hat, share, load(a, k * rows + row))
        store(work.q, row, add_product(q_hat, gamma, velocity))
    if k > 0:
        return Stage(work.q_hat, work.v_hat, gamma, 1.0 / gamma, not scheme.stiffly_accurate)
    return Stage(q_0, v_0, gamma, 1.0 / gamma, not scheme.stiffly_accurate)


@kernel
def stage_motion(work, stage, row):
    """(V, A) of a coordinate: V = (Q - q_hat)/gamma and A = (V - v_hat)/gamma."""
    velocity = (load(work.q, row) - load(stage.q_hat, row)) * stage.inverse_gamma
    return velocity, (velocity - load(stage.v_hat, row)) * stage.inverse_gamma


@kernel
def store_share(a, row, along, squared, robots):
    """The share, from 0 to 1, of a stage's last acceleration that would have fit its new one best (least squares).

    The next step's first guess uses it. Ringing that a step does not resolve changes its sign, and has the share 0.
    """
    share = select(along > 0.0, along / squared, 0.0)
    store(a, row, select(robots, select(share < 1.0, share, 1.0), load(a, row)))


@kernel
def end_stage(rods, work, scheme, k, stage, a, robots):
    """Keep velocity and acceleration of a solved stage that is not the last, for the robots in the mask `robots`."""
    rows = 2 * n_nodes(rods)
    along, squared = splat(0.0), splat(0.0)
    for row in range(rows):
        velocity, acceleration = stage_motion(work, stage, row)
        last = load(a, k * rows + row)
        along = add_product(along, last, acceleration)
        squared = add_product(squared, last, last)
        store(work.stage_v, k * rows + row, velocity)
        store(a, k * rows + row, select(robots, acceleration, last))
    store_share(a, scheme.n_stages * rows + k, along, squared, robots)


@inlined_kernel
def end_step(rods, work, scheme, stage, q_0, v_0, a, h, accepted):
    """After the last stage: write the step's result over the state (q_0, v_0) of the robots in the mask `accepted`."""
    rows, k = 2 * n_nodes(rods), scheme.n_stages - 1
    along, squared = splat(0.0), splat(0.0)
    for row in range(rows):
        velocity, acceleration = stage_motion(work, stage, row)
        last = load(a, k * rows + row)
        along = add_product(along, last, acceleration)
        squared = add_product(squared, last, last)
        q, v = load(q_0, row), load(v_0, row)
        if scheme.stiffly_accurate:
            q_1, v_1 = load(work.q, row), velocity
        else:
            weight = load_number(scheme.b, k) * h
            q_1, v_1 = add_product(q, weight, velocity), add_product(v, weight, acceleration)
            for other in range(k):
                weight = load_number(scheme.b, other) * h
                q_1 = add_product(q_1, weight, load(work.stage_v, other * rows + row))
                v_1 = add_product(v_1, weight, load(a, other * rows + row))
        store(a, k * rows + row, select(accepted, acceleration, last))
        store(q_0, row, select(accepted, q_1, q))
        store(v_0, row, select(accepted, v_1, v))
    store_share(a, scheme.n_stages * rows + k, along, squared, accepted)


@kernel
def forget_accelerations(rods, scheme, a, robots):
    """Robots whose step did not converge start the next one without a prediction, which may be far off or infinite."""
    for row in range((2 * n_nodes(rods) + 1) * scheme.n_stages):
        store(a, row, select(robots, 0.0, load(a, row)))


@kernel
def step_error(rods, work, stage, a, h, last_h):
    """Position error of a step of the implicit midpoint rule [m], largest over the nodes.

    The rule takes the acceleration in the middle for the whole step, so it errs by h^3/12 times its rate of change, and
    that is the difference to the last step's over the time between the two middles.
    """
    largest = splat(0.0)
    for node in range(n_nodes(rods)):
        squared = splat(0.0)
        for row in range(2 * node, 2 * node + 2):
            _, acceleration = stage_motion(work, stage, row)
            change = acceleration - load(a, row)
            squared = add_product(squared, change, change)
        largest = select(squared > largest, squared, largest)
    return h * h * h * sqrt(largest) / (6.0 * (h + last_h))


@kernel
def start_standing(rods, work, stage, frame, robots):
    """Start the iterate of the robots in the mask at q_hat, carried on by the frame: Phi is finite there, and no
    velocity about it leads it astray.
    """
    for node in range(n_nodes(rods)):
        x = add_product(load(stage.q_hat, 2 * node), stage.gamma, frame[0])
        y = add_product(load(stage.q_hat, 2 * node + 1), stage.gamma, frame[1])
        store(work.q, 2 * node, select(robots, x, load(work.q, 2 * node)))
        store(work.q, 2 * node + 1, select(robots, y, load(work.q, 2 * node + 1)))


@kernel
def try_step(rods, work, scheme, actuation, q, v, a, start, size, h, active, wary, limits, patience, report):
    """One step of length h from `start`, `size` of the interval long, for the robots in `active`.

    a: What the last step left for this one, see LAST_STEP and SIZE; then what this one leaves for the next.
    wary: Mask of the robots that had to halve a step of this interval.

    Returns (good, accepted, error rate): the mask of the robots whose stages all converged and created no energy, that
    of those whose error is small enough besides, whose state has moved, and the error per time [m/s], zero if steps are
    not adapted.
    """
    one, zero = splat(1.0), splat(0.0)
    good = accepted = active
    trouble, tolerance = wary, load(limits.tolerance, 0)
    last, last_h = scheme.n_stages - 1, memory_row(rods, scheme, LAST_STEP)
    error_rate = zero
    for k in range(scheme.n_stages):
        stage = begin_stage(rods, work, scheme, k, q, v, a, h)
        freeze_contact(rods.contact, rods, work, stage, q)
        if any_lane(wary):
            start_standing(rods, work, stage, frame_velocity(rods.current, rods, q, v), wary)
        freeze_fluid(rods, work)
        freeze_strains(rods.damping, rods, work, stage.q_hat)
        set_natural_hub_angles(rods, work, actuation, start + load_number(scheme.c, k) * size)
        left = limits.most_iterations - load(report, NEWTON_ITERATIONS)
        most, good = select(left < patience, left, patience), good & (left > 0.0)
        good, phi, iterations, repairs, backtracks = minimise(rods, work, stage, good, tolerance, most)
        settle_momentum(rods, work, stage, good)
        good = those_uncrossed(rods.contact, rods, work, stage, q, good)
        trouble = trouble | (repairs + backtracks > 0.0)
        if scheme.dissipative:
            lively = phi > load(rods.scales.damped, 0)
            calm = good & ~trouble & lively & (phi <= load(rods.foresight.calm, 0))
            if any_lane(calm):
                gaining = may_gain(rods.current, rods.added_mass, rods, work, stage, phi, calm)
                lively = (lively & ~calm) | gaining
            trouble = trouble | lively
        add_to_report(report, NEWTON_ITERATIONS, iterations)
        add_to_report(report, REPAIRS, repairs)
        add_to_report(report, BACKTRACKS, backtracks)
        if k < last:
            end_stage(rods, work, scheme, k, stage, a, active)
        else:
            accepted = good
            if limits.adaptive and not scheme.dissipative:
                error_rate = step_error(rods, work, stage, a, h, load(a, last_h)) / h
                accepted = good & ((error_rate <= load(limits.error_rate, 0)) | (size <= SMALLEST_FRACTION))
                store(a, last_h, select(accepted, h, load(a, last_h)))
            guarded = accepted & trouble
            watch, allowed, frame = any_lane(guarded), zero, (zero, zero)
            if watch:
                set_aside(rods, work, scheme, q, v)
                frame = frame_velocity(rods.current, rods, q, v)
                allowed = allowed_energy(rods, work, scheme, actuation, start, start + size, q, v, frame)
            end_step(rods, work, scheme, stage, q, v, a, h, accepted)
            if watch:
                largest_cut = select(patience > MOST_HALVINGS * limits.max_iterations, one, LARGEST_CUT)
                allowed = add_work_of_current(rods.current, rods, work, v, h, frame, allowed)
                allowed = add_work_of_loads(rods.load, rods, work, q, h, frame, allowed)
                refused, cut = hold_to_energy(rods, work, scheme, q, v, h, frame, guarded, allowed, largest_cut)
                turnable = guarded & (patience <= TURNABLE * limits.max_iterations)
                refused = refused | through_poles(rods, work, q, turnable)
                if any_lane(refused):
                    put_back(rods, work, scheme, q, v, refused)
                good, accepted = good & ~refused, accepted & ~refused
                add_to_report(report, ENERGY_CUTS, select(cut, one, zero))
    return good, accepted, error_rate


@kernel
def add_to_report(report, row, amount):
    store(report, row, load(report, row) + amount)


@kernel
def note_hub_angles(rods, q, robots, report):
    """Keep the smallest tan(phi/2) of the hub hinges of the robots in the mask, but for gaps of more than pi."""
    smallest = load(report, SMALLEST_HUB_T)
    edges = rods.nodes_per_limb - 1
    last = rods.n_limbs - 1
    first = edge_geometry(q, 0, last * edges + 1)
    for limb in range(rods.n_limbs):
        second = edge_geometry(q, 0, limb * edges + 1)
        t = half_angle(first, second, rods.hub.side)
        narrow = rods.hub.side * load(rods.hub.angle, limb - 1 if limb > 0 else last) >= 0.0
        smallest = select(robots & narrow & (t < smallest), t, smallest)
        first = second
    store(report, SMALLEST_HUB_T, smallest)


@kernel
def cover_interval(rods, work, scheme, fallback, actuation, q, v, a, duration, alive, limits, report):
    """Advance the robots in `alive` over an interval of `duration` [s], in place.

    A robot whose step does not converge in `limits.max_iterations`, or creates energy, halves it, alone, as often as it
    takes, and still covers the whole interval. After each halving it has as many more iterations and starts them where
    it stands; after CAUTIOUS halvings it goes on with the scheme `fallback` (implicit Euler); after MOST_HALVINGS it
    has failed and keeps its last good state. So has one that needs more than `limits.most_iterations` in the stroke.

    If steps are adapted, a robot also halves a step whose error is too large, doubles it when the error allows, and
    goes on with it in the next interval. After halvings for other reasons, a doubling takes one back: the first after
    SOONEST_GROWTH steps without trouble, the next after twice as many, so that a robot that cannot do with longer steps
    rarely tries them; none leads back from `fallback` to `scheme`, whose ringing may have been the trouble.

    No step is below SMALLEST_FRACTION: a robot that is stuck there tries again, and the halving counts. Steps are
    dyadic fractions of the interval, on the grid of their own size, so their sums are exact.

    Returns the mask of the robots that arrived.
    """
    zero, one = splat(0.0), splat(1.0)
    start, size, halvings = zero, one, zero
    streak, growth = zero, splat(SOONEST_GROWTH)  # accepted steps since the last trouble, and needed for a doubling
    if limits.adaptive:
        last_size = load(a, memory_row(rods, scheme, SIZE))
        size = select(last_size > 0.0, last_size, FIRST_FRACTION)
    moving = alive
    while any_lane(moving):
        # Robots do not wait for each other: those that are cautious go on when no other is left.
        steady = moving & (halvings < CAUTIOUS)
        going, tableau = moving, fallback
        if any_lane(steady):
            going, tableau = steady, scheme
        h, patience, wary = size * duration, (1.0 + halvings) * limits.max_iterations, going & (halvings > 0.0)
        good, accepted, error_rate = try_step(
            rods, work, tableau, actuation, q, v, a, start, size, h, going, wary, limits, patience, report
        )
        note_hub_angles(rods, q, going, report)
        stuck = going & ~good
        rejected = going & ~accepted
        cautious = going & ~steady
        if any_lane(stuck | cautious):
            forget_accelerations(rods, scheme, a, stuck | cautious)
        add_to_report(report, STEPS, select(accepted, one, zero))
        add_to_report(report, HALVINGS, select(stuck, one, zero))
        add_to_report(report, REJECTIONS, select(good & rejected, one, zero))
        add_to_report(report, COVERED, select(accepted, h, zero))
        start = select(accepted, start + size, start)
        size = select(rejected & (size > SMALLEST_FRACTION), 0.5 * size, size)
        spent = load(report, NEWTON_ITERATIONS) >= limits.most_iterations
        failed = stuck & ((halvings >= MOST_HALVINGS) | spent)
        halvings += select(stuck, one, zero)
        if limits.adaptive:
            # The error of a step of twice the length is about eight times as large, per time four times.
            small = GROWTH_MARGIN * error_rate <= load(limits.error_rate, 0)
            pairs = start / (2.0 * size)
            fits = accepted & small & (pairs == floor(pairs)) & (size < 1.0)
            streak = select(accepted & wary, streak + 1.0, zero)
            relieved = fits & (streak >= growth) & ~(halvings == CAUTIOUS)
            halvings -= select(relieved, one, zero)
            streak, growth = select(relieved, zero, streak), select(relieved, 2.0 * growth, growth)
            size = select((fits & ~wary) | relieved, 2.0 * size, size)
        alive = alive & ~failed
        moving = moving & ~failed & (start < 1.0)
    if limits.adaptive:
        store(a, memory_row(rods, scheme, SIZE), size)
    return alive
