"""Symmetric linear systems on a star of chains, solved in O(N) by L D L^T in 2 x 2 blocks.

Each limb is eliminated from its tip to its root node, then the ring of root nodes, then the hub; substitution goes
the other way. A node i of a limb couples with nodes i - 1 and i - 2 only; a root node with its neighbours in the
ring and the hub.

Eliminating a node with the rows [D  W | r], D symmetric 2 x 2 and W its couplings with the columns of later nodes,
has the pivots d_x = D_xx and d_y = D_yy - l D_xy, l = D_xy/d_x. It leaves l, the two columns of L (x = W_x/d_x,
y = (W_y - l W_x)/d_y) and z = (r_x/d_x, (r_y - l r_x)/d_y) for the substitution.

Blocks are tuples: symmetric ones (xx, xy, yy), couplings (xx, xy, yx, yy) row by row.

An eliminated star is solved for its own right-hand side, and for others.

With a rigid hub, root nodes couple with the hub's place and orientation, not with each other.

The hub's unknowns are its place and its turns (see terms/clamp.py): that of elasticity, Phi, and that of damping, a
dummy where there is none. A root node couples with a turn by -C grad theta, the hub by the sum of +C grad theta, the
turn with itself by the sum of C.
"""

from typing import NamedTuple

import numpy as np

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import N_LANES, add_product, load, select, splat, store, subtract_product
from seastar_gym.lanes.rows import aligned_rows
from seastar_gym.rods.body import tail_solution
from seastar_gym.rods.star import load_root_edge
from seastar_gym.rods.terms.clamp import CLAMP_ROWS, ELASTIC, VISCOUS

NODE_ROWS = 11  # l, x and y for four columns each, z
ROOT_ROWS = 15  # l, x and y for six columns each, z
RING_ROWS = 9  # D, H and r of a root node


class System(NamedTuple):
    """The linear system of a Newton step.

    factors, root_factors: What elimination leaves of nodes, and of root nodes and hub. ring: Blocks of root nodes.
    root_solution: Solution of root nodes and hub.
    pivots, root_pivots: For solutions of other right-hand sides; None where nobody asks.
    """

    factors: np.ndarray
    ring: np.ndarray
    root_factors: np.ndarray
    root_solution: np.ndarray
    pivots: np.ndarray | None
    root_pivots: np.ndarray | None


def memory(n_nodes: int, n_limbs: int, again: bool) -> System:
    """Zeroed memory; again: Whether the system is solved for other right-hand sides, too."""
    counts = (NODE_ROWS * n_nodes, RING_ROWS * n_limbs, ROOT_ROWS * n_limbs, 2 * (n_limbs + 2))
    pivots = [aligned_rows(count, N_LANES) if again else None for count in (2 * n_nodes, 2 * (n_limbs + 1))]
    return System(*(aligned_rows(count, N_LANES) for count in counts), *pivots)


@kernel
def smaller(a, b):
    """The smaller of two numbers, NaN if b is NaN: a pivot that is not a number must not pass for a good one."""
    return select(a < b, a, b)


@kernel
def pivots(D, r):
    """(1/d_x, l, 1/d_y, r_y - l r_x, smaller pivot) of a diagonal block and its right-hand side."""
    inverse_x = 1.0 / D[0]
    lower = D[1] * inverse_x
    d_y = subtract_product(D[2], lower, D[1])
    return inverse_x, lower, 1.0 / d_y, subtract_product(r[1], lower, r[0]), smaller(D[0], d_y)


@kernel
def keep_pivots(kept, slot, inverse_x, inverse_y):
    """Keep 1/d_x and 1/d_y of a node for `solve_again`, in scenes that need it (None in others)."""
    if kept is None:
        return
    store_pair(kept, 2 * slot, (inverse_x, inverse_y))


@kernel
def less_symmetric(D, x0, y0, u0, w0, x1, y1, u1, w1):
    """D less the Schur complement of the columns 0 and 1; D is their symmetric block."""
    return (
        subtract_product(subtract_product(D[0], x0, u0), y0, w0),
        subtract_product(subtract_product(D[1], x0, u1), y0, w1),
        subtract_product(subtract_product(D[2], x1, u1), y1, w1),
    )


@kernel
def less_coupling(B, x0, y0, x1, y1, u2, w2, u3, w3):
    """B less the Schur complement of the rows 0, 1 and the columns 2, 3."""
    return (
        subtract_product(subtract_product(B[0], x0, u2), y0, w2),
        subtract_product(subtract_product(B[1], x0, u3), y0, w3),
        subtract_product(subtract_product(B[2], x1, u2), y1, w2),
        subtract_product(subtract_product(B[3], x1, u3), y1, w3),
    )


@kernel
def less_vector(r, x0, y0, x1, y1, rx, wr):
    """r less what the eliminated right-hand side takes from the columns 0 and 1."""
    return (
        subtract_product(subtract_product(r[0], x0, rx), y0, wr),
        subtract_product(subtract_product(r[1], x1, rx), y1, wr),
    )


@kernel
def eliminate_node(work, node, D, B, C, r, D_1, B_1, D_2, r_1, r_2):
    """Eliminate a node that couples with a next node (B) and a second next node (C).

    D_1, r_1: The next node's diagonal block and right-hand side so far. B_1: Its coupling with the second next, so far.
    D_2, r_2: The second next node's.

    Returns those five, updated, the node's part r^T D^-1 r of the Newton decrement, and its smaller pivot.
    """
    inverse_x, lower, inverse_y, wr, pivot = pivots(D, r)
    wa, wb = subtract_product(B[2], lower, B[0]), subtract_product(B[3], lower, B[1])
    wc, wd = subtract_product(C[2], lower, C[0]), subtract_product(C[3], lower, C[1])
    xa, xb, xc, xd = B[0] * inverse_x, B[1] * inverse_x, C[0] * inverse_x, C[1] * inverse_x
    ya, yb, yc, yd = wa * inverse_y, wb * inverse_y, wc * inverse_y, wd * inverse_y
    zx, zy = r[0] * inverse_x, wr * inverse_y
    keep_pivots(work.system.pivots, node, inverse_x, inverse_y)
    row = NODE_ROWS * node
    store(work.system.factors, row, lower)
    store(work.system.factors, row + 1, xa)
    store(work.system.factors, row + 2, xb)
    store(work.system.factors, row + 3, xc)
    store(work.system.factors, row + 4, xd)
    store(work.system.factors, row + 5, ya)
    store(work.system.factors, row + 6, yb)
    store(work.system.factors, row + 7, yc)
    store(work.system.factors, row + 8, yd)
    store(work.system.factors, row + 9, zx)
    store(work.system.factors, row + 10, zy)
    return (
        less_symmetric(D_1, xa, ya, B[0], wa, xb, yb, B[1], wb),
        less_coupling(B_1, xa, ya, xb, yb, C[0], wc, C[1], wd),
        less_symmetric(D_2, xc, yc, C[0], wc, xd, yd, C[1], wd),
        less_vector(r_1, xa, ya, xb, yb, r[0], wr),
        less_vector(r_2, xc, yc, xd, yd, r[0], wr),
        add_product(zx * r[0], zy, wr),
        pivot,
    )


@kernel
def substitute_node(work, node, bx, by, ax, ay):
    """Solution (x, y) of a node from those of its next node (bx, by) and its second next (ax, ay)."""
    row = NODE_ROWS * node
    y = subtract_product(load(work.system.factors, row + 10), load(work.system.factors, row + 7), ax)
    x = subtract_product(load(work.system.factors, row + 9), load(work.system.factors, row + 3), ax)
    y = subtract_product(y, load(work.system.factors, row + 8), ay)
    x = subtract_product(x, load(work.system.factors, row + 4), ay)
    y = subtract_product(y, load(work.system.factors, row + 5), bx)
    x = subtract_product(x, load(work.system.factors, row + 1), bx)
    y = subtract_product(y, load(work.system.factors, row + 6), by)
    x = subtract_product(x, load(work.system.factors, row + 2), by)
    return subtract_product(x, load(work.system.factors, row), y), y


@kernel
def load_block(rows, row):
    """Three rows, a symmetric block."""
    return load(rows, row), load(rows, row + 1), load(rows, row + 2)


@kernel
def load_coupling(rows, row):
    """Four rows, a coupling."""
    return load(rows, row), load(rows, row + 1), load(rows, row + 2), load(rows, row + 3)


@kernel
def load_pair(rows, row):
    """Two rows, a vector."""
    return load(rows, row), load(rows, row + 1)


@kernel
def store_pair(rows, row, vector):
    store(rows, row, vector[0])
    store(rows, row + 1, vector[1])


@kernel
def eliminate_root(work, root, D, N, E, H, r, D_next, H_next, r_next, D_last, H_last, r_last, D_hub, r_hub):
    """Eliminate a root node that couples with the next one (N), the last one (E) and the hub (H).

    Returns the next one's (D, E, H, r), the last one's (D, H, r) and the hub's (D, r), updated, and the node's
    decrement and smaller pivot.
    """
    inverse_x, lower, inverse_y, wr, pivot = pivots(D, r)
    row = ROOT_ROWS * root
    ua, ub, uc, ud, ue, uf = N[0], N[1], E[0], E[1], H[0], H[1]
    wa, wb = subtract_product(N[2], lower, ua), subtract_product(N[3], lower, ub)
    wc, wd = subtract_product(E[2], lower, uc), subtract_product(E[3], lower, ud)
    we, wf = subtract_product(H[2], lower, ue), subtract_product(H[3], lower, uf)
    xa, xb, xc, xd, xe, xf = (
        ua * inverse_x, ub * inverse_x, uc * inverse_x, ud * inverse_x, ue * inverse_x, uf * inverse_x,
    )  # fmt: skip
    ya, yb, yc, yd, ye, yf = (
        wa * inverse_y, wb * inverse_y, wc * inverse_y, wd * inverse_y, we * inverse_y, wf * inverse_y,
    )  # fmt: skip
    zx, zy = r[0] * inverse_x, wr * inverse_y
    keep_pivots(work.system.root_pivots, root, inverse_x, inverse_y)
    left = (lower, xa, xb, xc, xd, xe, xf, ya, yb, yc, yd, ye, yf, zx, zy)
    for k in range(ROOT_ROWS):
        store(work.system.root_factors, row + k, left[k])
    zero = splat(0.0)
    return (
        (
            less_symmetric(D_next, xa, ya, ua, wa, xb, yb, ub, wb),
            less_coupling((zero, zero, zero, zero), xa, ya, xb, yb, uc, wc, ud, wd),
            less_coupling(H_next, xa, ya, xb, yb, ue, we, uf, wf),
            less_vector(r_next, xa, ya, xb, yb, r[0], wr),
        ),
        (
            less_symmetric(D_last, xc, yc, uc, wc, xd, yd, ud, wd),
            less_coupling(H_last, xc, yc, xd, yd, ue, we, uf, wf),
            less_vector(r_last, xc, yc, xd, yd, r[0], wr),
        ),
        (less_symmetric(D_hub, xe, ye, ue, we, xf, yf, uf, wf), less_vector(r_hub, xe, ye, xf, yf, r[0], wr)),
        add_product(zx * r[0], zy, wr),
        pivot,
    )


@kernel
def substitute_root(work, root, following, last, hub):
    """Solution (x, y) of a root node from those of the next one, the last one and the hub."""
    row = ROOT_ROWS * root
    x, y = load(work.system.root_factors, row + 13), load(work.system.root_factors, row + 14)
    known = (hub[0], hub[1], last[0], last[1], following[0], following[1])
    columns = (5, 6, 3, 4, 1, 2)
    for k in range(6):
        x = subtract_product(x, load(work.system.root_factors, row + columns[k]), known[k])
        y = subtract_product(y, load(work.system.root_factors, row + columns[k] + 6), known[k])
    return subtract_product(x, load(work.system.root_factors, row), y), y


@kernel
def add_symmetric(D, E):
    return D[0] + E[0], D[1] + E[1], D[2] + E[2]


@kernel
def add_coupling(B, C):
    return B[0] + C[0], B[1] + C[1], B[2] + C[2], B[3] + C[3]


@kernel
def transposed(B):
    return B[0], B[2], B[1], B[3]


@kernel
def negative(B):
    return -B[0], -B[1], -B[2], -B[3]


@kernel
def load_root(work, root):
    """(D, H, r) of a root node after its limb has been eliminated, without the hub hinges' couplings."""
    row = RING_ROWS * root
    return (
        load_block(work.system.ring, row),
        load_coupling(work.system.ring, row + 3),
        load_pair(work.system.ring, row + 7),
    )


@kernel
def store_root(work, root, D, H, r):
    """Store (D, H, r) of a root node for load_root."""
    row = RING_ROWS * root
    for k in range(3):
        store(work.system.ring, row + k, D[k])
    for k in range(4):
        store(work.system.ring, row + 3 + k, H[k])
    for k in range(2):
        store(work.system.ring, row + 7 + k, r[k])


@kernel
def hub_coupling(work, limb):
    """Block Q of the hub hinge between a limb and the next: rows of the next root node, columns of this one's."""
    return load_coupling(work.hub.coupling, 4 * limb)


@kernel
def solve_ring(work, n_limbs, D_hub, r_hub):
    """Eliminate the ring of root nodes and the hub, and solve for them.

    Into work.system.root_solution: x of root node k in row 2 k, y behind it, the hub's at 2 n_limbs.

    A hub hinge from limb a to limb b adds -Q between the root nodes (b, a), Q between (b, hub), Q^T between (a, hub)
    and -Q - Q^T at the hub.

    Returns the part of the Newton decrement and the smallest pivot.
    """
    last = n_limbs - 1
    Q_last = hub_coupling(work, last)
    zero = splat(0.0)
    for limb in range(n_limbs):
        Q = hub_coupling(work, limb)
        D_hub = (D_hub[0] - 2.0 * Q[0], D_hub[1] - Q[1] - Q[2], D_hub[2] - 2.0 * Q[3])
    D, H, r = load_root(work, 0)
    Q = hub_coupling(work, 0)
    H = add_coupling(H, add_coupling(transposed(Q), Q_last))
    E = negative(Q_last)
    D_last, H_last, r_last = load_root(work, last)
    H_last = add_coupling(H_last, add_coupling(transposed(Q_last), hub_coupling(work, last - 1)))
    decrement, pivot = zero, splat(np.inf)
    for root in range(last - 1):
        D_next, H_next, r_next = load_root(work, root + 1)
        Q_next = hub_coupling(work, root + 1)
        H_next = add_coupling(H_next, add_coupling(transposed(Q_next), Q))
        (D, E, H, r), (D_last, H_last, r_last), (D_hub, r_hub), part, root_pivot = eliminate_root(
            work,
            root,
            D,
            negative(transposed(Q)),
            E,
            H,
            r,
            D_next,
            H_next,
            r_next,
            D_last,
            H_last,
            r_last,
            D_hub,
            r_hub,
        )
        Q = Q_next
        decrement += part
        pivot = smaller(pivot, root_pivot)
    # The last but one couples with the last (as its next and as the ring's last) and the hub, the last with the hub.
    nothing = (zero, zero, zero, zero)
    E = add_coupling(E, negative(transposed(Q)))
    D_last, H_last, D_hub, r_last, r_hub, part, root_pivot = eliminate_node(
        work, 0, D, E, H, r, D_last, H_last, D_hub, r_last, r_hub
    )
    decrement += part
    pivot = smaller(pivot, root_pivot)
    D_hub, _, _, r_hub, _, part, root_pivot = eliminate_node(
        work, 1, D_last, H_last, nothing, r_last, D_hub, nothing, (zero, zero, zero), r_hub, (zero, zero)
    )
    decrement += part
    pivot = smaller(pivot, root_pivot)
    inverse_x, lower, inverse_y, wr, root_pivot = pivots(D_hub, r_hub)
    keep_pivots(work.system.root_pivots, last, inverse_x, inverse_y)
    keep_pivots(work.system.root_pivots, n_limbs, lower, lower)
    y = wr * inverse_y
    x = subtract_product(r_hub[0] * inverse_x, lower, y)
    decrement += add_product(r_hub[0] * r_hub[0] * inverse_x, y, wr)
    substitute_ring(work, n_limbs, (x, y))
    return decrement, smaller(pivot, root_pivot)


@kernel
def substitute_ring(work, n_limbs, hub):
    """Solution of the hub, given, and of the ring of root nodes, into work.system.root_solution."""
    last, zero = n_limbs - 1, splat(0.0)
    of_last = substitute_node(work, 1, hub[0], hub[1], zero, zero)
    following = substitute_node(work, 0, of_last[0], of_last[1], hub[0], hub[1])
    store_pair(work.system.root_solution, 2 * n_limbs, hub)
    store_pair(work.system.root_solution, 2 * last, of_last)
    store_pair(work.system.root_solution, 2 * last - 2, following)
    for root in range(last - 2, -1, -1):
        following = substitute_root(work, root, following, of_last, hub)
        store_pair(work.system.root_solution, 2 * root, following)


@kernel
def solve_lone_root(work, D_hub, r_hub):
    """Solve for root node and hub of a single limb, see solve_ring: its root node couples with the hub alone."""
    zero = splat(0.0)
    nothing = (zero, zero, zero, zero)
    D, H, r = load_root(work, 0)
    D_hub, _, _, r_hub, _, decrement, pivot = eliminate_node(
        work, 1, D, H, nothing, r, D_hub, nothing, (zero, zero, zero), r_hub, (zero, zero)
    )
    inverse_x, lower, inverse_y, wr, hub_pivot = pivots(D_hub, r_hub)
    keep_pivots(work.system.root_pivots, 0, inverse_x, inverse_y)
    keep_pivots(work.system.root_pivots, 1, lower, lower)
    y = wr * inverse_y
    x = subtract_product(r_hub[0] * inverse_x, lower, y)
    store_pair(work.system.root_solution, 2, (x, y))
    store_pair(work.system.root_solution, 0, substitute_node(work, 1, x, y, zero, zero))
    return decrement + add_product(r_hub[0] * r_hub[0] * inverse_x, y, wr), smaller(pivot, hub_pivot)


@kernel
def turn_stiffnesses(rods, work, limb):
    """C of a limb's clamp, of elasticity and of damping [N m]; a body has one turn, which meets both."""
    C = load(work.hub.coupling, CLAMP_ROWS * limb + ELASTIC)
    if rods.damping is None:
        return C, splat(0.0)
    C_d = load(work.hub.coupling, CLAMP_ROWS * limb + VISCOUS)
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
    """Eliminate root nodes and hub, and solve for them; solutions as solve_ring leaves them.

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
    keep_pivots(work.system.root_pivots, 0, inverse, inverse_d)
    keep_pivots(work.system.root_pivots, 1, lower, lower)
    turn_d = r_d * inverse_d
    turn = subtract_product(r_turn[0] * inverse, lower, turn_d)
    substitute_rigid_hub(rods, work, turn, turn_d)
    decrement += add_product(r_turn[0] * r_turn[0] * inverse, turn_d, r_d)
    return decrement, smaller(smaller(pivot, hub_pivot), turn_pivot)


@kernel
def substitute_rigid_hub(rods, work, turn, turn_d):
    """Solutions of the hub and of the root nodes, into work.system.root_solution, from those of the hub's turns."""
    edges, zero = rods.edges_per_limb, splat(0.0)
    hub = substitute_node(work, 0, turn, turn_d, zero, zero)
    store_pair(work.system.root_solution, 2 * rods.n_limbs, hub)
    if rods.body is not None:  # for tail_solution
        store(work.system.root_solution, 2 * rods.n_limbs + 2, turn)
    for limb in range(rods.n_limbs):
        root = substitute_node(work, limb * edges + 1, hub[0], hub[1], turn, turn_d)
        store_pair(work.system.root_solution, 2 * limb, root)


@kernel
def substitute_star(rods, work, x):
    """Write the solution of the eliminated system over rows x, node by node, then a body's angle [rad]."""
    edges = rods.edges_per_limb
    hub = load_pair(work.system.root_solution, 2 * rods.n_limbs)
    store_pair(x, 0, hub)
    for limb in range(rods.n_limbs):
        first = limb * edges
        before = tail_solution(rods, work, limb, hub)
        here = load_pair(work.system.root_solution, 2 * limb)
        store_pair(x, 2 * (first + 1), here)
        for i in range(2, edges + 1):
            before, here = here, substitute_node(work, first + i, here[0], here[1], before[0], before[1])
            store_pair(x, 2 * (first + i), here)
    if rods.body is not None:
        store(x, 2 * rods.n_nodes, load(work.system.root_solution, 2 * rods.n_limbs + 2))
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
        store_pair(work.system.ring, RING_ROWS * limb + 7, add(load_pair(r, 2 * (first + 1)), r_next))
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
    """Solve for root nodes with right-hand sides in work.system.ring, a rigid hub, and a body's angle (torque)."""
    edges, zero = rods.edges_per_limb, splat(0.0)
    r_turn = (torque, zero)
    for limb in range(rods.n_limbs):
        r = load_pair(work.system.ring, RING_ROWS * limb + 7)
        r_hub, r_turn = eliminate_again(work, limb * edges + 1, r, r_hub, r_turn)
    r_turn, _ = eliminate_again(work, 0, r_hub, r_turn, (zero, zero))
    inverse, inverse_d = load_pair(work.system.root_pivots, 0)
    lower = load(work.system.root_pivots, 2)
    turn_d = subtract_product(r_turn[1], lower, r_turn[0]) * inverse_d
    substitute_rigid_hub(rods, work, subtract_product(r_turn[0] * inverse, lower, turn_d), turn_d)


@kernel
def add(a, b):
    return a[0] + b[0], a[1] + b[1]


@kernel
def solve_ring_again(work, n_limbs, r_hub):
    """Solve for the ring of root nodes, whose right-hand sides are in work.system.ring, and the hub."""
    last, zero = n_limbs - 1, splat(0.0)
    r, r_last = load_pair(work.system.ring, 7), load_pair(work.system.ring, RING_ROWS * last + 7)
    for root in range(last - 1):
        r_next = load_pair(work.system.ring, RING_ROWS * (root + 1) + 7)
        r_next, r_last, r_hub = eliminate_root_again(work, root, r, r_next, r_last, r_hub)
        r = r_next
    r_last, r_hub = eliminate_again(work, 0, r, r_last, r_hub)
    r_hub, _ = eliminate_again(work, 1, r_last, r_hub, (zero, zero))
    inverse_x, inverse_y = load_pair(work.system.root_pivots, 2 * last)
    lower = load(work.system.root_pivots, 2 * n_limbs)
    y = subtract_product(r_hub[1], lower, r_hub[0]) * inverse_y
    substitute_ring(work, n_limbs, (subtract_product(r_hub[0] * inverse_x, lower, y), y))


@kernel
def solve_lone_root_again(work, r_hub):
    """Solve for root node and hub of a single limb, whose root's right-hand side is in work.system.ring."""
    zero = splat(0.0)
    r_hub, _ = eliminate_again(work, 1, load_pair(work.system.ring, 7), r_hub, (zero, zero))
    inverse_x, inverse_y = load_pair(work.system.root_pivots, 0)
    lower = load(work.system.root_pivots, 2)
    y = subtract_product(r_hub[1], lower, r_hub[0]) * inverse_y
    x = subtract_product(r_hub[0] * inverse_x, lower, y)
    store_pair(work.system.root_solution, 2, (x, y))
    store_pair(work.system.root_solution, 0, substitute_node(work, 1, x, y, zero, zero))


@kernel
def eliminate_again(work, node, r, r_1, r_2):
    """Right-hand sides of the next node and the second next, updated as eliminate_node does."""
    row = NODE_ROWS * node
    inverse_x, inverse_y = load_pair(work.system.pivots, 2 * node)
    wr = subtract_product(r[1], load(work.system.factors, row), r[0])
    store_pair(work.system.factors, row + 9, (r[0] * inverse_x, wr * inverse_y))
    xa, xb, xc, xd = (
        load(work.system.factors, row + 1), load(work.system.factors, row + 2), load(work.system.factors, row + 3),
        load(work.system.factors, row + 4),
    )  # fmt: skip
    ya, yb, yc, yd = (
        load(work.system.factors, row + 5), load(work.system.factors, row + 6), load(work.system.factors, row + 7),
        load(work.system.factors, row + 8),
    )  # fmt: skip
    return less_vector(r_1, xa, ya, xb, yb, r[0], wr), less_vector(r_2, xc, yc, xd, yd, r[0], wr)


@kernel
def eliminate_root_again(work, root, r, r_next, r_last, r_hub):
    """Right-hand sides of the next root, the last one and the hub, updated as eliminate_root does."""
    row = ROOT_ROWS * root
    inverse_x, inverse_y = load_pair(work.system.root_pivots, 2 * root)
    wr = subtract_product(r[1], load(work.system.root_factors, row), r[0])
    store_pair(work.system.root_factors, row + 13, (r[0] * inverse_x, wr * inverse_y))
    return (
        less_columns(work, row + 1, r_next, r[0], wr),
        less_columns(work, row + 3, r_last, r[0], wr),
        less_columns(work, row + 5, r_hub, r[0], wr),
    )


@kernel
def less_columns(work, row, r, rx, wr):
    """r less what a root node takes from the two columns whose factors begin at `row`."""
    xa, xb = load(work.system.root_factors, row), load(work.system.root_factors, row + 1)
    ya, yb = load(work.system.root_factors, row + 6), load(work.system.root_factors, row + 7)
    return less_vector(r, xa, ya, xb, yb, rx, wr)
