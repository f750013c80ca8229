"""Nodes, edges and hinges of a star of rods.

A star has `n_limbs` chains of nodes that share node 0, the hub. Node {j, i} (limb j from 0, i from 1) has index
j edges_per_limb + i. Edge e ends at node e + 1; it starts at the hub if it is the root edge of its limb, else
at node e. Hinge e ends with edge e: within a limb it sits at the tail of edge e, and for a root edge of limb j it is
the hub hinge from limb j to limb j + 1, whose first edge is the root edge of limb j. Two limbs have one hub hinge, one
limb has none: hinges that are not there have no stiffness. With a rigid hub, the hinge of a root edge is its clamp.

Where the hub is a body with a size, root edges start at its rim. Behind the nodes then stand the place of the body's
angle and, limb by limb, the places of the roots, which follow from hub and angle, see body.py. In scenes with
contact, the corners of its outline follow, which move as the roots do and have no numbers of their own.

Below are the geometry of edges and hinges, the mesh that coefficients of all terms are made from, and how a node moves
in an implicit stage.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import add_product, floor, load, select, sqrt, subtract_product

TWO_PI = 6.283185307179586


class Edge(NamedTuple):
    """Geometry of an edge e: its components and length |e| [m], |e|^2 [m^2], 1/|e|^2, and u = e/|e|^2 [1/m].

    The gradient of the edge's direction angle theta is (-u_y, u_x), its Hessian
    [[2 u_x u_y, u_y^2 - u_x^2], [u_y^2 - u_x^2, -2 u_x u_y]].
    """

    x: Any
    y: Any
    length: Any
    squared: Any
    inverse: Any
    ux: Any
    uy: Any


EDGE_ROWS = 7  # numbers of an Edge


@kernel
def larger(a, b):
    """The larger of two numbers."""
    return select(a > b, a, b)


@kernel
def positive_part(x):
    """x where it is positive, else 0."""
    return select(x > 0.0, x, 0.0)


@kernel
def convex_part(convex, x):
    """A second slope, of which robots in the mask `convex` (None for none) take the positive part."""
    return select(convex, positive_part(x), x)


@kernel
def edge_vector(q, tail, head):
    """e = x_head - x_tail [m]."""
    return load(q, 2 * head) - load(q, 2 * tail), load(q, 2 * head + 1) - load(q, 2 * tail + 1)


@kernel
def edge_geometry(q, tail, head):
    """The Edge from node `tail` to node `head`."""
    ex, ey = edge_vector(q, tail, head)
    squared = add_product(ex * ex, ey, ey)
    inverse = 1.0 / squared
    return Edge(ex, ey, sqrt(squared), squared, inverse, ex * inverse, ey * inverse)


@kernel
def half_angle(a, b, side):
    """t = tan(phi/2) of the angle phi from edge a to edge b, from (13.4) without trigonometry.

    side = -1 turns edge a round: the angle is then the interior turning angle at a hub whose edges both point out.
    """
    cross = subtract_product(a.x * b.y, a.y, b.x)
    dot = add_product(a.x * b.x, a.y, b.y)
    return side * cross / add_product(side * dot, a.length, b.length)


@kernel
def tangent(x):
    """tan(x) for |x| < pi/2, to a few units in the last place: the rational approximation of Cephes at x/2."""
    u = 0.5 * x
    z = u * u
    p = (-1.30936939181383734205e4 * z + 1.15351664838587416140e6) * z - 1.79565251976484877988e7
    q = (z + 1.36812963470692954678e4) * z - 1.32089234440210967447e6
    q = (q * z + 2.50083801823357915839e7) * z - 5.38695755929454629881e7
    t = u + u * z * p / q
    return 2.0 * t / (1.0 - t * t)


@kernel
def rotation(angle):
    """(cos, sin) of any angle [rad]."""
    turns = floor(add_product(0.5, angle, 1.0 / TWO_PI))
    t = tangent(0.25 * subtract_product(angle, TWO_PI, turns))
    scale = 1.0 / add_product(1.0, t, t)
    c, s = subtract_product(1.0, t, t) * scale, 2.0 * t * scale
    return subtract_product(c * c, s, s), 2.0 * s * c


Floats = NDArray[np.float64]


class Sections(NamedTuple):
    """Cross sections at places of limbs: of every edge in its middle, or of the nodes of every limb from hub to tip.

    area: Of the material [m^2]. displaced: Of the fluid that it takes the place of [m^2]. inert: Area of the robot's
        density that weighs as much [m^2].
    EI: Bending stiffness [N m^2]. thickness: Radius of the disc with the same EI/EA [m].
    width: Diameter that flow across sees [m]. added: Area of the fluid that moves along across [m^2].
    reach: Distance from the centre line at which limbs touch [m].
    """

    area: Floats
    displaced: Floats
    inert: Floats
    EI: Floats
    thickness: Floats
    width: Floats
    added: Floats
    reach: Floats


class Mesh(NamedTuple):
    """Lengths, cross sections and moduli of a robot's edges and nodes, in the order of star.py.

    n_limbs, nodes_per_limb: Numbers of limbs, and of nodes of a limb with the hub.
    l: Natural length, per edge [m]. dl: Voronoi length, per node [m]; the hub has half of every root edge.
    root_edges: Natural length of the root edges, per limb [m]. limb_lengths: Lengths of the limbs [m].
    at_edges, at_nodes: Cross sections, shape (n_edges,), and (n_limbs, nodes_per_limb) with the hub once per limb.
    modulus_at_edges, modulus_at_nodes: Young's modulus likewise [Pa].
    natural_turn: Natural angle of the hinges within every limb [rad].
    """

    n_limbs: int
    nodes_per_limb: int
    l: Floats  # noqa: E741
    dl: Floats
    root_edges: Floats
    limb_lengths: list[float]
    at_edges: Sections
    at_nodes: Sections
    modulus_at_edges: Floats
    modulus_at_nodes: Floats
    natural_turn: list[float]

    def per_node(self, at_nodes: Floats) -> Floats:
        """Numbers per node from those at the nodes of every limb; at the hub the mean of what the limbs have there."""
        return np.concatenate([[mean(at_nodes[:, 0], self.root_edges)], at_nodes[:, 1:].ravel()])

    def per_half_edge(self, of_edges: Floats) -> Floats:
        """Numbers per edge as those of the inner and the outer edge of every node in turn, shape (2 n_nodes,).

        Zero for the outer edge of tips, and for the hub: its edges are the inner ones of the root nodes.
        """
        inner = of_edges.reshape(len(self.root_edges), -1)
        outer = np.zeros_like(inner)
        outer[:, :-1] = inner[:, 1:]
        return np.concatenate([np.zeros(2), np.stack([inner, outer], axis=2).ravel()])


def mean(values: ArrayLike, weights: Floats | None = None) -> float:
    """Mean that is exact where all values are equal."""
    values = np.asarray(values, dtype=float)
    return float(values[0] + np.average(values - values[0], weights=weights))


@kernel
def corner_place(rods, corner):
    """The place of a corner of a body's outline, counted on beyond the last, in scenes with contact."""
    return rods.n_free + rods.n_limbs + corner % rods.contact.n_corners


@kernel
def root_place(rods, limb):
    """The place of a limb's root on a body."""
    return rods.n_free + limb


@kernel
def tail_node(rods, e):
    """The node where edge e starts: for a root edge the hub, or the limb's root on a body."""
    edges = rods.edges_per_limb
    if e % edges != 0:
        return e
    return 0 if rods.body is None else root_place(rods, e // edges)


@kernel
def hinge_edges(rods, e):
    """(a, b, side): the edges of the hinge that ends with edge e, and how its angle is measured, see star.py."""
    if e % rods.edges_per_limb == 0:
        return e, (e + rods.edges_per_limb) % rods.n_edges, rods.hub.side
    return e - 1, e, 1.0


@kernel
def is_clamped(rods, e):
    """Whether hinge e is a clamp of a rigid hub, and no hinge between two edges."""
    return rods.clamp is not None and e % rods.edges_per_limb == 0


@kernel
def edge_of(rods, q, e):
    """Geometry of edge e."""
    return edge_geometry(q, tail_node(rods, e), e + 1)


@kernel
def root_direction(rods, q, limb):
    """Unit vector (x, y) along the root edge of a limb."""
    e = limb * rods.edges_per_limb
    ex, ey = edge_vector(q, tail_node(rods, e), e + 1)
    inverse = 1.0 / sqrt(add_product(ex * ex, ey, ey))
    return ex * inverse, ey * inverse


@kernel
def load_root_edge(work, limb):
    """The root Edge of a limb, as it was put away."""
    row = EDGE_ROWS * limb
    return Edge(
        load(work.root_edges, row),
        load(work.root_edges, row + 1),
        load(work.root_edges, row + 2),
        load(work.root_edges, row + 3),
        load(work.root_edges, row + 4),
        load(work.root_edges, row + 5),
        load(work.root_edges, row + 6),
    )


class Motion(NamedTuple):
    """Motion of a node, by the iterate.

    dx, dy: d = v - v_hat, what its velocity changes by [m/s]. wx, wy: w = v - u, its velocity relative to the fluid.
    """

    dx: Any
    dy: Any
    wx: Any
    wy: Any


@kernel
def relative(work, node, vx, vy):
    """Velocity of a node relative to the fluid, which is at rest or has a current."""
    if work.current is None:
        return vx, vy
    return vx - load(work.current, 2 * node), vy - load(work.current, 2 * node + 1)


@kernel
def node_motion(work, stage, node):
    """The Motion of a node."""
    qx, qy = load(work.q, 2 * node), load(work.q, 2 * node + 1)
    vx = (qx - load(stage.q_hat, 2 * node)) * stage.inverse_gamma
    vy = (qy - load(stage.q_hat, 2 * node + 1)) * stage.inverse_gamma
    dx, dy = vx - load(stage.v_hat, 2 * node), vy - load(stage.v_hat, 2 * node + 1)
    wx, wy = relative(work, node, vx, vy)
    return Motion(dx, dy, wx, wy)
