"""Root nodes and a rigid hub: root nodes couple with the hub's place and orientation, not with each other.

The hub's unknowns are its place and its turns (see terms/clamp.py): that of elasticity, Phi, and that of damping, a
dummy where there is none. A root node couples with a turn by -C grad theta, the hub by the sum of +C grad theta, the
turn with itself by the sum of C.
"""

import numpy as np

from seastar_gym.der.linear.star_matrix import (
    eliminate_node,
    keep_pivots,
    load_coupling,
    load_root,
    pivots,
    smaller,
    store_pair,
    substitute_node,
)
from seastar_gym.der.star import load_root_edge
from seastar_gym.der.terms.clamp import CLAMP_ROWS, ELASTIC, VISCOUS
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load, select, splat, store, subtract_product


@kernel
def turn_stiffnesses(rods, work, limb):
    """C of a limb's clamp, of elasticity and of damping [N m]; a body has one turn, which meets both."""
    C = load(work.hub_coupling, CLAMP_ROWS * limb + ELASTIC)
    if rods.damping is None:
        return C, splat(0.0)
    C_d = load(work.hub_coupling, CLAMP_ROWS * limb + VISCOUS)
    if rods.body is None:
        return C, C_d
    return C + C_d, splat(0.0)


@kernel
def begin_turn(rods, work):
    """(B, D, r): the hub's coupling with its turns, their block and right-hand side, before limbs add theirs.

    Where there is no damping, or none of it, its turn is no unknown.
    """
    zero, dummy = splat(0.0), splat(1.0)
    if rods.body is not None:
        x, y, stiffness, residual = load_coupling(work.body.system, 0)
        return (x, zero, y, zero), (stiffness, zero, dummy), (residual, zero)
    if rods.damping is not None:
        dummy = select(load(rods.damping, 0) > 0.0, zero, dummy)
    return (zero, zero, zero, zero), (zero, zero, dummy), (zero, zero)


@kernel
def with_arm(rods, work, limb, H, x, y, C):
    """(x, y, C) of a root node's coupling with the turn, and of the limb's part of the turn's stiffness.

    On a body its root is carried along by the turn: H J more, and 2 J.t more of C, t = -(x, y) the root's own coupling.
    """
    if rods.body is None:
        return x, y, C
    a_x, a_y = load(work.body.arm, 2 * limb), load(work.body.arm, 2 * limb + 1)
    carried = 2.0 * subtract_product(x * a_y, y, a_x)
    return x + subtract_product(H[1] * a_x, H[0], a_y), y + subtract_product(H[3] * a_x, H[2], a_y), C + carried


@kernel
def solve_rigid_hub(rods, work, D_hub, r_hub):
    """Eliminate root nodes and hub, and solve for them; solutions as solve_ring leaves them, in work.root_solution.

    Returns the part of the Newton decrement and the smallest pivot.
    """
    edges, zero = rods.edges_per_limb, splat(0.0)
    nothing = (zero, zero, zero, zero)
    B_hub, D_turn, r_turn = begin_turn(rods, work)
    decrement, pivot = zero, splat(np.inf)
    for limb in range(rods.n_limbs):
        D, H, r = load_root(work, limb)
        edge = load_root_edge(work, limb)
        C, C_d = turn_stiffnesses(rods, work, limb)
        # grad theta = (-u_y, u_x) in the root node, its opposite in the hub.
        x, y, x_d, y_d = C * edge.uy, -C * edge.ux, C_d * edge.uy, -C_d * edge.ux
        B_hub = (B_hub[0] - x, B_hub[1] - x_d, B_hub[2] - y, B_hub[3] - y_d)
        x, y, C = with_arm(rods, work, limb, H, x, y, C)
        D_turn = (D_turn[0] + C, D_turn[1], D_turn[2] + C_d)
        D_hub, B_hub, D_turn, r_hub, r_turn, part, root_pivot = eliminate_node(
            work, limb * edges + 1, D, H, (x, x_d, y, y_d), r, D_hub, B_hub, D_turn, r_hub, r_turn
        )
        decrement += part
        pivot = smaller(pivot, root_pivot)
    D_turn, _, _, r_turn, _, part, hub_pivot = eliminate_node(
        work, 0, D_hub, B_hub, nothing, r_hub, D_turn, nothing, (zero, zero, zero), r_turn, (zero, zero)
    )
    decrement += part
    inverse, lower, inverse_d, r_d, turn_pivot = pivots(D_turn, r_turn)
    keep_pivots(work.root_pivots, 0, inverse, inverse_d)
    keep_pivots(work.root_pivots, 1, lower, lower)
    turn_d = r_d * inverse_d
    turn = subtract_product(r_turn[0] * inverse, lower, turn_d)
    substitute_rigid_hub(rods, work, turn, turn_d)
    decrement += add_product(r_turn[0] * r_turn[0] * inverse, turn_d, r_d)
    return decrement, smaller(smaller(pivot, hub_pivot), turn_pivot)


@kernel
def substitute_rigid_hub(rods, work, turn, turn_d):
    """Solutions of the hub and of the root nodes, into work.root_solution, from those of the hub's turns."""
    edges, zero = rods.edges_per_limb, splat(0.0)
    hub = substitute_node(work, 0, turn, turn_d, zero, zero)
    store_pair(work.root_solution, 2 * rods.n_limbs, hub)
    if rods.body is not None:  # for tail_solution
        store(work.root_solution, 2 * rods.n_limbs + 2, turn)
    for limb in range(rods.n_limbs):
        root = substitute_node(work, limb * edges + 1, hub[0], hub[1], turn, turn_d)
        store_pair(work.root_solution, 2 * limb, root)
