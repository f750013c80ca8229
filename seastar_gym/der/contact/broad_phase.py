"""Which nodes and edges may touch in a stage, of limbs and of a body: listed from its first guess, robot by robot."""

import numpy as np

from seastar_gym.der.contact.contact import MARGIN, looked_at, n_listed, put_on_list
from seastar_gym.der.contact.near_body import list_at_body
from seastar_gym.der.geometry import edge_vector
from seastar_gym.der.star import root_direction, root_place, tail_node
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import (
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
