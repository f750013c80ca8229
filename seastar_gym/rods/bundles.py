"""The bundles that every kernel gets: the coefficients of a star of rods, and the memory that the kernels work in.

A term that a scene does not name is None, in both bundles, and gone when compiled.
"""

from typing import NamedTuple

import numpy as np

from seastar_gym.lanes.registers import N_LANES
from seastar_gym.lanes.rows import aligned_rows
from seastar_gym.rods import body, linear
from seastar_gym.rods.body import Body
from seastar_gym.rods.contact import forces as contact
from seastar_gym.rods.newton import Scales
from seastar_gym.rods.star import EDGE_ROWS
from seastar_gym.rods.terms import along, clamp, damping, hub
from seastar_gym.rods.terms.added_mass import AddedMass
from seastar_gym.rods.terms.bending import Bending
from seastar_gym.rods.terms.current import Current
from seastar_gym.rods.terms.drag import Drag
from seastar_gym.rods.terms.inertia import Inertia
from seastar_gym.rods.terms.own import Own
from seastar_gym.rods.terms.stretching import Stretching


class Rods(NamedTuple):
    """Coefficients of a star of rods, term by term; each is described in the file of its term.

    n_limbs, edges_per_limb, n_edges, n_nodes: Numbers of limbs, of edges of a limb and of all, and of nodes.
    n_free: Number of places whose coordinates are unknowns: nodes, and a body's angle. n_places: Of places: those, and
        the roots of limbs on a body. n_points: Of those places, and of the corners of a body's outline.
    stretching, bending, hub, clamp: Coefficients of edges, hinges, hub hinges and a rigid hub.
    along: How actuators act on limbs along their length.
    inertia, drag, added_mass: Masses, drag, and the fluid that moves along.
    damping: Relaxation time tau [s], one row. current: How the fluid moves.
    load: Constant force per coordinate [N]. own: Forces of a user's own. contact: Who may touch whom.
    body: A body between the limbs. With one, masses, drag and `load` have rows for all places, see star.py.
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
    hub: hub.Hub
    clamp: clamp.Clamp | None
    along: along.Along | None
    inertia: Inertia
    drag: Drag
    added_mass: AddedMass | None
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
    system: The linear system. root_edges: Geometry of the root edges, see star.py.
    hub, clamp, along, damping, contact, body: Memory of these terms, each described in its file.
    stage_v: Velocities of the stages of a time step [m/s].
    normals: Unit normals of the edges where a stage began, or None in scenes that need none; see fluid.py.
    current: Velocity of the fluid at every node there [m/s], or None.
    added_mass: Mass of fluid at every node there, xx, xy, yy [kg], or None.
    """

    q: np.ndarray
    q_hat: np.ndarray
    v_hat: np.ndarray
    step: np.ndarray
    system: linear.System
    root_edges: np.ndarray
    hub: hub.HubWork
    clamp: clamp.ClampWork | None
    along: along.AlongWork | None
    damping: damping.DampingWork
    stage_v: np.ndarray
    normals: np.ndarray | None
    current: np.ndarray | None
    added_mass: np.ndarray | None
    contact: contact.ContactWork | None
    body: body.BodyWork | None


def make_work(rods: Rods, n_stages: int, again: bool = False, width: int = N_LANES) -> Work:
    """Zeroed memory for one lane group of such rods and a scheme of `n_stages` stages.

    again: Whether linear systems are solved for other right-hand sides, too, as they are with contact.
    width: Robots for whom kernels compute at a time.
    """
    n_limbs, n_edges, n_nodes, n_points = rods.n_limbs, rods.n_edges, rods.n_nodes, rods.n_points
    is_damped, has_normals = rods.damping is not None, rods.drag.across is not None or rods.added_mass is not None

    def rows(count):
        return aligned_rows(count, N_LANES)

    return Work(
        q=rows(2 * n_points),
        q_hat=rows(2 * n_points),
        v_hat=rows(2 * n_points),
        step=rows(2 * n_points),
        system=linear.memory(n_nodes, n_limbs, again or rods.contact is not None),
        root_edges=rows(EDGE_ROWS * n_limbs),
        hub=hub.memory(n_limbs),
        clamp=clamp.memory(rods.clamp, is_damped, n_limbs),
        along=along.memory(rods.along, n_limbs, n_edges),
        damping=damping.memory(is_damped, n_edges),
        stage_v=rows(2 * rods.n_free * n_stages),
        normals=rows(2 * n_nodes) if has_normals else None,
        current=None if rods.current is None else rows(2 * rods.n_places),
        added_mass=None if rods.added_mass is None else rows(3 * rods.n_places),
        contact=contact.memory(rods.contact, n_limbs, rods.edges_per_limb, n_points, width),
        body=body.memory(rods.body, n_limbs, n_stages),
    )
