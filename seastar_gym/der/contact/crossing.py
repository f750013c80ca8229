"""How near limbs came to passing through each other, or a body; a step in which they would is refused."""

import numpy as np

from seastar_gym.der.contact.broad_phase import across_gap, thickness_of_pair
from seastar_gym.der.contact.contact import SLOT_ROWS, THICKNESS, edge_ends, members, n_listed
from seastar_gym.der.contact.near_body import height_over_body
from seastar_gym.der.geometry import edge_vector
from seastar_gym.der.star import corner_place, tail_node
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import (
    add_product,
    any_lane,
    load,
    load_number,
    select,
    splat,
    sqrt,
    store,
    subtract_product,
)


@kernel
def without_new_crossings(rods, work, stage, q_0, robots):
    """Mask of those among `robots` without edges that cross now, or enter a body, and did not when the step began.

    Robots whose near pairs did not all fit into the list, or whose Newton step was not found, are left out.
    """
    if rods.contact is None:
        return robots
    robots = robots & ~(load(work.contact.missed, 0) > 0.0)
    store_step_end(rods, work, stage)
    for pair in range(rods.contact.n_pairs):
        right = int(load_number(rods.contact.pairs, 2 * pair))
        left = int(load_number(rods.contact.pairs, 2 * pair + 1))
        doubtful = robots & ~on_their_sides(rods, work.contact.ends, q_0, right, left)
        if any_lane(doubtful):
            robots = robots & ~(doubtful & come_to_cross(rods, work.contact.ends, q_0, right, left))
    return outside_body(rods, work.contact.ends, q_0, robots)


@kernel
def on_their_sides(rods, q_1, q_0, right, left):
    """Mask of the robots whose limbs lie on either side of a line at q_1, so that they cannot cross.

    The line goes through the hub; with a body, anywhere between the limbs and their roots.
    """
    edges = rods.edges_per_limb
    wx, wy = across_gap(rods, q_0, right, left)
    high, low = splat(-np.inf), splat(np.inf)
    if rods.body is not None:
        high = place_along(q_1, tail_node(rods, right * edges), wx, wy)
        low = place_along(q_1, tail_node(rods, left * edges), wx, wy)
    for i in range(1, edges + 1):
        x = place_along(q_1, right * edges + i, wx, wy)
        y = place_along(q_1, left * edges + i, wx, wy)
        high = select(high > x, high, x)
        low = select(low < y, low, y)
    if rods.body is not None:
        return high < low
    return (high < 0.0) & (low > 0.0)


@kernel
def place_along(q, node, wx, wy):
    """Place of a node from the hub, along w [m]."""
    dx, dy = edge_vector(q, 0, node)
    return add_product(dx * wx, dy, wy)


@kernel
def store_step_end(rods, work, stage):
    """Fill work.contact.ends with the positions at the end of the step [m]."""
    for row in range(2 * rods.n_points):
        q = load(work.q, row)
        store(work.contact.ends, row, 2.0 * q - load(stage.q_hat, row) if stage.ahead else q)


@kernel
def come_to_cross(rods, q_1, q_0, right, left):
    """Mask of the robots with edges of two limbs that cross at q_1 and did not at q_0."""
    edges = rods.edges_per_limb
    crossed = splat(1.0) < 0.0
    for e in range(right * edges, right * edges + edges):
        for f in range(left * edges, left * edges + edges):
            now = edges_cross(rods, q_1, e, f)
            if any_lane(now):
                crossed = crossed | (now & ~edges_cross(rods, q_0, e, f))
    return crossed


@kernel
def edges_cross(rods, q, e, f):
    """Mask of the robots whose edges e and f cross: each at a share of itself between 0 and 1, without divisions."""
    i, head = edge_ends(rods, e)
    j, other_head = edge_ends(rods, f)
    ex, ey = edge_vector(q, i, head)
    fx, fy = edge_vector(q, j, other_head)
    dx, dy = edge_vector(q, i, j)
    cross = subtract_product(ex * fy, ey, fx)
    of_e = cross * subtract_product(dx * fy, dy, fx)
    of_f = cross * subtract_product(dx * ey, dy, ex)
    squared = cross * cross
    return (of_e > 0.0) & (of_e < squared) & (of_f > 0.0) & (of_f < squared)


@kernel
def outside_body(rods, q_1, q_0, robots):
    """Mask of those among `robots` without nodes in a body at q_1, nor edges through it, that were not so at q_0.

    Root edges are left out, which begin at the body. The robots themselves without a body.
    """
    if rods.body is None or rods.contact.n_corners == 0:
        return robots
    edges, farthest = rods.edges_per_limb, load(rods.contact.reach, 0)
    for i in range(1, rods.n_nodes):
        dx, dy = edge_vector(q_1, 0, i)
        doubtful = robots & (add_product(dx * dx, dy, dy) < farthest * farthest)
        if any_lane(doubtful):
            entered = is_within(rods, q_1, i) & ~is_within(rods, q_0, i)
            if i % edges != 1 and edges > 1:
                entered = entered | come_through(rods, q_1, q_0, i - 1)
            robots = robots & ~(doubtful & entered)
    return robots


@kernel
def is_within(rods, q, i):
    """Mask of the robots with a node in the body."""
    if rods.contact.n_corners > 1:
        return height_over_body(rods, q, i) < 0.0
    dx, dy = edge_vector(q, corner_place(rods, 0), i)
    rim = load(rods.contact.rim, 0)
    return add_product(dx * dx, dy, dy) < rim * rim


@kernel
def come_through(rods, q_1, q_0, e):
    """Mask of the robots with an edge through the body at q_1 that was not so at q_0."""
    if rods.contact.n_corners == 1:
        return reaches_disc(rods, q_1, e) & ~reaches_disc(rods, q_0, e)
    through = splat(1.0) < 0.0
    for side in range(rods.contact.n_corners):
        f = rods.n_edges + side
        now = edges_cross(rods, q_1, e, f)
        if any_lane(now):
            through = through | (now & ~edges_cross(rods, q_0, e, f))
    return through


@kernel
def reaches_disc(rods, q, e):
    """Mask of the robots with an edge whose point nearest to the middle of a disc lies between its ends, and in it."""
    i, rim = corner_place(rods, 0), load(rods.contact.rim, 0)
    ex, ey = edge_vector(q, e, e + 1)
    dx, dy = edge_vector(q, e, i)
    squared, along = add_product(ex * ex, ey, ey), add_product(dx * ex, dy, ey)
    across = subtract_product(dx * ey, dy, ex)
    return (along > 0.0) & (along < squared) & (across * across < rim * rim * squared)


@kernel
def deepest_overlap(rods, work, q):
    """Largest depth of the pairs that were listed last, over the distance at which they touch, at positions q.

    1 where a node is on the centre line of another limb, or on the outline of a body; 0 where nobody touches.
    """
    deepest = splat(0.0)
    for slot in range(n_listed(work)):
        i, j, k = members(rods, work, slot)
        ex, ey = edge_vector(q, j, k)
        dx, dy = edge_vector(q, j, i)
        squared, along = add_product(ex * ex, ey, ey), add_product(dx * ex, dy, ey)
        s = select(along > 0.0, select(along < squared, along / squared, 1.0), 0.0)
        dx, dy = subtract_product(dx, s, ex), subtract_product(dy, s, ey)
        thickness = thickness_of_pair(rods, i, j, k, s)
        nearest = subtract_product(thickness, deepest, own_thickness(rods, i, k, thickness))
        squared = add_product(dx * dx, dy, dy)
        # Others have the pair on the list, too.
        listed = load(work.contact.slots, SLOT_ROWS * slot + THICKNESS) > 0.0
        deeper = listed & (nearest > 0.0) & (squared < nearest * nearest)
        if any_lane(deeper):
            depth = thickness - sqrt(squared)
            deepest = select(deeper, depth / own_thickness(rods, i, k, thickness), deepest)
    return deepest


@kernel
def own_thickness(rods, i, k, thickness):
    """Part of the thickness of node i and an edge that ends at k that is of limbs [m], and not of a body."""
    if rods.body is not None and (i >= rods.n_nodes or k >= rods.n_nodes):
        return thickness - load(rods.contact.rim, 0)
    return thickness
