"""An interval between two corners of a time grid, covered by steps that every robot halves and doubles for itself."""

from seastar_gym.der.contact.crossing import deepest_overlap
from seastar_gym.der.geometry import edge_geometry, half_angle
from seastar_gym.der.star import tail_node
from seastar_gym.der.stepping.report import (
    COVERED,
    HALVINGS,
    LARGEST_OVERLAP,
    REJECTIONS,
    SMALLEST_HUB_T,
    STEPS,
    add_to_report,
    iterations_spent,
)
from seastar_gym.der.stepping.stages import SIZE, forget_accelerations, memory_row
from seastar_gym.der.stepping.steps import MOST_HALVINGS, SMALLEST_FRACTION, Step, try_step
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import any_lane, floor, load, select, splat, store

FALLBACK_AFTER = 4.0  # halvings, a choice: from there on a robot's steps are implicit Euler's
SOONEST_GROWTH = 4.0  # steps after a halving before a step is doubled, a choice; the next doubling waits twice as long
FIRST_FRACTION = 2.0**-3  # of an interval, a choice: an adapted stroke begins with this step
GROWTH_MARGIN = 5.0  # how far below the limit a doubled step's error rate has to be, which is then four times as large


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
    it stands; after FALLBACK_AFTER halvings it goes on with the scheme `fallback` (implicit Euler); after MOST_HALVINGS
    it has failed and keeps its last good state. So has one that needs more than `limits.most_iterations` in the stroke.

    If steps are adapted, a robot also halves a step whose error is too large, doubles it when the error allows, and
    goes on with it in the next interval. After halvings for other reasons, a doubling takes one back: the first after
    SOONEST_GROWTH accepted steps, the next after twice as many, so that a robot that cannot do with longer steps rarely
    tries them; none leads back from `fallback` to `scheme`, whose ringing may have been the reason.

    No step is below SMALLEST_FRACTION: a robot that is stuck there tries again, and the halving counts. Steps are
    dyadic fractions of the interval, on the grid of their own size, so their sums are exact.

    Returns the mask of the robots that arrived.
    """
    zero, one = splat(0.0), splat(1.0)
    start, size, halvings = zero, one, zero
    streak, growth = zero, splat(SOONEST_GROWTH)  # accepted steps since the last halving, and needed for a doubling
    if limits.adaptive:
        last_size = load(a, memory_row(rods, scheme, SIZE))
        size = select(last_size > 0.0, last_size, FIRST_FRACTION)
    moving = alive
    while any_lane(moving):
        # Robots do not wait for each other: those on the fallback go on when no other is left.
        on_scheme = moving & (halvings < FALLBACK_AFTER)
        going, tableau = moving, fallback
        if any_lane(on_scheme):
            going, tableau = on_scheme, scheme
        retrying = going & (halvings > 0.0)
        step = Step(start, size, size * duration, (1.0 + halvings) * limits.max_iterations, retrying)
        good, accepted, error_rate = try_step(rods, work, tableau, actuation, q, v, a, step, going, limits, report)
        note_hub_angles(rods, q, going, report)
        note_overlap(rods, work, q, accepted, report)
        stuck = going & ~good
        rejected = going & ~accepted
        on_fallback = going & ~on_scheme
        if any_lane(stuck | on_fallback):
            forget_accelerations(rods, scheme, a, stuck | on_fallback)
        add_to_report(report, STEPS, select(accepted, one, zero))
        add_to_report(report, HALVINGS, select(stuck, one, zero))
        add_to_report(report, REJECTIONS, select(good & rejected, one, zero))
        add_to_report(report, COVERED, select(accepted, step.h, zero))
        start = select(accepted, start + size, start)
        size = select(rejected & (size > SMALLEST_FRACTION), 0.5 * size, size)
        spent = iterations_spent(report) >= limits.most_iterations
        failed = stuck & ((halvings >= MOST_HALVINGS) | spent)
        halvings += select(stuck, one, zero)
        if limits.adaptive:
            # The error of a step of twice the length is about eight times as large, per time four times.
            small = GROWTH_MARGIN * error_rate <= load(limits.error_rate, 0)
            pairs = start / (2.0 * size)
            fits = accepted & small & (pairs == floor(pairs)) & (size < 1.0)
            streak = select(accepted & retrying, streak + 1.0, zero)
            relieved = fits & (streak >= growth) & ~(halvings == FALLBACK_AFTER)
            halvings -= select(relieved, one, zero)
            streak, growth = select(relieved, zero, streak), select(relieved, 2.0 * growth, growth)
            size = select((fits & ~retrying) | relieved, 2.0 * size, size)
        alive = alive & ~failed
        moving = moving & ~failed & (start < 1.0)
    if limits.adaptive:
        store(a, memory_row(rods, scheme, SIZE), size)
    return alive
