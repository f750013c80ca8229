"""Nodes, edges and hinges of a star of rods.

A star has `n_limbs` chains of nodes that share node 0, the hub. Node {j, i} (limb j from 0, i from 1) has index
j edges_per_limb + i. Edge e ends at node e + 1; it starts at the hub if it is the root edge of its limb, else
at node e. Hinge e ends with edge e: within a limb it sits at the tail of edge e, and for a root edge of limb j it is
the hub hinge from limb j to limb j + 1, whose first edge is the root edge of limb j. Two limbs have one hub hinge, one
limb has none: hinges that are not there have no stiffness. With a rigid hub, the hinge of a root edge is its clamp.

Where the hub is a body with a size, root edges start at its rim. Behind the nodes then stand the place of the body's
angle and, limb by limb, the places of the roots, which follow from hub and angle, see body/body.py. In scenes with
contact, the corners of its outline follow, which move as the roots do and have no numbers of their own.
"""

from seastar_gym.der.geometry import EDGE_ROWS, Edge, edge_geometry, edge_vector
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load, sqrt


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
    """(a, b, side): the edges of the hinge that ends with edge e, and how its angle is measured, see geometry.py."""
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
