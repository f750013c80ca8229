"""Newton's method with a backtracking line search, (13.11), on the incremental potential of one implicit stage.

Every robot of a lane group has its own state of the search: a robot that has converged, failed or was never active is
frozen by a mask, and nothing that one robot needs (a regularised matrix, a shorter step) changes another robot's bits.

Newton's last step may be left out where quadratic convergence foretells that it would be small enough. After one of its
first steps, of size d, the next is expected to be at most d^2/(quadratic length). That is measured, not proved: by
`studies.speed.foresight` of commit 0e818f3, in 1000 strokes of every kind by eight robots, stiff and soft, with edges
of 3 to 50 radii, at steps of 0.1 to 20 ms, in water and in vacuum. Had every step been just small enough, the one left
out would have been

    99 %     99.9 %    worst
    0.7      1.6       18       times as large as foreseen
    19       43        190      times d^2 over the edge length, where edges are light: CURVATURE
    0.4      0.9       2        times as large as foreseen, where edges of 70 to 500 radii are stiff against inertia
    2900     840                as SLENDER would allow for it, where edges are thick and stiff
    1.9      4.3       23       times as large as foreseen without LATE, after the third step
    0.2      0.5       1e3      times as large as foreseen after the third step, EASY, in violent motion
    0.4      1e6       2e8      the same after the fifth
    1.2      3         40       times as large where the largest hub t is 2 to 4, which is FORESEEABLE_T, of thick limbs
    3.7      24        30       the same from 10 to 40

With a rigid hub, which has no poles, the numbers of the first, second, third and fifth line are 0.9, 1.8 and 9; 26, 51
and 220 times d^2 over the edge length; 0.8, 1.7 and 3; 2.6, 5.8 and 15 (300 strokes of every kind).

In water with hub hinges near their poles, steps from potentials below a tenth of that of PREDICTABLE_STRAIN created no
energy; 0.02 % did up to PREDICTABLE_STRAIN, 0.1 % up to ten times and 0.5 % up to a hundred times as much. Where the
curvature of drag, about l rho_f C_d/(pi r rho_m), is ten times CURVATURE, as with edges of a thousand radii, no step is
left out: one that was had been 300 times the tolerance.

`coefficients` has the scales of a robot that decide what Newton's method, the guard and the balance of momentum look
at.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seastar_gym.lanes.compile import inlined_kernel, kernel
from seastar_gym.lanes.registers import absolute, add_product, any_lane, load, select, splat, sqrt
from seastar_gym.rods.body import place_roots, tail_solution
from seastar_gym.rods.contact.coupled import solve_coupled
from seastar_gym.rods.contact.forces import n_listed, not_touching
from seastar_gym.rods.linear import load_pair, store_pair, substitute_node
from seastar_gym.rods.potential import factorise
from seastar_gym.rods.star import Mesh, larger, mean
from seastar_gym.rods.terms.drag import drag_per_length
from seastar_gym.rods.terms.stretching import Stretching

CURVATURE = 40.0  # for light edges, the step after one of size d is below this times d^2 over the edge length
EASY = 3.0  # Newton steps: a stage that took more is not predictable
LATE = 10.0  # times CURVATURE for the last of the easy steps
FORESEEABLE_T = 4.0  # larger values of tan(phi/2) are too near its pole for that


@inlined_kernel
def can_skip(rods, work, iterations, setbacks, phi, move, tolerated):
    """Mask of the robots whose next Newton step is expected to be small enough.

    iterations, setbacks: Newton steps so far, and how many of them were shortened or needed a convex matrix. phi:
    Potential before the step [J]. move: Largest node move of the step [m]. tolerated: Tolerance times the quadratic
    length [m^2].
    """
    easy = (setbacks <= 0.0) & (iterations <= EASY) & (phi <= load(rods.scales.predictable, 0))
    easy = not_touching(work, easy)
    late = select(iterations < EASY, splat(1.0), LATE)
    foreseen = late * move * move <= tolerated
    return easy & foreseen & (largest_hub_t(rods, work) < FORESEEABLE_T)


@kernel
def quadratic_length(rods, stage):
    """Length [m] that a Newton step's square is divided by to foresee the size of the next one.

    Turning an edge stretches it, and the tension that this makes moves nodes the farther, the stiffer the edges are
    against the nodes' inertia.
    """
    rate = load(rods.scales.curvature_rate, 0)
    return load(rods.scales.shortest_edge, 0) / (CURVATURE + rate * stage.gamma * stage.gamma)


@kernel
def largest_hub_t(rods, work):
    """Largest tan(phi/2) of the hub hinges, as last assembled."""
    largest = load(work.hub.t, 0)
    for limb in range(1, rods.n_limbs):
        largest = larger(load(work.hub.t, limb), largest)
    return largest


SUFFICIENT_DECREASE = 1e-4  # Armijo's constant
ROUNDING = 1e-11  # an increase of Phi below this share of it is taken for rounding, not for ascent
SHORTEST_STEP = 2.0**-30  # of the Newton step: shorter ones move nothing


@inlined_kernel
def minimise(rods, work, stage, active, tolerance, iteration_limit):
    """Minimise Phi over work.q, in place, for the robots in the mask `active`.

    tolerance: Largest node move of the last Newton step [m], or of the one that is left out because it is predictable,
        see newton.py. iteration_limit: Most Newton steps per robot.

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
    hub = load_pair(work.system.root_solution, 2 * rods.n_limbs)
    largest = move_node(work, 0, hub, shortening, scale)
    largest = move_angle(rods, work, work.system.root_solution, 2 * rods.n_limbs + 2, shortening, scale, largest)
    for limb in range(rods.n_limbs):
        first = limb * edges
        before = tail_solution(rods, work, limb, hub)
        here = load_pair(work.system.root_solution, 2 * limb)
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


SLENDER = 5000.0  # square of an edge's length over its radius: slenderer edges do not curve the potential more
PREDICTABLE_STRAIN = 1e-3  # over EA times length of all limbs, were they as the weakest: more is a violent motion

MOST_CURVED = 10.0  # times CURVATURE: no Newton step is predictable where drag curves the potential more


class Scales(NamedTuple):
    """One row each, but for `held`.

    shortest_edge: Smallest natural length of an edge [m].
    curvature_rate: How fast the quadratic length shrinks with the step [1/s^2], see newton.py.
    predictable: Potential [J] up to which Newton steps are predictable, see newton.py; none is where drag on slender
        edges curves the potential more than that allows for.
    damped: Potential [J] up to which drag takes more energy than an unregularised step may create, see guard.py; zero
        without drag.
    stiffness_ratio: How much stiffer edges are than inertia, the more the longer the step [1/s^2], see guard.py.
    free_mass: Of the nodes that are not held [kg].
    held: Whether nodes are held, so that no frame but the laboratory's will do.
    """

    shortest_edge: np.ndarray
    curvature_rate: np.ndarray
    predictable: np.ndarray
    damped: np.ndarray
    stiffness_ratio: np.ndarray
    free_mass: np.ndarray
    held: bool


def coefficients(
    mesh: Mesh,
    stretching: Stretching,
    density: float,
    fluid_density: float,
    C_d: float,
    mass: np.ndarray,
    held_nodes: Sequence[int],
) -> Scales:
    """Scales of a robot in a fluid (density or drag coefficient zero: vacuum), from its shortest, thinnest and stiffest
    edges, and its masses per node [kg].
    """
    shortest, thinnest = float(mesh.root_edges.min()), float(mesh.at_nodes.thickness.min())
    slenderness = min(1.0, (shortest / thinnest) ** 2 / SLENDER)
    rate = float(mesh.modulus_at_nodes.max()) / (density * shortest**2) * slenderness
    length, EA = mean(mesh.limb_lengths), [mean(of_limb) for of_limb in stretching.EA.reshape(mesh.n_limbs, -1)]
    energy = float(np.min(PREDICTABLE_STRAIN * np.array(EA) * mesh.n_limbs * np.asarray(mesh.limb_lengths)))
    area = mesh.per_node(mesh.at_nodes.inert)
    broadside = mean(mesh.per_node(drag_per_length(fluid_density, C_d, mesh.at_nodes.width)))
    drag_curvature = broadside / (density * float(area.min())) * float(mesh.dl.max())
    stiffness_over_mass = float((stretching.EA_over_l / (density * area * mesh.dl)[1:]).max())
    edges = mesh.nodes_per_limb - 1
    return Scales(
        shortest_edge=np.array([shortest]),
        curvature_rate=np.array([rate]),
        predictable=np.array([energy if drag_curvature <= MOST_CURVED * CURVATURE else -np.inf]),
        damped=np.array([energy * min(1.0, broadside * length / (density * mean(area)))]),
        stiffness_ratio=np.array([stiffness_over_mass * edges**2 if broadside > 0.0 else np.inf]),
        free_mass=np.array([np.delete(mass, held_nodes).sum()]),
        held=bool(held_nodes),
    )


def of_unknown_forces(scales: Scales) -> Scales:
    """Scales where forces act of which no study measured how they curve the potential or drive the robot.

    No Newton step is predictable, the guard looks at all steps of implicit Euler, and energies are judged in the
    laboratory, where an energy of places stands still.
    """
    nothing = np.array([-np.inf])
    return scales._replace(predictable=nothing, damped=nothing, held=True)


class Limits(NamedTuple):
    """Tolerances and bounds of the solution of a stroke, that a scene names.

    tolerance: Largest displacement of a node in the last Newton update [m], one row.
    max_iterations: Newton steps of a stage before its time step is halved.
    most_iterations: Newton steps of a stroke before the robot has failed.
    """

    tolerance: np.ndarray
    max_iterations: int
    most_iterations: int
