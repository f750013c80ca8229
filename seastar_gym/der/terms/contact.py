"""Contact between limbs: a penalty on how deep nodes of one limb lie in edges of another.

A node at x and the point y = (1 - s) x_j + s x_k of an edge have the gap g = n (x - y), n the edge's normal to the side
on which the node's limb belongs. Where g is below d, their thicknesses' sum, elastic cylinders side by side store

    V = k (d - g)^2 / 2,    k the contact modulus times half the node's Voronoi length,

half, because the nodes of either limb meet the edges of the other. Who is near whom, n and s are taken from the first
guess of a stage, see fluid.py: g is linear in the coordinates, V convex, k c c^T its Hessian, c the gradient of g,
and the forces on node and edge cancel. That Hessian couples limbs, so it is not in the star's matrix, see coupled.py.

A step does not resolve the bounce of stiff limbs. Schemes whose stages end a step damp it, whatever k is. The implicit
midpoint rule would keep it, and limbs that hinges press together would ring with the period of two steps, ever more: it
has g of half a step after the end, q_1 + h v_1/2 = q_hat + 4 (Q - q_hat) - gamma v_hat. With k to infinity, limbs that
meet then come to rest against each other in two steps. So contact is of first order, and inelastic.

A node whose limb was on its side when the step began belongs there, wherever the first guess has carried it, and a step
at whose end edges have come to cross is halved: limbs do not pass through each other in long steps.
"""

import numpy as np

from seastar_gym.der.geometry import edge_vector
from seastar_gym.der.rods import N_X, N_Y, OFFSET, SHARE, SLOT_ROWS, STIFFNESS, THICKNESS, n_nodes, tail_node
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

OVERHANG = 0.05  # of an edge: so far beyond its ends it still meets nodes, which leaves no wedge at a bent hinge
MARGIN = 2.0  # times the thickness: pairs nearer than that are listed, and those that approach faster
OUT_OF_TOUCH = 1e300  # [m]


@kernel
def lead_of(stage):
    """How far contact is asked for from q_hat, over how far the stage is."""
    return 4.0 if stage.ahead else 1.0


@kernel
def looked_at(work, stage, row):
    """Coordinate where contact is asked for, as the iterate has it [m]."""
    q_hat = load(stage.q_hat, row)
    if stage.ahead:
        q_hat = subtract_product(q_hat, stage.gamma, load(stage.v_hat, row))
        return add_product(q_hat, 4.0, load(work.q, row) - load(stage.q_hat, row))
    return load(work.q, row)


@kernel
def freeze_contact(contact, rods, work, stage, q_0):
    """List who may touch whom in this stage, in scenes with contact; q_0: positions where the step began."""
    if contact is None:
        return
    moved = splat(0.0)
    carried_x, carried_y = moved, moved  # with the hub
    for node in range(n_nodes(rods)):
        x, y = looked_at(work, stage, 2 * node), looked_at(work, stage, 2 * node + 1)
        store(work.contact.ends, 2 * node, x)
        store(work.contact.ends, 2 * node + 1, y)
        dx, dy = x - load(q_0, 2 * node), y - load(q_0, 2 * node + 1)
        if node == 0:
            carried_x, carried_y = dx, dy
        dx, dy = dx - carried_x, dy - carried_y
        squared = add_product(dx * dx, dy, dy)
        moved = select(squared > moved, squared, moved)
    # Whoever is farther apart than that could not have come near on the way.
    reach = add_product(MARGIN * load(contact.widest, 0), 2.0, sqrt(moved))
    store_number(work.contact.listed, 0, 0.0)
    store(work.contact.missed, 0, 0.0)
    store(work.contact.own, 0, 0.0)
    for pair in range(contact.n_pairs):
        right = int(load_number(contact.pairs, 2 * pair))
        left = int(load_number(contact.pairs, 2 * pair + 1))
        view_limbs(rods, work, q_0, right, left)
        near, end = may_touch(rods, work, reach, right, left, -1.0)
        if any_lane(near):
            list_pairs(contact, rods, work, stage, q_0, reach, right, left, -1.0, end, near)
        near, end = may_touch(rods, work, reach, left, right, 1.0)
        if any_lane(near):
            list_pairs(contact, rods, work, stage, q_0, reach, left, right, 1.0, end, near)
    if n_listed(work) == 0:
        store(work.contact.touching, 0, 0.0)
        for row in range(2 * n_nodes(rods)):
            store(work.contact.force, row, 0.0)


@kernel
def view_limbs(rods, work, q_0, right, left):
    """Look at two limbs and the hub along the gap between them, and across it; keep it in work.contact.seen."""
    edges = rods.nodes_per_limb - 1
    wx, wy = across_gap(rods, q_0, right, left)
    view_node(work, 0, wx, wy)
    for limb in (right, left):
        for node in range(limb * edges + 1, limb * edges + edges + 1):
            view_node(work, node, wx, wy)


@kernel
def across_gap(rods, q, right, left):
    """Unit vector from the right limb to the left: along the difference of their directions and across their sum."""
    edges = rods.nodes_per_limb - 1
    ax, ay = edge_vector(q, 0, right * edges + 1)
    bx, by = edge_vector(q, 0, left * edges + 1)
    a, b = 1.0 / sqrt(add_product(ax * ax, ay, ay)), 1.0 / sqrt(add_product(bx * bx, by, by))
    ax, ay, bx, by = a * ax, a * ay, b * bx, b * by
    wx, wy = bx - ax - (ay + by), by - ay + (ax + bx)
    scale = 1.0 / sqrt(add_product(wx * wx, wy, wy))
    return scale * wx, scale * wy


@kernel
def may_touch(rods, work, reach, limb, other, side):
    """(near, end): the mask of the robots with no strip of width `reach` between the nodes of a limb and the edges of
    another, which begin at the hub, and how far the limb comes towards the other.
    """
    edges = rods.nodes_per_limb - 1
    end, begin = splat(-np.inf), -side * load(work.contact.seen, 0)
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
def list_pairs(contact, rods, work, stage, q_0, reach, limb, other, side, end, robots):
    """List the nodes of a limb that are near edges of another, which has it on its left (side 1) or right (-1).

    end, robots: How far the limb comes towards the other, and in whom it may touch it, as may_touch saw it.
    """
    edges = rods.nodes_per_limb - 1
    ends, seen = work.contact.ends, work.contact.seen
    for e in range(other * edges, other * edges + edges):
        j, k = tail_node(rods, e), e + 1
        forth_j, forth_k = -side * load(seen, 2 * j), -side * load(seen, 2 * k)
        begin = select(forth_j < forth_k, forth_j, forth_k) - reach
        reached = robots & (end > begin)
        if not any_lane(reached):
            continue
        z_j, z_k = load(seen, 2 * j + 1), load(seen, 2 * k + 1)
        lowest, highest = select(z_j < z_k, z_j, z_k) - reach, select(z_j < z_k, z_k, z_j) + reach
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
                facing = facing & (s > -OVERHANG) & (s < 1.0 + OVERHANG)
                if any_lane(facing):
                    list_pair(contact, rods, work, stage, q_0, i, e, side, nx, ny, s, g, facing)


@kernel
def list_pair(contact, rods, work, stage, q_0, i, e, side, nx, ny, s, g, facing):
    """List node i and edge e if they are near each other in any of the robots in the mask `facing`."""
    j, k = tail_node(rods, e), e + 1
    ex, ey = edge_vector(q_0, j, k)
    dx, dy = edge_vector(q_0, j, i)
    g_0 = side * subtract_product(ex * dy, ey, dx) / sqrt(add_product(ex * ex, ey, ey))
    s = select(s > 0.0, select(s < 1.0, s, 1.0), 0.0)
    tail = load(contact.thickness, j)
    d = load(contact.thickness, i) + add_product(tail, s, load(contact.thickness, k) - tail)
    near = facing & (g_0 > -d) & (g < MARGIN * d + absolute(g - g_0))
    if not any_lane(near):
        return
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
    store(work.contact.slots, row + STIFFNESS, 0.0)


@kernel
def members(rods, work, slot):
    """(i, j, k) of a listed pair: its node, and the ends of its edge."""
    i, e = int(load_number(work.contact.listed, 2 * slot + 1)), int(load_number(work.contact.listed, 2 * slot + 2))
    return i, tail_node(rods, e), e + 1


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
    """What a gap has that does not depend on Q."""
    if stage.ahead:
        return subtract_product(
            -3.0 * gap(rods, work, slot, stage.q_hat), stage.gamma, gap(rods, work, slot, stage.v_hat)
        )
    return splat(0.0)


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
def add_contact(contact, rods, work, stage, energy):
    """Add contact to the energy of a stage's Phi [J], and leave its forces in work.contact.force [N]."""
    if contact is None:
        return energy
    if n_listed(work) == 0:
        return energy
    lead = lead_of(stage)
    for row in range(2 * n_nodes(rods)):
        store(work.contact.force, row, 0.0)
    touching, twice = splat(0.0), splat(0.0)
    for slot in range(n_listed(work)):
        row = SLOT_ROWS * slot
        g = add_product(load(work.contact.slots, row + OFFSET), lead, gap(rods, work, slot, work.q))
        depth = load(work.contact.slots, row + THICKNESS) - g
        depth = select(depth > 0.0, depth, 0.0)
        i, _, _ = members(rods, work, slot)
        k = select(depth > 0.0, load(contact.stiffness, i), 0.0)
        twice = add_product(twice, k * depth, depth)
        store(work.contact.slots, row + STIFFNESS, lead * k)
        touching = select(depth > 0.0, 1.0, touching)
        add_gap_gradient(rods, work, slot, k * depth, work.contact.force)
    store(work.contact.touching, 0, touching)
    return add_product(energy, 0.5 / lead, twice)


@kernel
def contact_force(contact, node):
    """Force of contact on a node [N]; zero, and gone when compiled, in scenes without contact (None)."""
    if contact is None:
        return splat(0.0), splat(0.0)
    return load(contact.force, 2 * node), load(contact.force, 2 * node + 1)


@kernel
def those_apart(contact, robots):
    """Of the robots in the mask, those that did not touch when last asked for their slopes."""
    if contact is None:
        return robots
    return robots & ~(load(contact.touching, 0) > 0.0)


@kernel
def those_uncrossed(contact, rods, work, stage, q_0, robots):
    """Of the robots in the mask, those without edges of different limbs that cross now and did not when the step began.

    Not those either whose neighbours did not all fit into the list, or whose Newton step was not found.
    """
    if contact is None:
        return robots
    robots = robots & ~(load(work.contact.missed, 0) > 0.0)
    store_step_end(rods, work, stage)
    for pair in range(contact.n_pairs):
        right = int(load_number(contact.pairs, 2 * pair))
        left = int(load_number(contact.pairs, 2 * pair + 1))
        doubtful = robots & ~on_their_sides(rods, work.contact.ends, q_0, right, left)
        if any_lane(doubtful):
            robots = robots & ~(doubtful & come_to_cross(rods, work.contact.ends, q_0, right, left))
    return robots


@kernel
def on_their_sides(rods, q_1, q_0, right, left):
    """Mask of the robots whose limbs lie on either side of a line through the hub at q_1, so that they cannot cross."""
    edges = rods.nodes_per_limb - 1
    wx, wy = across_gap(rods, q_0, right, left)
    high, low = splat(-np.inf), splat(np.inf)
    for i in range(1, edges + 1):
        dx, dy = edge_vector(q_1, 0, right * edges + i)
        x = add_product(dx * wx, dy, wy)
        dx, dy = edge_vector(q_1, 0, left * edges + i)
        y = add_product(dx * wx, dy, wy)
        high = select(high > x, high, x)
        low = select(low < y, low, y)
    return (high < 0.0) & (low > 0.0)


@kernel
def store_step_end(rods, work, stage):
    """Fill work.contact.ends with the positions at the end of the step [m]."""
    for row in range(2 * n_nodes(rods)):
        q = load(work.q, row)
        store(work.contact.ends, row, 2.0 * q - load(stage.q_hat, row) if stage.ahead else q)


@kernel
def come_to_cross(rods, q_1, q_0, right, left):
    """Mask of the robots with edges of two limbs that cross at q_1 and did not at q_0."""
    edges = rods.nodes_per_limb - 1
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
    i, j = tail_node(rods, e), tail_node(rods, f)
    ex, ey = edge_vector(q, i, e + 1)
    fx, fy = edge_vector(q, j, f + 1)
    dx, dy = edge_vector(q, i, j)
    cross = subtract_product(ex * fy, ey, fx)
    of_e = cross * subtract_product(dx * fy, dy, fx)
    of_f = cross * subtract_product(dx * ey, dy, ex)
    squared = cross * cross
    return (of_e > 0.0) & (of_e < squared) & (of_f > 0.0) & (of_f < squared)


@kernel
def add_contact_energy(contact, rods, work, q, energy):
    """Add that of the pairs that were listed last, at positions q [J]."""
    if contact is None:
        return energy
    for slot in range(n_listed(work)):
        i, _, _ = members(rods, work, slot)
        depth = load(work.contact.slots, SLOT_ROWS * slot + THICKNESS) - gap(rods, work, slot, q)
        depth = select(depth > 0.0, depth, 0.0)
        energy = add_product(energy, 0.5 * load(contact.stiffness, i) * depth, depth)
    return energy
