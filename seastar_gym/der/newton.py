"""Newton's method with a backtracking line search, (13.11), on the incremental potential of one implicit stage.

Every robot of a lane group has its own state of the search: a robot that has converged, failed or was never active
is frozen by a mask, and nothing that one robot needs (a repair, a shorter step) changes another robot's bits.
"""

from seastar_gym.der.compilation import kernel
from seastar_gym.der.lanes import add_product, any_lane, load, select, splat, sqrt, store
from seastar_gym.der.potential import newton_direction
from seastar_gym.der.rods import n_nodes

SUFFICIENT_DECREASE = 1e-4  # Armijo's constant
ROUNDING = 1e-11  # an increase of Phi below this share of it is taken for rounding, not for ascent
SHORTEST_STEP = 2.0**-30  # of the Newton step: shorter ones move nothing


@kernel
def minimise(rods, work, gamma, active, tolerance, max_iterations):
    """Minimise Phi over work.q, in place, for the robots in the mask `active`.

    tolerance: Largest node move of the last Newton step [m].

    Returns (converged, iterations, repairs, backtracks): a mask and three counts per robot.
    """
    zero, one = splat(0.0), splat(1.0)
    inverse_gamma = 1.0 / gamma
    nobody = one < zero
    running, converged, convex = active, nobody, nobody
    iterations, repairs, backtracks = zero, zero, zero
    best, expected, fraction = splat(1e300), zero, one
    while any_lane(running):
        phi, decrement, pivot = newton_direction(rods, work, gamma, inverse_gamma, convex)
        low_enough = phi <= best - SUFFICIENT_DECREASE * fraction * expected + ROUNDING * best
        indefinite = running & low_enough & ~(pivot > 0.0) & ~convex
        if any_lane(indefinite):
            # Their matrices are made again from convex parts; the others wait and find the same numbers again.
            convex = convex | indefinite
            repairs += select(indefinite, one, zero)
            continue
        stepping = running & low_enough & (pivot > 0.0)
        shortening = running & ~low_enough & (fraction > SHORTEST_STEP) & (iterations > 0.0)
        fraction = select(stepping, one, select(shortening, 0.5 * fraction, fraction))
        move = take_step(rods, work, stepping, shortening, fraction)
        best = select(stepping, phi, best)
        expected = select(stepping, decrement, expected)
        convex = convex & ~stepping
        count = select(stepping, one, zero)
        iterations += count
        backtracks += select(shortening, one, zero)
        done = stepping & (move <= tolerance)
        converged = converged | done
        running = (stepping | shortening) & ~done & (iterations < max_iterations)
    return converged, iterations, repairs, backtracks


@kernel
def take_step(rods, work, stepping, shortening, fraction):
    """Move q by the full new Newton step where `stepping`, back by half the last move where `shortening`.

    Returns the largest node move [m].
    """
    largest = splat(0.0)
    for node in range(n_nodes(rods)):
        moved = splat(0.0)
        for row in range(2 * node, 2 * node + 2):
            step = select(stepping, -load(work.solution, row), load(work.step, row))
            move = select(stepping, step, select(shortening, -fraction * step, 0.0))
            store(work.step, row, step)
            store(work.q, row, load(work.q, row) + move)
            moved = add_product(moved, move, move)
        largest = select(moved > largest, moved, largest)
    return sqrt(largest)
