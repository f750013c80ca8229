"""Limbs that came to cross in a step: such a step is refused, so that limbs do not pass through each other."""

import numpy as np

from seastar_gym.der.geometry import edge_vector
from seastar_gym.der.star import n_nodes, tail_node
from seastar_gym.der.terms.near_pairs import across_gap
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, any_lane, load, load_number, select, splat, store, subtract_product


@kernel
def those_uncrossed(contact, rods, work, stage, q_0, robots):
    """Mask of those among `robots` without edges of different limbs that cross now and did not when the step began.

    Robots whose near pairs did not all fit into the list, or whose Newton step was not found, are left out.
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
