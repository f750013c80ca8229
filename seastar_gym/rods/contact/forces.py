"""Contact of limbs with each other and with a body: a penalty on how deep nodes of one lie in edges of another.

A node at x and the point y = (1 - s) x_j + s x_k of an edge have the gap g = n (x - y), n the edge's normal to the side
on which the node's limb belongs. Where g is below d, their thicknesses' sum, elastic cylinders side by side store

    V = k (d - g)^2 / 2,    k the contact modulus times half the node's Voronoi length,

half, because the nodes of either limb meet the edges of the other. A node that stands at a hinge meets both of its
edges, and V is shared among them so that it counts once wherever it stands: otherwise limbs that slide along each other
gain energy at every hinge, which no mesh and no step resolves. The shared edges are continued beyond their ends, s may
be below 0 and above 1, so that forces turn nobody; but not on a body, where s is kept within. Who is near whom, n and s
are taken from the first guess of a stage, see fluid.py: g is linear in the places, V convex in them, k c c^T its
Hessian, c the gradient of g, and the forces on node and edge cancel. That Hessian couples limbs, so it is not in the
star's matrix, see coupled.py.

A body's outline is a polygon with sides in place of edges, whose corners meet the edges of limbs. A node that meets it
has k of its whole length, since nobody meets it in turn, and an edge that meets a corner that of half the length at its
outer node. A disc is one corner, as thick as its radius. Outside, n points from the nearest point of the outline. Root
edges, which begin at the body, do not meet it. Corners move with the body as roots do, see body.py, and what that is
curved by, in its angle alone, is in the star's matrix.

A step does not resolve the bounce of stiff limbs. Schemes whose stages end a step damp it, whatever k is. The implicit
midpoint rule would keep it, and limbs that hinges press together would ring with the period of two steps, ever more: it
has g of half a step after the end, q_1 + h v_1/2 = q_hat + 4 (Q - q_hat) - gamma v_hat. With k to infinity, limbs that
meet then come to rest against each other in two steps. So contact is of first order, and inelastic.

Limbs that begin at one point have sides that they keep. Those on a body may go round each other's tips: there a node
belongs to the side of an edge on which it was when the step began, and meets the end of a limb all round.

A node whose limb was on its side when the step began belongs there, wherever the first guess has carried it, and a step
at whose end edges have come to cross is halved: limbs do not pass through each other in long steps. V is at most
k d^2/2. Limbs that meet with more energy, those of the chapter above about 25 m/s, would pass through each other in the
shortest step, too: their robot stops and says so.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import (
    N_LANES,
    add_product,
    any_lane,
    load,
    load_number,
    select,
    splat,
    store,
    store_number,
    subtract_product,
)
from seastar_gym.lanes.rows import aligned_rows
from seastar_gym.rods.body import push_body_at_roots
from seastar_gym.rods.star import Mesh, corner_place, edge_vector, positive_part, tail_node

SLOT_ROWS = 7
N_X, N_Y, SHARE, OFFSET, THICKNESS, STIFFNESS, PRESSED = range(SLOT_ROWS)
"""Rows of a listed pair of node and edge. STIFFNESS: [N/m]. PRESSED: That of the Hessian, 0 where they do not touch."""


MOST_NEAR_EDGES, SHORT_CHAIN = 3, 24
"""Edges of another limb that a node can be near to, in the mean over the nodes: all, in chains of SHORT_CHAIN edges or
fewer. In longer ones a node that is not crumpled is near to one or two, and a corner to as many of every limb."""
NEAR_SIDES = 2
"""Sides of a body that a node can be near to, in the mean over the nodes of chains that are not short."""
MARGIN = 2.0
"""Times the thickness: pairs nearer than that are listed, and those that approach faster."""
OUT_OF_TOUCH = 1e300
"""Thickness of a pair that does not touch, with the other sign [m]."""


class Contact(NamedTuple):
    """Coefficients of contact: limbs that may touch, thickness and stiffness of their nodes.

    n_pairs, pairs: Limbs that may touch, (right, left) each, counted from 0, shape (2 n_pairs,), for all robots.
    thickness: Distance from the centre line at which a node is touched [m]. widest: Twice the largest [m].
    stiffness: Stiffness of a touched node [N/m].
    n_corners, rim: Corners of a body's outline, and their thickness [m]. reach: Largest distance from the hub of the
        outline, and the length of an edge farther [m].

    With a body, thickness and stiffness have rows for all points, see star.py; 0 where they are no nodes.
    """

    n_pairs: int
    pairs: np.ndarray
    thickness: np.ndarray
    widest: np.ndarray
    stiffness: np.ndarray
    n_corners: int
    rim: np.ndarray
    reach: np.ndarray


class Rim(NamedTuple):
    """Outline of a body: its corners [m], shape (n, 2), and their thickness [m]. A disc has one, as thick as it is."""

    corners: np.ndarray
    radius: float


class ContactWork(NamedTuple):
    """Memory of contact; rows per coordinate of points but for those from `listed` to `touching`.

    share: Largest number of pairs of node and edge that one robot can list. own: Number that it has listed.
    listed: Number of pairs that all robots together have listed, then node and edge of each; sides of a body follow the
        limbs' edges. slots: SLOT_ROWS of each.
    solves: Iterations of the conjugate gradients in this stage, see coupled.py.
    missed: 1 for robots whose pairs did not all fit into their share, or whose step was not found.
    touching: 1 for robots that touch.
    ends: Positions at which contact is looked for [m]. seen: These positions along the gap between two limbs and
        across it.
    force: Forces of contact [N].
    x, r, z, p, Hp, w: Vectors of the conjugate gradients, see coupled.py.
    """

    share: float
    listed: np.ndarray
    slots: np.ndarray
    own: np.ndarray
    solves: np.ndarray
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


OF_CYLINDERS = np.pi / 6.0
"""Force per length and depth over Young's modulus, see seastar_gym/scene/scene.py."""


def coefficients(
    mesh: Mesh,
    pairs: Sequence[tuple[int, int]],
    modulus: float | None,
    opening_angle: float,
    rim: Rim | None = None,
    layer: float | None = None,
) -> Contact:
    """Thickness and stiffness of every node; half of the latter, because nodes of both limbs push.

    pairs: (right, left) limbs that may touch, counted from 0. modulus, layer: See moduli_at_nodes. opening_angle: See
    tapered. rim: Of a body, or None.
    """
    share = np.arange(mesh.nodes_per_limb) / (mesh.nodes_per_limb - 1)
    thickness, stiffness = [0.0], [0.0]
    at_nodes = moduli_at_nodes(mesh, modulus, layer)
    for length, reaches, moduli in zip(mesh.limb_lengths, mesh.at_nodes.reach, at_nodes, strict=True):
        thickness += [tapered(r, length * s, opening_angle) for r, s in zip(reaches, share, strict=True)][1:]
        stiffness += moduli.tolist()[1:]
    corners, radius = Rim(np.zeros((0, 2)), 0.0) if rim is None else rim
    beyond = [] if rim is None else [0.0] * (1 + mesh.n_limbs)
    reach = radius + np.hypot(*corners.T).max(initial=0.0) + max(mesh.limb_lengths) / (mesh.nodes_per_limb - 1)
    return Contact(
        n_pairs=len(pairs),
        pairs=np.array(pairs, dtype=float).ravel(),
        thickness=np.array(thickness + beyond + [radius] * len(corners)),
        widest=np.array([2.0 * max(thickness)]),
        stiffness=np.concatenate([0.5 * np.array(stiffness) * mesh.dl, beyond, np.zeros(len(corners))]),
        n_corners=len(corners),
        rim=np.array([radius]),
        reach=np.array([reach]),
    )


def tapered(reach: float, distance: float, opening_angle: float) -> float:
    """Thickness [m] at a distance from a limb's root: a cubic, flat at the root and where it comes to the reach.

    Half the opening angle is its steepest slope. A cone's slope at the root, where limbs are clamped, would bend those
    that are turned onto each other at a point, which no mesh resolves.
    """
    s = min(1.0, opening_angle * distance / (3.0 * reach))
    return reach * s * s * (3.0 - 2.0 * s)


def moduli_at_nodes(mesh: Mesh, modulus: float | None, layer: float | None) -> np.ndarray:
    """Force per length and depth at the nodes of every limb [Pa], shape (n_limbs, nodes_per_limb).

    modulus: The same for all [Pa]. layer: Of a beam on an elastic foundation [m]. Both None for elastic cylinders.
    """
    if layer is not None:
        return 4.0 * mesh.at_nodes.EI / layer**4
    if modulus is not None:
        return np.full_like(mesh.modulus_at_nodes, modulus)
    return OF_CYLINDERS * mesh.modulus_at_nodes


def memory(contact: Contact | None, n_limbs: int, edges: int, n_points: int, width: int) -> ContactWork | None:
    """Zeroed memory for the contact of one lane group, of which `width` robots at a time list their pairs together."""
    if contact is None:
        return None
    short = edges <= SHORT_CHAIN
    near_edges = edges if short else MOST_NEAR_EDGES
    share = 2 * contact.n_pairs * edges * near_edges
    capacity = 2 * contact.n_pairs * edges * min(edges, near_edges * width)
    at_body = (2 * edges - 1) * n_limbs * contact.n_corners
    near_body = at_body if short else n_limbs * (NEAR_SIDES * edges + MOST_NEAR_EDGES * contact.n_corners)
    share_at_body = min(at_body, near_body)
    capacity += min(at_body, share_at_body * width)

    def rows(count: int = 2 * n_points) -> np.ndarray:
        return aligned_rows(count, N_LANES)

    return ContactWork(
        share=float(share + share_at_body),
        listed=aligned_rows(2 * capacity + 1),
        slots=rows(SLOT_ROWS * capacity),
        own=rows(1),
        solves=rows(1),
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


@kernel
def lead_of(stage):
    """Distance from q_hat at which contact is looked for, over that of the stage."""
    return 4.0 if stage.ahead else 1.0


@kernel
def looked_at(work, stage, row):
    """Coordinate at which contact is looked for, by the iterate [m]."""
    q_hat = load(stage.q_hat, row)
    if stage.ahead:
        q_hat = subtract_product(q_hat, stage.gamma, load(stage.v_hat, row))
        return add_product(q_hat, 4.0, load(work.q, row) - load(stage.q_hat, row))
    return load(work.q, row)


@kernel
def members(rods, work, slot):
    """(i, j, k) of a listed pair: its node, and the ends of its edge."""
    i, e = int(load_number(work.contact.listed, 2 * slot + 1)), int(load_number(work.contact.listed, 2 * slot + 2))
    j, k = edge_ends(rods, e)
    return i, j, k


@kernel
def edge_ends(rods, e):
    """The places where an edge starts and ends, or a side of a body, which has the number of its corner behind those.

    The one corner of a disc is both ends of its side.
    """
    if rods.body is None or e < rods.n_edges:
        return tail_node(rods, e), e + 1
    corner = e - rods.n_edges
    return corner_place(rods, corner), corner_place(rods, corner + 1)


@kernel
def stiffness_at(rods, i, k):
    """Stiffness of a pair of node i and an edge that ends at k [N/m], in the robots' rows."""
    if rods.body is not None:
        if i >= rods.n_nodes:
            return load(rods.contact.stiffness, k)
        if k >= rods.n_nodes:
            return 2.0 * load(rods.contact.stiffness, i)
    return load(rods.contact.stiffness, i)


@kernel
def n_listed(work):
    return int(load_number(work.contact.listed, 0))


@kernel
def gap(rods, work, slot, x):
    """n (x_i - (1 - s) x_j - s x_k) of rows x of coordinates, or of what else nodes have."""
    i, j, k = members(rods, work, slot)
    row = SLOT_ROWS * slot
    s = load(work.contact.slots, row + SHARE)
    ex, ey = edge_vector(x, j, k)
    dx, dy = edge_vector(x, j, i)
    dx, dy = subtract_product(dx, s, ex), subtract_product(dy, s, ey)
    return add_product(dx * load(work.contact.slots, row + N_X), dy, load(work.contact.slots, row + N_Y))


@kernel
def gap_at_rest(rods, work, stage, slot):
    """Part of a gap that does not depend on Q [m]."""
    if stage.ahead:
        return subtract_product(
            -3.0 * gap(rods, work, slot, stage.q_hat), stage.gamma, gap(rods, work, slot, stage.v_hat)
        )
    return splat(0.0)


@kernel
def put_on_list(rods, work, stage, i, e, nx, ny, s, d, share, near):
    """List node i and edge e for the robots in the mask.

    The edge's point is at s along it, its normal (nx, ny), the thickness d [m], and the pair has a share of the node's
    stiffness.
    """
    # Every robot has a share of the list of its own, so that nobody takes another's place.
    own = load(work.contact.own, 0)
    full = near & (own >= work.contact.share)
    store(work.contact.missed, 0, select(full, 1.0, load(work.contact.missed, 0)))
    near = near & ~full
    if not any_lane(near):
        return
    store(work.contact.own, 0, select(near, own + 1.0, own))
    slot = n_listed(work)
    store_number(work.contact.listed, 0, slot + 1.0)
    store_number(work.contact.listed, 2 * slot + 1, float(i))
    store_number(work.contact.listed, 2 * slot + 2, float(e))
    row = SLOT_ROWS * slot
    # Others, whose edge may have no direction, meet nothing here that is not zero.
    store(work.contact.slots, row + N_X, select(near, nx, 0.0))
    store(work.contact.slots, row + N_Y, select(near, ny, 0.0))
    store(work.contact.slots, row + SHARE, select(near, s, 0.0))
    store(work.contact.slots, row + THICKNESS, select(near, d, -OUT_OF_TOUCH))
    store(work.contact.slots, row + OFFSET, select(near, gap_at_rest(rods, work, stage, slot), 0.0))
    _, _, head = members(rods, work, slot)
    store(work.contact.slots, row + STIFFNESS, select(near, share * stiffness_at(rods, i, head), 0.0))
    store(work.contact.slots, row + PRESSED, 0.0)


@kernel
def add_gap_gradient(rods, work, slot, amount, rows):
    """Add `amount` times the gradient of a gap to rows of coordinates."""
    i, j, k = members(rods, work, slot)
    row = SLOT_ROWS * slot
    s = load(work.contact.slots, row + SHARE)
    x, y = amount * load(work.contact.slots, row + N_X), amount * load(work.contact.slots, row + N_Y)
    for node, share in ((i, splat(1.0)), (j, s - 1.0), (k, -s)):
        store(rows, 2 * node, add_product(load(rows, 2 * node), share, x))
        store(rows, 2 * node + 1, add_product(load(rows, 2 * node + 1), share, y))


@kernel
def add_contact(rods, work, stage, convex, energy):
    """Add contact to the energy of a stage's Phi [J], and leave its forces in work.contact.force [N].

    What pushes a body is in the forces on the hub, and in the angle's part of the system.
    """
    if rods.contact is None or n_listed(work) == 0:
        return energy
    lead = lead_of(stage)
    for row in range(2 * rods.n_points):
        store(work.contact.force, row, 0.0)
    touching, twice = splat(0.0), splat(0.0)
    for slot in range(n_listed(work)):
        row = SLOT_ROWS * slot
        g = add_product(load(work.contact.slots, row + OFFSET), lead, gap(rods, work, slot, work.q))
        depth = load(work.contact.slots, row + THICKNESS) - g
        depth = positive_part(depth)
        k = select(depth > 0.0, load(work.contact.slots, row + STIFFNESS), 0.0)
        twice = add_product(twice, k * depth, depth)
        store(work.contact.slots, row + PRESSED, lead * k)
        touching = select(depth > 0.0, 1.0, touching)
        add_gap_gradient(rods, work, slot, k * depth, work.contact.force)
    store(work.contact.touching, 0, touching)
    push_body_at_roots(rods, work, convex, work.contact.force)
    return add_product(energy, 0.5 / lead, twice)


@kernel
def contact_force(work, node):
    """Force of contact on a node [N]; zero, and gone when compiled, in scenes without contact."""
    if work.contact is None:
        return splat(0.0), splat(0.0)
    return load(work.contact.force, 2 * node), load(work.contact.force, 2 * node + 1)


@kernel
def not_touching(work, robots):
    """Mask of those among `robots` that did not touch when their slopes were last computed."""
    if work.contact is None:
        return robots
    return robots & ~(load(work.contact.touching, 0) > 0.0)


@kernel
def add_contact_energy(rods, work, q, energy):
    """Add that of the pairs that were listed last, at positions q [J]."""
    if rods.contact is None:
        return energy
    for slot in range(n_listed(work)):
        row = SLOT_ROWS * slot
        depth = load(work.contact.slots, row + THICKNESS) - gap(rods, work, slot, q)
        depth = positive_part(depth)
        energy = add_product(energy, 0.5 * load(work.contact.slots, row + STIFFNESS) * depth, depth)
    return energy
