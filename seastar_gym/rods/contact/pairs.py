"""Which nodes and edges may touch in a stage, of limbs and of a body: listed from its first guess, robot by robot.

Which nodes are near a body, and which edges near its corners: listed for pairs.py.

How near limbs came to passing through each other, or a body; a step in which they would is refused.
"""

import numpy as np

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import (
    absolute,
    add_product,
    any_lane,
    load,
    load_number,
    select,
    splat,
    sqrt,
    store,
    store_number,
    subtract_product,
)
from seastar_gym.rods.contact.forces import (
    MARGIN,
    SLOT_ROWS,
    THICKNESS,
    edge_ends,
    looked_at,
    members,
    n_listed,
    put_on_list,
)
from seastar_gym.rods.star import corner_place, edge_vector, root_direction, root_place, tail_node


@kernel
def list_at_body(rods, work, stage, q_0, reach):
    """List the nodes of limbs that are near a body, and the edges that are near its corners, in scenes with a body.

    Root edges are left out, which begin at the body.
    """
    if rods.body is None or rods.contact.n_corners == 0:
        return
    ends, edges = work.contact.ends, rods.edges_per_limb
    farthest = load(rods.contact.reach, 0) + reach
    for i in range(1, rods.n_nodes):
        dx, dy = edge_vector(ends, 0, i)
        robots = add_product(dx * dx, dy, dy) < farthest * farthest
        if any_lane(robots):
            if rods.contact.n_corners == 1:
                list_node_at_disc(rods, work, stage, q_0, i, robots)
            else:
                list_node_at_sides(rods, work, stage, q_0, i, robots)
            if i % edges != 1 and edges > 1:
                for corner in range(rods.contact.n_corners):
                    list_corner(rods, work, stage, q_0, corner, i - 1, robots)


@kernel
def list_node_at_disc(rods, work, stage, q_0, i, robots):
    """List a node at the rim of a disc, in the direction in which it stands from the middle."""
    j, rim, d = corner_place(rods, 0), load(rods.contact.rim, 0), load(rods.contact.thickness, i)
    dx, dy = edge_vector(work.contact.ends, j, i)
    size = sqrt(add_product(dx * dx, dy, dy))
    nx, ny = dx / size, dy / size
    dx, dy = edge_vector(q_0, j, i)
    g, g_0 = size - rim, sqrt(add_product(dx * dx, dy, dy)) - rim
    near = robots & (size > 0.0) & (g_0 > -d) & (g < MARGIN * d + absolute(g - g_0))
    if any_lane(near):
        put_on_list(rods, work, stage, i, rods.n_edges, nx, ny, splat(0.0), d + rim, splat(1.0), near)


@kernel
def height_over_side(rods, q, i, side):
    """Distance of a node from the line through a side of a polygon [m], positive outside."""
    j = corner_place(rods, side)
    ex, ey = edge_vector(q, j, corner_place(rods, side + 1))
    dx, dy = edge_vector(q, j, i)
    return subtract_product(ey * dx, ex, dy) / sqrt(add_product(ex * ex, ey, ey))


@kernel
def height_over_body(rods, q, i):
    """Largest of the heights of a node over the sides of a polygon [m]: negative inside."""
    height = splat(-np.inf)
    for side in range(rods.contact.n_corners):
        here = height_over_side(rods, q, i, side)
        height = select(here > height, here, height)
    return height


@kernel
def list_node_at_sides(rods, work, stage, q_0, i, robots):
    """List a node at the side of a polygon beside which it stands, or at the corner at the side's end.

    Inside, it belongs to the sides outside of which it was when the step began, or to the one that it was nearest to.
    """
    ends, d = work.contact.ends, load(rods.contact.thickness, i)
    height = height_over_body(rods, q_0, i)
    for side in range(rods.contact.n_corners):
        j, k = corner_place(rods, side), corner_place(rods, side + 1)
        ex, ey = edge_vector(ends, j, k)
        dx, dy = edge_vector(ends, j, i)
        inverse = 1.0 / add_product(ex * ex, ey, ey)
        s = add_product(dx * ex, dy, ey) * inverse
        # The next side begins at the corner k; who is before it and beyond this one stands at the corner.
        fx, fy = edge_vector(ends, k, corner_place(rods, side + 2))
        hx, hy = edge_vector(ends, k, i)
        beyond = (s > 1.0) & (add_product(hx * fx, hy, fy) < 0.0)
        beside = robots & (beyond | ((s >= 0.0) & (s <= 1.0))) & (height > -d)
        if any_lane(beside):
            size, scale = sqrt(add_product(hx * hx, hy, hy)), sqrt(inverse)
            nx, ny = select(beyond, hx / size, ey * scale), select(beyond, hy / size, -ex * scale)
            # A corner's distance is the same from either side, so that a mirrored robot lists the same pairs.
            kx, ky = edge_vector(q_0, k, i)
            g, over = add_product(hx * nx, hy, ny), height_over_side(rods, q_0, i, side)
            g_0 = select(beyond, sqrt(add_product(kx * kx, ky, ky)), over)
            near = beside & (beyond | (over > 0.0) | (over >= height)) & (g < MARGIN * d + absolute(g - g_0))
            if any_lane(near):
                s = select(s < 1.0, s, 1.0)
                put_on_list(rods, work, stage, i, rods.n_edges + side, nx, ny, s, d, splat(1.0), near)


@kernel
def list_corner(rods, work, stage, q_0, corner, e, robots):
    """List a corner of a body at an edge of a limb beside which it stands, on the side on which the step began."""
    i, j, k = corner_place(rods, corner), e, e + 1
    ex, ey = edge_vector(work.contact.ends, j, k)
    dx, dy = edge_vector(work.contact.ends, j, i)
    squared = add_product(ex * ex, ey, ey)
    along = add_product(dx * ex, dy, ey)
    facing = robots & (along > 0.0) & (along < squared)
    if not any_lane(facing):
        return
    inverse = 1.0 / squared
    s, scale = along * inverse, sqrt(inverse)
    fx, fy = edge_vector(q_0, j, k)
    hx, hy = edge_vector(q_0, j, i)
    g_0 = subtract_product(fx * hy, fy, hx) / sqrt(add_product(fx * fx, fy, fy))
    side = select(g_0 > 0.0, scale, -scale)
    nx, ny = -ey * side, ex * side
    g, rim = add_product(dx * nx, dy, ny), load(rods.contact.rim, 0)
    tail = load(rods.contact.thickness, j)
    d = add_product(tail, s, load(rods.contact.thickness, k) - tail)
    near = facing & (g - rim < MARGIN * d + absolute(g - absolute(g_0)))
    if any_lane(near):
        put_on_list(rods, work, stage, i, e, nx, ny, s, d + rim, splat(1.0), near)


OVERHANG = 0.25  # of an edge: so far from its ends, on either side, it shares nodes with the next, see share_of_edge
OVERHANG_ON_BODY = 0.05  # limbs may curl sharply there, and pass beside the lines of their edges


@kernel
def freeze_contact(rods, work, stage, q_0):
    """List who may touch whom in this stage, in scenes with contact; q_0: positions where the step began."""
    if rods.contact is None:
        return
    moved = splat(0.0)
    carried_x, carried_y = moved, moved  # with the hub
    for node in range(rods.n_nodes):
        x, y = looked_at(work, stage, 2 * node), looked_at(work, stage, 2 * node + 1)
        store(work.contact.ends, 2 * node, x)
        store(work.contact.ends, 2 * node + 1, y)
        dx, dy = x - load(q_0, 2 * node), y - load(q_0, 2 * node + 1)
        if node == 0:
            carried_x, carried_y = dx, dy
        dx, dy = dx - carried_x, dy - carried_y
        squared = add_product(dx * dx, dy, dy)
        moved = select(squared > moved, squared, moved)
    moved = view_roots(rods, work, stage, q_0, carried_x, carried_y, moved)
    # Whoever is farther apart than that could not have come near on the way.
    reach = add_product(MARGIN * load(rods.contact.widest, 0), 2.0, sqrt(moved))
    store_number(work.contact.listed, 0, 0.0)
    store(work.contact.missed, 0, 0.0)
    store(work.contact.solves, 0, 0.0)
    store(work.contact.own, 0, 0.0)
    for pair in range(rods.contact.n_pairs):
        right = int(load_number(rods.contact.pairs, 2 * pair))
        left = int(load_number(rods.contact.pairs, 2 * pair + 1))
        view_limbs(rods, work, q_0, right, left)
        near, end = may_touch(rods, work, reach, right, left, -1.0)
        if any_lane(near):
            list_pairs(rods, work, stage, q_0, reach, right, left, -1.0, end, near)
        near, end = may_touch(rods, work, reach, left, right, 1.0)
        if any_lane(near):
            list_pairs(rods, work, stage, q_0, reach, left, right, 1.0, end, near)
    list_at_body(rods, work, stage, q_0, reach)
    if n_listed(work) == 0:
        store(work.contact.touching, 0, 0.0)
        for row in range(2 * rods.n_points):
            store(work.contact.force, row, 0.0)


@kernel
def view_roots(rods, work, stage, q_0, carried_x, carried_y, moved):
    """Look at roots and corners of a body, as freeze_contact does at nodes; returns the largest move squared [m^2]."""
    if rods.body is None:
        return moved
    for k in range(rods.body.n_arms):
        place = root_place(rods, 0) + k
        x, y = looked_at(work, stage, 2 * place), looked_at(work, stage, 2 * place + 1)
        store(work.contact.ends, 2 * place, x)
        store(work.contact.ends, 2 * place + 1, y)
        dx, dy = x - load(q_0, 2 * place) - carried_x, y - load(q_0, 2 * place + 1) - carried_y
        squared = add_product(dx * dx, dy, dy)
        moved = select(squared > moved, squared, moved)
    return moved


@kernel
def view_limbs(rods, work, q_0, right, left):
    """Look at two limbs and their roots along the gap between them, and across it; keep it in work.contact.seen."""
    edges = rods.edges_per_limb
    wx, wy = across_gap(rods, q_0, right, left)
    for limb in (right, left):
        view_node(work, tail_node(rods, limb * edges), wx, wy)
        for node in range(limb * edges + 1, limb * edges + edges + 1):
            view_node(work, node, wx, wy)


@kernel
def across_gap(rods, q, right, left):
    """Unit vector from the right limb to the left: along the difference of their directions and across their sum.

    On a body, where there is no right and no left, from the middle of one limb to that of the other.
    """
    if rods.body is None:
        ax, ay = root_direction(rods, q, right)
        bx, by = root_direction(rods, q, left)
        wx, wy = bx - ax - (ay + by), by - ay + (ax + bx)
        scale = 1.0 / sqrt(add_product(wx * wx, wy, wy))
        return scale * wx, scale * wy
    edges, wx, wy = rods.edges_per_limb, splat(0.0), splat(0.0)
    for i in range(1, edges + 1):
        x, y = edge_vector(q, right * edges + i, left * edges + i)
        wx, wy = wx + x, wy + y
    size = sqrt(add_product(wx * wx, wy, wy))
    known = size > 0.0
    return select(known, wx / size, 1.0), select(known, wy / size, 0.0)


@kernel
def may_touch(rods, work, reach, limb, other, side):
    """(near, end): the mask of the robots with no strip of width `reach` between the nodes of a limb and the edges of
    another, which begin at the hub or a body, and how far the limb comes towards the other.
    """
    edges = rods.edges_per_limb
    end, begin = splat(-np.inf), -side * load(work.contact.seen, 2 * tail_node(rods, other * edges))
    for i in range(1, edges + 1):
        own = -side * load(work.contact.seen, 2 * (limb * edges + i))
        others = -side * load(work.contact.seen, 2 * (other * edges + i))
        end = select(own > end, own, end)
        begin = select(others < begin, others, begin)
    return ~(begin - end > reach), end


@kernel
def view_node(work, node, wx, wy):
    """Keep a node's places along w and across it [m]."""
    x, y = load(work.contact.ends, 2 * node), load(work.contact.ends, 2 * node + 1)
    store(work.contact.seen, 2 * node, add_product(x * wx, y, wy))
    store(work.contact.seen, 2 * node + 1, subtract_product(y * wx, x, wy))


@kernel
def overhang(rods):
    """Share of an edge by which it is continued beyond its ends."""
    return OVERHANG if rods.body is None else OVERHANG_ON_BODY


@kernel
def lower_end(rods, a, b):
    """The lower end of an edge with ends at a and b, continued by its overhang."""
    return select(a < b, subtract_product(a, overhang(rods), b - a), subtract_product(b, overhang(rods), a - b))


@kernel
def list_pairs(rods, work, stage, q_0, reach, limb, other, side, end, robots):
    """List the nodes of a limb that are near edges of another, which has it on its left (side 1) or right (-1).

    end, robots: How far the limb comes towards the other, and in whom it may touch it, as may_touch saw it.
    """
    edges = rods.edges_per_limb
    ends, seen = work.contact.ends, work.contact.seen
    for e in range(other * edges, other * edges + edges):
        j, k = tail_node(rods, e), e + 1
        forth_j, forth_k = -side * load(seen, 2 * j), -side * load(seen, 2 * k)
        begin = lower_end(rods, forth_j, forth_k) - reach
        reached = robots & (end > begin)
        if not any_lane(reached):
            continue
        z_j, z_k = load(seen, 2 * j + 1), load(seen, 2 * k + 1)
        lowest, highest = lower_end(rods, z_j, z_k) - reach, reach - lower_end(rods, -z_j, -z_k)
        ex, ey = edge_vector(ends, j, k)
        inverse = 1.0 / add_product(ex * ex, ey, ey)
        scale = side * sqrt(inverse)
        nx, ny = -ey * scale, ex * scale
        for i in range(limb * edges + 1, limb * edges + edges + 1):
            z = load(seen, 2 * i + 1)
            facing = reached & (-side * load(seen, 2 * i) > begin) & (z > lowest) & (z < highest)
            if any_lane(facing):
                dx, dy = edge_vector(ends, j, i)
                s = add_product(dx * ex, dy, ey) * inverse
                g = add_product(dx * nx, dy, ny)
                facing = facing & (s > -overhang(rods)) & (s < last_share(rods, e))
                if any_lane(facing):
                    # Limbs that begin at one point have sides that they keep; those on a body may go round tips.
                    if rods.body is None:
                        list_pair(rods, work, stage, q_0, i, e, side, nx, ny, s, g, facing)
                    else:
                        list_pair_on_its_side(rods, work, stage, q_0, i, e, s, facing)


@kernel
def share_of_edge(rods, e, s):
    """Share of a node's stiffness that it has at an edge, s: where it stands along the edge.

    Around a hinge it passes linearly from one edge to the next: both together are one node. From the ends of a limb it
    falls to zero beyond them, but not where tips are round.
    """
    edges = rods.edges_per_limb
    behind = (s + overhang(rods)) * ((1.0 if e % edges == 0 else 0.5) / overhang(rods))
    ahead = (last_share(rods, e) - s) * ((1.0 if e % edges == edges - 1 else 0.5) / overhang(rods))
    share = select(behind < ahead, behind, ahead)
    return select(share < 1.0, share, 1.0)


@kernel
def last_share(rods, e):
    """Share of an edge up to which it meets nodes; on a body tips are round, and meet those in front of them, too."""
    edges = rods.edges_per_limb
    return splat(np.inf if rods.body is not None and e % edges == edges - 1 else 1.0 + overhang(rods))


@kernel
def list_pair_on_its_side(rods, work, stage, q_0, i, e, s, facing):
    """List node i and edge e on a body, where the node is beside the edge or, at a tip, in front of it.

    The side is that of the step's beginning, if the node was beside the edge then, or at most the edge's length behind.
    Otherwise it is that of the first guess.
    """
    j, k, ends = tail_node(rods, e), e + 1, work.contact.ends
    fx, fy = edge_vector(q_0, j, k)
    hx, hy = edge_vector(q_0, j, i)
    squared = add_product(fx * fx, fy, fy)
    g_0 = subtract_product(fx * hy, fy, hx) / sqrt(squared)
    ex, ey = edge_vector(ends, j, k)
    dx, dy = edge_vector(ends, j, i)
    scale = 1.0 / sqrt(add_product(ex * ex, ey, ey))
    g = subtract_product(ex * dy, ey, dx) * scale
    foot = add_product(hx * fx, hy, fy)
    was_beside = (foot >= -squared) & (foot <= squared)
    side = select(select(was_beside, g_0, g) > 0.0, scale, -scale)
    tx, ty = edge_vector(ends, k, i)
    size = sqrt(add_product(tx * tx, ty, ty))
    in_front = (s > 1.0) & (size > 0.0)
    nx, ny = select(in_front, tx / size, -ey * side), select(in_front, ty / size, ex * side)
    g = select(in_front, size, add_product(dx * nx, dy, ny))
    ux, uy = edge_vector(q_0, k, i)
    g_0 = select(in_front, sqrt(add_product(ux * ux, uy, uy)), absolute(g_0))
    share, d = share_of_edge(rods, e, s), thickness_of_pair(rods, i, j, k, s)
    s = select(s > 0.0, select(s < 1.0, s, 1.0), 0.0)
    near = facing & (g < MARGIN * d + absolute(g - g_0))
    if any_lane(near):
        put_on_list(rods, work, stage, i, e, nx, ny, s, d, share, near)


@kernel
def thickness_of_pair(rods, i, j, k, s):
    """Distance at which node i touches the edge from j to k [m], s: where along it, or at its nearer end."""
    s = select(s > 0.0, select(s < 1.0, s, 1.0), 0.0)
    tail = load(rods.contact.thickness, j)
    return load(rods.contact.thickness, i) + add_product(tail, s, load(rods.contact.thickness, k) - tail)


@kernel
def list_pair(rods, work, stage, q_0, i, e, side, nx, ny, s, g, facing):
    """List node i and edge e if they are near each other in any of the robots in the mask `facing`."""
    j, k = tail_node(rods, e), e + 1
    ex, ey = edge_vector(q_0, j, k)
    dx, dy = edge_vector(q_0, j, i)
    g_0 = side * subtract_product(ex * dy, ey, dx) / sqrt(add_product(ex * ex, ey, ey))
    share, d = share_of_edge(rods, e, s), thickness_of_pair(rods, i, j, k, s)
    near = facing & (g_0 > -d) & (g < MARGIN * d + absolute(g - g_0))
    if any_lane(near):
        put_on_list(rods, work, stage, i, e, nx, ny, s, d, share, near)


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
