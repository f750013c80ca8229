"""Which nodes are near a body, and which edges near its corners: listed for broad_phase.py."""

import numpy as np

from seastar_gym.der.contact.contact import MARGIN, put_on_list
from seastar_gym.der.geometry import edge_vector
from seastar_gym.der.star import corner_place
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import absolute, add_product, any_lane, load, select, splat, sqrt, subtract_product


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
