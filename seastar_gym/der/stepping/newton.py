"""Newton's method with a backtracking line search, (13.11), on the incremental potential of one implicit stage.

Every robot of a lane group has its own state of the search: a robot that has converged, failed or was never active is
frozen by a mask, and nothing that one robot needs (a regularised matrix, a shorter step) changes another robot's bits.
"""

from seastar_gym.der.body.body import place_roots, tail_solution
from seastar_gym.der.contact.contact import n_listed
from seastar_gym.der.contact.coupled import solve_coupled
from seastar_gym.der.geometry import larger
from seastar_gym.der.linear.star_matrix import load_pair, store_pair, substitute_node
from seastar_gym.der.potential import factorise
from seastar_gym.der.stepping.skip_last import can_skip, quadratic_length
from seastar_gym.simd.compilation import inlined_kernel, kernel
from seastar_gym.simd.lanes import absolute, add_product, any_lane, load, select, splat, sqrt

SUFFICIENT_DECREASE = 1e-4  # Armijo's constant
ROUNDING = 1e-11  # an increase of Phi below this share of it is taken for rounding, not for ascent
SHORTEST_STEP = 2.0**-30  # of the Newton step: shorter ones move nothing


@inlined_kernel
def minimise(rods, work, stage, active, tolerance, iteration_limit):
    """Minimise Phi over work.q, in place, for the robots in the mask `active`.

    tolerance: Largest node move of the last Newton step [m], or of the one that is left out because it is predictable,
        see skip_last.py. iteration_limit: Most Newton steps per robot.

    Returns (converged, Phi, iterations, regularised, backtracks), per robot: a mask, the potential before the last step
    [J], and counts of Newton steps, of those with a convex matrix, and of shortened ones.
    """
    zero, one = splat(0.0), splat(1.0)
    length = quadratic_length(rods, stage)
    nobody = one < zero
    running, converged, convex = active, nobody, nobody
    iterations, regularised, backtracks = zero, zero, zero
    best, expected, fraction = splat(1e300), zero, one
    while any_lane(running):
        if any_lane(convex):
            phi, decrement, pivot = factorise(rods, work, stage, convex)
        else:
            phi, decrement, pivot = factorise(rods, work, stage, None)
        low_enough = phi <= best - SUFFICIENT_DECREASE * fraction * expected + ROUNDING * absolute(best)
        indefinite = running & low_enough & ~(pivot > 0.0) & ~convex
        if any_lane(indefinite):
            # Their matrices are made again from convex parts; the others wait and find the same numbers again.
            convex = convex | indefinite
            regularised += select(indefinite, one, zero)
            continue
        stepping = running & low_enough & (pivot > 0.0)
        decrement = solve_coupled(rods, work, stepping, decrement)
        shortening = running & ~low_enough & (fraction > SHORTEST_STEP) & (iterations > 0.0)
        fraction = select(stepping, one, select(shortening, 0.5 * fraction, fraction))
        if any_lane(shortening):
            move = move_along(rods, work, stepping, shortening, fraction)
        else:
            move = move_along(rods, work, stepping, None, fraction)
        best = select(stepping, phi, best)
        expected = select(stepping, decrement, expected)
        count = select(stepping, one, zero)
        iterations += count
        backtracks += select(shortening, one, zero)
        foreseen = can_skip(rods, work, iterations, regularised + backtracks, phi, move, tolerance * length)
        done = stepping & ((move <= tolerance) | (~convex & foreseen))
        converged = converged | done
        convex = convex & ~stepping
        running = (stepping | shortening) & ~done & (iterations < iteration_limit)
    return converged, best, iterations, regularised, backtracks


@kernel
def take_step(rods, work, stepping, shortening, fraction):
    """Substitute, and move q by the whole new Newton step where `stepping`, back by half the last where `shortening`.

    shortening: None if no robot's step is to be shortened.

    Returns the largest node move [m].
    """
    edges = rods.edges_per_limb
    scale = step_scale(stepping, shortening, fraction)
    hub = load_pair(work.root_solution, 2 * rods.n_limbs)
    largest = move_node(work, 0, hub, shortening, scale)
    largest = move_angle(rods, work, work.root_solution, 2 * rods.n_limbs + 2, shortening, scale, largest)
    for limb in range(rods.n_limbs):
        first = limb * edges
        before = tail_solution(rods, work, limb, hub)
        here = load_pair(work.root_solution, 2 * limb)
        largest = larger(largest, move_node(work, first + 1, here, shortening, scale))
        for i in range(2, edges + 1):
            before, here = here, substitute_node(work, first + i, here[0], here[1], before[0], before[1])
            largest = larger(largest, move_node(work, first + i, here, shortening, scale))
    place_roots(rods, work.q)
    return sqrt(largest)


@kernel
def move_angle(rods, work, solution, row, shortening, scale, largest):
    """Move a body's angle by `scale` times its step, from a row of solutions [rad].

    Returns the largest move squared; unchanged without a body.
    """
    if rods.body is None:
        return largest
    arc = load(rods.body.scale, 0) * load(solution, row)
    return larger(largest, move_node(work, rods.n_nodes, (arc, splat(0.0)), shortening, scale))


@kernel
def move_along(rods, work, stepping, shortening, fraction):
    """take_step, but where contact is listed along the step of all nodes that coupled.py has found."""
    if work.contact is None or n_listed(work) == 0:
        return take_step(rods, work, stepping, shortening, fraction)
    scale, largest = step_scale(stepping, shortening, fraction), splat(0.0)
    for node in range(rods.n_nodes):
        largest = larger(largest, move_node(work, node, load_pair(work.contact.x, 2 * node), shortening, scale))
    largest = move_angle(rods, work, work.contact.x, 2 * rods.n_nodes, shortening, scale, largest)
    place_roots(rods, work.q)
    return sqrt(largest)


@kernel
def step_scale(stepping, shortening, fraction):
    return select(stepping, splat(1.0), select(shortening, -fraction, 0.0))


@kernel
def move_node(work, node, solution, shortening, scale):
    """Move a node by `scale` times its step: its last where `shortening`, else -solution; returns the move squared.

    Where the scale is zero the node stays, whatever the solution is: that of a robot at rest may be no number.
    """
    x = select(shortening, load(work.step, 2 * node), -solution[0])
    y = select(shortening, load(work.step, 2 * node + 1), -solution[1])
    move_x, move_y = scale * x, scale * y
    store_pair(work.step, 2 * node, (x, y))
    stays = scale == 0.0
    qx, qy = load_pair(work.q, 2 * node)
    store_pair(work.q, 2 * node, (select(stays, qx, qx + move_x), select(stays, qy, qy + move_y)))
    return add_product(move_x * move_x, move_y, move_y)
