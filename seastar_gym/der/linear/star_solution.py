"""Solutions of an eliminated star of chains, see star_matrix.py, for its own right-hand side and for another one."""

from seastar_gym.der.body.body import tail_solution
from seastar_gym.der.linear.rigid_hub import substitute_rigid_hub
from seastar_gym.der.linear.star_matrix import (
    NODE_ROWS,
    RING_ROWS,
    ROOT_ROWS,
    less_vector,
    load_pair,
    store_pair,
    substitute_node,
    substitute_ring,
)
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load, splat, store, subtract_product


@kernel
def substitute_star(rods, work, x):
    """Write the solution of the eliminated system over rows x, node by node, then a body's angle [rad]."""
    edges = rods.edges_per_limb
    hub = load_pair(work.root_solution, 2 * rods.n_limbs)
    store_pair(x, 0, hub)
    for limb in range(rods.n_limbs):
        first = limb * edges
        before = tail_solution(rods, work, limb, hub)
        here = load_pair(work.root_solution, 2 * limb)
        store_pair(x, 2 * (first + 1), here)
        for i in range(2, edges + 1):
            before, here = here, substitute_node(work, first + i, here[0], here[1], before[0], before[1])
            store_pair(x, 2 * (first + i), here)
    if rods.body is not None:
        store(x, 2 * rods.n_nodes, load(work.root_solution, 2 * rods.n_limbs + 2))
        store(x, 2 * rods.n_nodes + 1, 0.0)


@kernel
def with_torque(work, limb, force, torque):
    """A torque on a body with that of a force at a limb's root."""
    x, y = load(work.body.arm, 2 * limb), load(work.body.arm, 2 * limb + 1)
    return subtract_product(add_product(torque, x, force[1]), y, force[0])


@kernel
def solve_again(rods, work, r, x):
    """Write H^-1 r over rows x, which may be r, H the matrix that was eliminated last; its pivots were kept."""
    edges, zero = rods.edges_per_limb, splat(0.0)
    r_hub, torque = load_pair(r, 0), zero
    if rods.body is not None:
        torque = load(r, 2 * rods.n_nodes)
    for limb in range(rods.n_limbs):
        first = limb * edges
        r_next, r_second = (zero, zero), (zero, zero)
        for i in range(edges, 1, -1):
            node = first + i
            r_next, r_second = eliminate_again(work, node, add(load_pair(r, 2 * node), r_next), r_second, (zero, zero))
        store_pair(work.ring, RING_ROWS * limb + 7, add(load_pair(r, 2 * (first + 1)), r_next))
        r_hub = add(r_hub, r_second)
        if rods.body is not None:
            torque = with_torque(work, limb, r_second, torque)
    if rods.clamp is not None:
        solve_rigid_hub_again(rods, work, r_hub, torque)
    elif rods.n_limbs > 1:
        solve_ring_again(work, rods.n_limbs, r_hub)
    else:
        solve_lone_root_again(work, r_hub)
    substitute_star(rods, work, x)


@kernel
def solve_rigid_hub_again(rods, work, r_hub, torque):
    """Solve for the root nodes, whose right-hand sides are in work.ring, a rigid hub, and a body's angle (torque)."""
    edges, zero = rods.edges_per_limb, splat(0.0)
    r_turn = (torque, zero)
    for limb in range(rods.n_limbs):
        r = load_pair(work.ring, RING_ROWS * limb + 7)
        r_hub, r_turn = eliminate_again(work, limb * edges + 1, r, r_hub, r_turn)
    r_turn, _ = eliminate_again(work, 0, r_hub, r_turn, (zero, zero))
    inverse, inverse_d = load_pair(work.root_pivots, 0)
    lower = load(work.root_pivots, 2)
    turn_d = subtract_product(r_turn[1], lower, r_turn[0]) * inverse_d
    substitute_rigid_hub(rods, work, subtract_product(r_turn[0] * inverse, lower, turn_d), turn_d)


@kernel
def add(a, b):
    return a[0] + b[0], a[1] + b[1]


@kernel
def solve_ring_again(work, n_limbs, r_hub):
    """Solve for the ring of root nodes, whose right-hand sides are in work.ring, and the hub."""
    last, zero = n_limbs - 1, splat(0.0)
    r, r_last = load_pair(work.ring, 7), load_pair(work.ring, RING_ROWS * last + 7)
    for root in range(last - 1):
        r_next = load_pair(work.ring, RING_ROWS * (root + 1) + 7)
        r_next, r_last, r_hub = eliminate_root_again(work, root, r, r_next, r_last, r_hub)
        r = r_next
    r_last, r_hub = eliminate_again(work, 0, r, r_last, r_hub)
    r_hub, _ = eliminate_again(work, 1, r_last, r_hub, (zero, zero))
    inverse_x, inverse_y = load_pair(work.root_pivots, 2 * last)
    lower = load(work.root_pivots, 2 * n_limbs)
    y = subtract_product(r_hub[1], lower, r_hub[0]) * inverse_y
    substitute_ring(work, n_limbs, (subtract_product(r_hub[0] * inverse_x, lower, y), y))


@kernel
def solve_lone_root_again(work, r_hub):
    """Solve for root node and hub of a single limb, whose root's right-hand side is in work.ring."""
    zero = splat(0.0)
    r_hub, _ = eliminate_again(work, 1, load_pair(work.ring, 7), r_hub, (zero, zero))
    inverse_x, inverse_y = load_pair(work.root_pivots, 0)
    lower = load(work.root_pivots, 2)
    y = subtract_product(r_hub[1], lower, r_hub[0]) * inverse_y
    x = subtract_product(r_hub[0] * inverse_x, lower, y)
    store_pair(work.root_solution, 2, (x, y))
    store_pair(work.root_solution, 0, substitute_node(work, 1, x, y, zero, zero))


@kernel
def eliminate_again(work, node, r, r_1, r_2):
    """Right-hand sides of the next node and the second next, updated as eliminate_node does."""
    row = NODE_ROWS * node
    inverse_x, inverse_y = load_pair(work.pivots, 2 * node)
    wr = subtract_product(r[1], load(work.factors, row), r[0])
    store_pair(work.factors, row + 9, (r[0] * inverse_x, wr * inverse_y))
    xa, xb, xc, xd = (
        load(work.factors, row + 1), load(work.factors, row + 2), load(work.factors, row + 3),
        load(work.factors, row + 4),
    )  # fmt: skip
    ya, yb, yc, yd = (
        load(work.factors, row + 5), load(work.factors, row + 6), load(work.factors, row + 7),
        load(work.factors, row + 8),
    )  # fmt: skip
    return less_vector(r_1, xa, ya, xb, yb, r[0], wr), less_vector(r_2, xc, yc, xd, yd, r[0], wr)


@kernel
def eliminate_root_again(work, root, r, r_next, r_last, r_hub):
    """Right-hand sides of the next root, the last one and the hub, updated as eliminate_root does."""
    row = ROOT_ROWS * root
    inverse_x, inverse_y = load_pair(work.root_pivots, 2 * root)
    wr = subtract_product(r[1], load(work.root_factors, row), r[0])
    store_pair(work.root_factors, row + 13, (r[0] * inverse_x, wr * inverse_y))
    return (
        less_columns(work, row + 1, r_next, r[0], wr),
        less_columns(work, row + 3, r_last, r[0], wr),
        less_columns(work, row + 5, r_hub, r[0], wr),
    )


@kernel
def less_columns(work, row, r, rx, wr):
    """r less what a root node takes from the two columns whose factors begin at `row`."""
    xa, xb = load(work.root_factors, row), load(work.root_factors, row + 1)
    ya, yb = load(work.root_factors, row + 6), load(work.root_factors, row + 7)
    return less_vector(r, xa, ya, xb, yb, rx, wr)
