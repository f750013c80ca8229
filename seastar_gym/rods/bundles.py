"""The bundles that every kernel gets: the coefficients of a star of rods, and the memory that the kernels work in.

A term that a scene does not name is None, in both bundles, and gone when compiled.
"""

from typing import NamedTuple

import numpy as np

from seastar_gym.lanes.registers import N_LANES
from seastar_gym.lanes.rows import aligned_rows
from seastar_gym.rods import body
from seastar_gym.rods.body import Body
from seastar_gym.rods.contact import forces as contact
from seastar_gym.rods.linear import NODE_ROWS, RING_ROWS, ROOT_ROWS
from seastar_gym.rods.newton import Scales
from seastar_gym.rods.star import EDGE_ROWS
from seastar_gym.rods.terms.along import ALONG_ROWS, Along
from seastar_gym.rods.terms.bending import Bending
from seastar_gym.rods.terms.clamp import Clamp
from seastar_gym.rods.terms.current import Current
from seastar_gym.rods.terms.hub import Hub
from seastar_gym.rods.terms.own import Own
from seastar_gym.rods.terms.stretching import Stretching


class Rods(NamedTuple):
    """Coefficients of a star of rods, term by term; each is described in the file of its term.

    n_limbs, edges_per_limb, n_edges, n_nodes: Numbers of limbs, of edges of a limb and of all, and of nodes.
    n_free: Number of places whose coordinates are unknowns: nodes, and a body's angle. n_places: Of places: those, and
        the roots of limbs on a body. n_points: Of those places, and of the corners of a body's outline.
    stretching, bending, hub: Coefficients of edges, hinges and hub hinges.
    clamp: Rigid hub; edge_mass, edge_added_mass: What consistent masses take from lumped ones [kg]; middle_drag,
        middle_cross_drag: Drag in the middle of edges, and that of flow across [kg/m]; per edge. All are those of the
        continuum's discretisation.
    along: How actuators act on limbs along their length.
    mass: Lumped mass, per node [kg]. drag: 1/2 rho_f C_d D dl_i of (13.8), per node [kg/m].
    cross_drag, added_mass: Coefficients of flow across half edges [kg/m], [kg]; two rows per node.
    damping: Relaxation time tau [s], one row. current: How the fluid moves.
    load: Constant force per coordinate [N]. own: Forces of a user's own. contact: Who may touch whom.
    body: A body between the limbs. With one, `mass`, `drag` and `load` have rows for all places, see star.py.
    scales: Scales of the robot that decide what Newton's method and the guard look at.
    """

    n_limbs: int
    edges_per_limb: int
    n_edges: int
    n_nodes: int
    n_free: int
    n_places: int
    n_points: int
    stretching: Stretching
    bending: Bending
    hub: Hub
    clamp: Clamp | None
    along: Along | None
    mass: np.ndarray
    edge_mass: np.ndarray | None
    drag: np.ndarray
    middle_drag: np.ndarray | None
    cross_drag: np.ndarray | None
    middle_cross_drag: np.ndarray | None
    added_mass: np.ndarray | None
    edge_added_mass: np.ndarray | None
    damping: np.ndarray | None
    current: Current | None
    load: np.ndarray | None
    own: Own | None
    contact: contact.Contact | None
    scales: Scales
    body: Body | None


class Work(NamedTuple):
    """Memory of one lane group; every array has shape (rows, N_LANES).

    q, q_hat, v_hat: Iterate, start of the stage and its velocity, per coordinate [m, m/s].
    step: Last Newton step taken, per coordinate [m].
    factors, ring, root_factors, root_solution: The linear system, see linear.py.
    root_edges: Geometry of the root edges, see star.py.
    hub_moment, hub_stiffness: Sums over the hub hinges, or clamps, of a limb's root edge, per limb [N m].
    hub_coupling: 2 x 2 block of every hub hinge, four rows per limb [N/m]; stiffnesses of clamps, see clamp.py [N m].
    hub_EI_kappa_bar: Natural moment of the hub hinges, per limb [N m].
    hub_t: tan(phi/2) of the hub hinges, per limb.
    hub_direction, hub_turn, hub_hat: Natural directions of a rigid hub's clamps, what root edges are turned from them,
        and their directions where a stage began, (x, y) per limb; None with hub hinges, hub_hat without damping.
    stiffening, EI_kappa_bar: Factor of a limb's bending stiffness with its reciprocal, and natural moments of hinges
        [N m], or None where actuators act at the hub only.
    stage_v: Velocities of the stages of a time step [m/s].
    normals: Unit normals of the edges where a stage began, or None in scenes that need none; see fluid.py.
    current: Velocity of the fluid at every node there [m/s], or None.
    added_mass: Mass of fluid at every node there, xx, xy, yy [kg], or None.
    pivots, root_pivots: For solutions of other right-hand sides, see linear.py, or None where nobody asks.
    contact: Memory of contact, or None.
    tension, bending: EA eps [N] and EI kappa [N m] of edges and hinges where a stage began, or None without damping.
    body: Memory of a body, or None.
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
    hub_direction: np.ndarray | None
    hub_turn: np.ndarray | None
    hub_hat: np.ndarray | None
    stiffening: np.ndarray | None
    EI_kappa_bar: np.ndarray | None
    stage_v: np.ndarray
    normals: np.ndarray | None
    current: np.ndarray | None
    added_mass: np.ndarray | None
    pivots: np.ndarray | None
    root_pivots: np.ndarray | None
    contact: contact.ContactWork | None
    tension: np.ndarray | None
    bending: np.ndarray | None
    body: body.BodyWork | None


def make_work(rods: Rods, n_stages: int, again: bool = False, width: int = N_LANES) -> Work:
    """Zeroed memory for one lane group of such rods and a scheme of `n_stages` stages.

    again: Whether linear systems are solved for other right-hand sides, too, as they are with contact.
    width: Robots for whom kernels compute at a time.
    """
    n_limbs, n_edges, n_nodes, n_points = rods.n_limbs, rods.n_edges, rods.n_nodes, rods.n_points

    def rows(count):
        return aligned_rows(count, N_LANES)

    return Work(
        q=rows(2 * n_points),
        q_hat=rows(2 * n_points),
        v_hat=rows(2 * n_points),
        step=rows(2 * n_points),
        factors=rows(NODE_ROWS * n_nodes),
        ring=rows(RING_ROWS * n_limbs),
        root_factors=rows(ROOT_ROWS * n_limbs),
        root_solution=rows(2 * (n_limbs + 2)),
        root_edges=rows(EDGE_ROWS * n_limbs),
        hub_moment=rows(n_limbs),
        hub_stiffness=rows(n_limbs),
        hub_coupling=rows(4 * n_limbs),
        hub_EI_kappa_bar=rows(n_limbs),
        hub_t=rows(n_limbs),
        hub_direction=None if rods.clamp is None else rows(2 * n_limbs),
        hub_turn=None if rods.clamp is None else rows(2 * n_limbs),
        hub_hat=None if rods.clamp is None or rods.damping is None else rows(2 * n_limbs),
        stiffening=None if rods.along is None else rows(ALONG_ROWS * n_limbs),
        EI_kappa_bar=None if rods.along is None else rows(n_edges),
        stage_v=rows(2 * rods.n_free * n_stages),
        normals=None if rods.cross_drag is None and rods.added_mass is None else rows(2 * n_nodes),
        current=None if rods.current is None else rows(2 * rods.n_places),
        added_mass=None if rods.added_mass is None else rows(3 * rods.n_places),
        pivots=rows(2 * n_nodes) if again or rods.contact is not None else None,
        root_pivots=rows(2 * (n_limbs + 1)) if again or rods.contact is not None else None,
        contact=contact.memory(rods.contact, n_limbs, rods.edges_per_limb, n_points, width),
        tension=None if rods.damping is None else rows(n_edges),
        bending=None if rods.damping is None else rows(n_edges),
        body=body.memory(rods.body, n_limbs, n_stages),
    )
