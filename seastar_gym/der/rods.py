"""The numbers of a star of rods as the kernels read them, and the memory that the kernels work in.

A star has `n_limbs` chains of nodes that share node 0, the hub. Node {j, i} (limb j from 0, i from 1) has index
j (nodes_per_limb - 1) + i. Edge e ends at node e + 1; it starts at the hub if it is the root edge of its limb, else
at node e. Hinge e ends with edge e: within a limb it sits at the tail of edge e, and for a root edge of limb j it is
the hub hinge from limb j to limb j + 1, whose first edge is the root edge of limb j. Two limbs have one hub hinge, one
limb has none: hinges that are not there have no stiffness.

Coefficients have shape (rows,) if all robots share them and (rows, N_LANES) if they differ from robot to robot:
`load` reads either, and every set of rods has coefficients of one of the two shapes.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from seastar_gym.der.geometry import EDGE_ROWS
from seastar_gym.der.linear.star_matrix import NODE_ROWS, RING_ROWS, ROOT_ROWS
from seastar_gym.der.terms.current import Current
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import N_LANES

CACHE_LINE = 64  # bytes
SHARED = ("velocities", "pairs")  # by all robots


SLOT_ROWS = 6
N_X, N_Y, SHARE, OFFSET, THICKNESS, STIFFNESS = range(SLOT_ROWS)
"""Rows of a listed pair of node and edge, see contact.py."""


MOST_NEAR_EDGES, SHORT_CHAIN = 3, 24
"""Edges of another limb that a node can be near to, in the mean over the nodes: all, in chains of SHORT_CHAIN edges or
fewer. In longer ones a node that is not crumpled is near to one or two."""


class Contact(NamedTuple):
    """Who may touch whom, see contact.py.

    n_pairs, pairs: Limbs that may touch, (right, left) each, counted from 0, shape (2 n_pairs,), for all robots.
    thickness: Distance from the centre line at which a node is touched [m]. widest: Twice the largest [m].
    stiffness: Of a touched node [N/m].
    """

    n_pairs: int
    pairs: np.ndarray
    thickness: np.ndarray
    widest: np.ndarray
    stiffness: np.ndarray


class ContactWork(NamedTuple):
    """Memory of contact; rows per coordinate but for `listed`, `slots`, `own`, `missed` and `touching`.

    share: Most pairs of node and edge of one robot that can be listed. own: How many are.
    listed: How many are of all robots together, then node and edge of each, shared. slots: SLOT_ROWS of each.
    missed: 1 for robots whose pairs did not all fit into their share, or whose step was not found.
    touching: 1 for robots that touch.
    ends: Positions where contact is asked for [m]. seen: The same along the gap between two limbs and across it.
    force: Of contact [N].
    x, r, z, p, Hp, w: See coupled.py.
    """

    share: float
    listed: np.ndarray
    slots: np.ndarray
    own: np.ndarray
    missed: np.ndarray
    touching: np.ndarray
    ends: np.ndarray
    seen: np.ndarray
    force: np.ndarray
    x: np.ndarray
    r: np.ndarray
    z: np.ndarray
    p: np.ndarray
    Hp: np.ndarray
    w: np.ndarray


class Rods(NamedTuple):
    """Coefficients of a star of rods.

    EA: Stretching stiffness per edge [N].
    EA_over_l: The same over the edge's natural length, per edge [N/m].
    l_over_EA: Its reciprocal, per edge [m/N].
    EI_over_dl: Bending stiffness over Voronoi length, per hinge [N m].
    dl_over_EI: Its reciprocal, per hinge [1/(N m)].
    EI_kappa_bar: Natural moment, per hinge [N m]; that of hub hinges comes from the actuators instead.
    hub_side: +1 if hub hinges are measured by the opening angle, -1 if by the interior turning angle.
    hub_angle: The angle of the unactuated hub hinges, measured that way, per limb [rad].
    mass: Lumped mass, per node [kg].
    drag: 1/2 rho_f C_d D dl_i of (13.8), per node [kg/m].
    cross_drag: What flow across its edges adds to that, two rows per node, for half of its inner and of its outer edge
        (zero for hub and tips, which have none) [kg/m], or None; see drag.py.
    added_mass: Mass of fluid that these halves accelerate across themselves, likewise [kg], or None; see added_mass.py.
    relaxation_time: tau of material damping [s], one row, or None; see damping.py.
    current: How the fluid moves, or None; see current.py.
    load: Dead load per coordinate [N], or None.
    contact: Who may touch whom, or None; see contact.py.
    shortest_edge: Smallest natural length of an edge [m].
    curvature_rate: How fast Newton's foreseeable_length shrinks with the step [1/s^2], see newton.py.
    calm: Potential [J] up to which Newton steps can be foreseen, see newton.py.
    damped: Potential [J] up to which drag takes more energy than a step without trouble may create, see guard.py; zero
        without drag.
    unsettled_rate: How much stiffer edges are than inertia, the more the longer the step [1/s^2], see momentum.py.
    held: Whether nodes are held, so that no frame but the laboratory's will do.
    """

    n_limbs: int
    nodes_per_limb: int
    EA: np.ndarray
    EA_over_l: np.ndarray
    l_over_EA: np.ndarray
    EI_over_dl: np.ndarray
    dl_over_EI: np.ndarray
    EI_kappa_bar: np.ndarray
    hub_side: float
    hub_angle: np.ndarray
    mass: np.ndarray
    drag: np.ndarray
    cross_drag: np.ndarray | None
    added_mass: np.ndarray | None
    relaxation_time: np.ndarray | None
    current: Current | None
    load: np.ndarray | None
    contact: Contact | None
    shortest_edge: np.ndarray
    curvature_rate: np.ndarray
    calm: np.ndarray
    damped: np.ndarray
    unsettled_rate: np.ndarray
    held: bool


@kernel
def tail_node(rods, e):
    """The node where edge e starts: the hub for a root edge."""
    return 0 if e % (rods.nodes_per_limb - 1) == 0 else e


@kernel
def n_nodes(rods):
    """Number of nodes of a star, with the hub."""
    return rods.n_limbs * (rods.nodes_per_limb - 1) + 1


def side_by_side(robots: Sequence[Any]) -> Any:
    """Bundles of shared rows, one for each of N_LANES robots, as one bundle of rows of shape (rows, N_LANES).

    What is not read by row stays shared: samples on a grid, limbs that may touch.
    """
    first = robots[0]
    columns = {name: [getattr(robot, name) for robot in robots] for name in first._fields}
    joined = {}
    for name, column in columns.items():
        if isinstance(column[0], np.ndarray) and name not in SHARED:
            joined[name] = np.stack(column, axis=1)
        elif hasattr(column[0], "_fields"):
            joined[name] = side_by_side(column)
    return first._replace(**joined)


def put_robot(bundle: Any, lane: int, robot: Any) -> None:
    """Write a robot's shared rows into its lane of a bundle made by `side_by_side`."""
    for rows, own in zip(bundle, robot, strict=True):
        if isinstance(own, np.ndarray) and rows.ndim == 2:
            rows[:, lane] = own
        elif hasattr(own, "_fields"):
            put_robot(rows, lane, own)


class Work(NamedTuple):
    """Memory of one lane group; every array has shape (rows, N_LANES).

    q, q_hat, v_hat: Iterate, start of the stage and its velocity, per coordinate [m, m/s].
    step: Last Newton step taken, per coordinate [m].
    factors, ring, root_factors, root_solution: The linear system, see star_matrix.py.
    root_edges: Geometry of the root edges, see geometry.py.
    hub_moment, hub_stiffness: Sums over the hub hinges of a limb's root edge, per limb [N m].
    hub_coupling: 2 x 2 block of every hub hinge, four rows per limb [N/m].
    hub_EI_kappa_bar: Natural moment of the hub hinges, per limb [N m].
    hub_t: tan(phi/2) of the hub hinges, per limb.
    stage_v: Velocities of the stages of a time step [m/s].
    normals: Unit normals of the edges where a stage began, or None in scenes that need none; see fluid.py.
    current: Velocity of the fluid at every node there [m/s], or None.
    added_mass: Mass of fluid at every node there, xx, xy, yy [kg], or None.
    pivots, root_pivots: For solutions of other right-hand sides, see star_solution.py, or None without contact.
    contact: Memory of contact, or None.
    tension, bending: EA eps [N] and EI kappa [N m] of edges and hinges where a stage began, or None without damping.
    """

    q: np.ndarray
    q_hat: np.ndarray
    v_hat: np.ndarray
    step: np.ndarray
    factors: np.ndarray
    ring: np.ndarray
    root_factors: np.ndarray
    root_solution: np.ndarray
    root_edges: np.ndarray
    hub_moment: np.ndarray
    hub_stiffness: np.ndarray
    hub_coupling: np.ndarray
    hub_EI_kappa_bar: np.ndarray
    hub_t: np.ndarray
    stage_v: np.ndarray
    normals: np.ndarray | None
    current: np.ndarray | None
    added_mass: np.ndarray | None
    pivots: np.ndarray | None
    root_pivots: np.ndarray | None
    contact: ContactWork | None
    tension: np.ndarray | None
    bending: np.ndarray | None


class Stage(NamedTuple):
    """An implicit stage: q_hat [m] and v_hat [m/s], rows per coordinate, gamma [s] and its reciprocal, lanes.

    ahead: Whether the scheme asks in the middle of a step, so that contact has to look ahead, see contact.py.
    """

    q_hat: Any
    v_hat: Any
    gamma: Any
    inverse_gamma: Any
    ahead: bool


class Limits(NamedTuple):
    """What a solution has to keep.

    tolerance: Largest node move of the last Newton update [m], one row.
    max_iterations: Newton steps per stage before a time step is halved.
    most_iterations: Newton steps per stroke before the robot has failed.
    adaptive: Whether time steps are adapted to their error.
    error_rate: Largest error per time [m/s], one row.
    """

    tolerance: np.ndarray
    max_iterations: int
    most_iterations: int
    adaptive: bool
    error_rate: np.ndarray


class Actuation(NamedTuple):
    """Rotation of every limb at the ends of an interval [rad], shape (n_limbs, N_LANES), linear in between."""

    delta_psi_start: np.ndarray
    delta_psi_end: np.ndarray


# Rows of a lane group's report, shape (len(REPORT_ROWS), N_LANES): what happened to its robots.
REPORT_ROWS = (
    "newton_iterations",
    "repairs",  # Newton steps that needed the convex matrix
    "backtracks",  # halvings of a Newton step by the line search
    "steps",  # time steps taken
    "halvings",  # halvings of a time step that did not converge
    "rejections",  # halvings of a time step whose error was too large
    "energy_cuts",  # steps after which velocities were cut, see guard.py
    "covered",  # time [s]
    "smallest_hub_t",  # smallest tan(phi/2) of a hub hinge
)
NEWTON_ITERATIONS, REPAIRS, BACKTRACKS, STEPS, HALVINGS, REJECTIONS, ENERGY_CUTS, COVERED, SMALLEST_HUB_T = range(
    len(REPORT_ROWS)
)


def aligned_rows(*shape: int) -> np.ndarray:
    """Zeros that begin at a cache line: with numpy alone most rows would straddle two."""
    size = int(np.prod(shape))
    buffer = np.zeros(size + CACHE_LINE // 8)
    start = -buffer.ctypes.data % CACHE_LINE // 8
    return buffer[start : start + size].reshape(shape)


def make_work(rods: Rods, n_stages: int) -> Work:
    """Zeroed memory for one lane group of such rods and a scheme of `n_stages` stages."""
    n_limbs, n_edges = rods.n_limbs, rods.n_limbs * (rods.nodes_per_limb - 1)
    n_nodes = n_edges + 1

    def rows(count):
        return aligned_rows(count, N_LANES)

    return Work(
        q=rows(2 * n_nodes),
        q_hat=rows(2 * n_nodes),
        v_hat=rows(2 * n_nodes),
        step=rows(2 * n_nodes),
        factors=rows(NODE_ROWS * n_nodes),
        ring=rows(RING_ROWS * n_limbs),
        root_factors=rows(ROOT_ROWS * n_limbs),
        root_solution=rows(2 * (n_limbs + 1)),
        root_edges=rows(EDGE_ROWS * n_limbs),
        hub_moment=rows(n_limbs),
        hub_stiffness=rows(n_limbs),
        hub_coupling=rows(4 * n_limbs),
        hub_EI_kappa_bar=rows(n_limbs),
        hub_t=rows(n_limbs),
        stage_v=rows(2 * n_nodes * n_stages),
        normals=None if rods.cross_drag is None and rods.added_mass is None else rows(2 * n_nodes),
        current=None if rods.current is None else rows(2 * n_nodes),
        added_mass=None if rods.added_mass is None else rows(3 * n_nodes),
        pivots=None if rods.contact is None else rows(2 * n_nodes),
        root_pivots=None if rods.contact is None else rows(2 * (n_limbs + 1)),
        contact=None if rods.contact is None else make_contact_work(rods, rods.contact),
        tension=None if rods.relaxation_time is None else rows(n_edges),
        bending=None if rods.relaxation_time is None else rows(n_edges),
    )


def make_contact_work(rods: Rods, contact: Contact) -> ContactWork:
    """Zeroed memory for the contact of one lane group, where robots list the pairs they have in common once."""
    edges = rods.nodes_per_limb - 1
    near_edges = edges if edges <= SHORT_CHAIN else MOST_NEAR_EDGES
    capacity = 2 * contact.n_pairs * edges * min(edges, near_edges * N_LANES)

    def rows(count: int = 2 * (rods.n_limbs * edges + 1)) -> np.ndarray:
        return aligned_rows(count, N_LANES)

    return ContactWork(
        share=float(2 * contact.n_pairs * edges * near_edges),
        listed=aligned_rows(2 * capacity + 1),
        slots=rows(SLOT_ROWS * capacity),
        own=rows(1),
        missed=rows(1),
        touching=rows(1),
        ends=rows(),
        seen=rows(),
        force=rows(),
        x=rows(),
        r=rows(),
        z=rows(),
        p=rows(),
        Hp=rows(),
        w=rows(),
    )
