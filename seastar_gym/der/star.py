"""Nodes, edges and hinges of a star of rods.

A star has `n_limbs` chains of nodes that share node 0, the hub. Node {j, i} (limb j from 0, i from 1) has index
j (nodes_per_limb - 1) + i. Edge e ends at node e + 1; it starts at the hub if it is the root edge of its limb, else
at node e. Hinge e ends with edge e: within a limb it sits at the tail of edge e, and for a root edge of limb j it is
the hub hinge from limb j to limb j + 1, whose first edge is the root edge of limb j. Two limbs have one hub hinge, one
limb has none: hinges that are not there have no stiffness. With a rigid hub, the hinge of a root edge is its clamp.

Where the hub is a body with a size, root edges start at its rim. Behind the nodes then stand the place of the body's
angle and, limb by limb, the places of the roots, which follow from hub and angle, see terms/body.py. In scenes with
contact, the corners of its outline follow, which move as the roots do and have no numbers of their own.
"""

from seastar_gym.der.geometry import EDGE_ROWS, Edge, edge_geometry
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import load


@kernel
def n_nodes(rods):
    """Number of nodes of a star, with the hub."""
    return rods.n_limbs * (rods.nodes_per_limb - 1) + 1


@kernel
def n_free(rods):
    """Number of places whose coordinates are unknowns: nodes, and the body's angle where there is one."""
    return n_free_with(rods)


@kernel
def n_free_with(rods):
    if rods.body is None:
        return n_nodes(rods)
    return n_nodes(rods) + 1


@kernel
def n_places(rods):
    """Number of places: nodes and, with a body, its angle and the roots of its limbs."""
    return n_places_with(rods)


@kernel
def n_places_with(rods):
    if rods.body is None:
        return n_nodes(rods)
    return n_nodes(rods) + 1 + rods.n_limbs


@kernel
def n_points(rods):
    """Number of places, and of the corners of a body's outline."""
    return n_points_with(rods)


@kernel
def n_points_with(rods):
    if rods.body is None:
        return n_nodes(rods)
    return n_nodes(rods) + 1 + rods.body.n_arms


@kernel
def corner_place(rods, corner):
    """The place of a corner of a body's outline, in scenes with contact."""
    return n_nodes(rods) + 1 + rods.n_limbs + corner


@kernel
def root_place(rods, limb):
    """The place of a limb's root on a body."""
    return n_nodes(rods) + 1 + limb


@kernel
def is_root(rods, place):
    """Whether a place is a limb's root on a body."""
    if rods.body is None:
        return False
    return place > n_nodes(rods)


@kernel
def is_angle(rods, place):
    """Whether a place is that of a body's angle, where there is nothing that moves."""
    if rods.body is None:
        return False
    return place == n_nodes(rods)


@kernel
def tail_node(rods, e):
    """The node where edge e starts: for a root edge the hub, or the limb's root on a body."""
    return tail_node_with(rods, e)


@kernel
def tail_node_with(rods, e):
    edges = rods.nodes_per_limb - 1
    if rods.body is None:
        return 0 if e % edges == 0 else e
    return root_place(rods, e // edges) if e % edges == 0 else e


@kernel
def hinge_edges(rods, e):
    """(a, b, side): the edges of the hinge that ends with edge e, and how its angle is measured, see geometry.py."""
    edges = rods.nodes_per_limb - 1
    if e % edges == 0:
        return e, (e + edges) % (rods.n_limbs * edges), rods.hub.side
    return e - 1, e, 1.0


@kernel
def is_clamped(rods, e):
    """Whether hinge e is a clamp of a rigid hub, and no hinge between two edges."""
    if rods.clamp is None:
        return False
    return e % (rods.nodes_per_limb - 1) == 0


@kernel
def edge_of(rods, q, e):
    """Geometry of edge e."""
    return edge_geometry(q, tail_node(rods, e), e + 1)


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
