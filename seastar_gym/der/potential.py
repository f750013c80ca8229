"""One implicit stage as a minimisation: gradient and Hessian of the incremental potential

    Phi(q) = |q - q_free|^2_M / (2 gamma^2) + U(q) + gamma sum_i c_i |v_i|^3 / 3,    v = (q - q_hat)/gamma,

whose stationary point satisfies (13.9) with gamma for h. The Hessian is (13.12).

U is a sum over edges and hinges. For an edge with net moment mu (slopes of the hinges it ends, minus slopes of the
hinges it begins), tension T, hinge stiffness sigma (sum of second slopes), u = e/|e|^2 and theta its direction:

    gradient  T e/|e| + mu grad theta,
    Hessian   K = EA/l e e^T/|e|^2 + T/|e| n n^T + mu Hess theta + sigma grad theta grad theta^T,

and a hinge of edges (a, b) couples them by -s grad theta_a grad theta_b^T, s its second slope. With K of the inner
edge and P_i = s_i grad theta(outer edge) grad theta(inner edge)^T at node i, the blocks of node i are

    D_i = inertia + drag + K_inner + K_outer + P_i + P_i^T    with itself,
    B_i = -K_inner - P_i - P_{i-1}                            with node i - 1,
    C_i = P_{i-1}                                             with node i - 2.

A limb is assembled and eliminated in one sweep from tip to root. Positive definite without trouble; where a pivot
is not positive, the robot's matrix is made again from the convex parts alone (mask `convex`): the Gauss-Newton part
of bending, no compression in T/|e| n n^T, no mu Hess theta. That matrix is positive definite by construction, and the
full one, with its quadratic convergence, is used wherever its pivots allow it.
"""

import numpy as np

from seastar_gym.der.bending import bending_energy, bending_slopes, moment
from seastar_gym.der.compilation import kernel
from seastar_gym.der.drag import drag_slopes
from seastar_gym.der.geometry import edge_geometry, half_angle
from seastar_gym.der.lanes import load, select, splat, store
from seastar_gym.der.star_matrix import (
    add_coupling,
    add_diagonal,
    add_to_rhs,
    clear_roots,
    eliminate_node,
    smaller,
    solve_roots,
    substitute_limb,
)
from seastar_gym.der.stretching import stretching_energy, tension


@kernel
def edge_slopes(rods, e, length, ux, uy, net_moment, stiffness, convex):
    """(E_s, f, K): stretching energy, gradient (x, y) and Hessian (xx, xy, yy) of U in edge e."""
    T = tension(rods, e, length)
    pull = T * length
    along = load(rods.EA_over_l, e) * length * length
    across = select(convex & (pull < 0.0), 0.0, pull) + stiffness
    turning = select(convex, 0.0, net_moment)
    uxx, uxy, uyy = ux * ux, ux * uy, uy * uy
    twist = 2.0 * turning * uxy
    return (
        stretching_energy(rods, e, T),
        (pull * ux - net_moment * uy, pull * uy + net_moment * ux),
        (
            along * uxx + across * uyy + twist,
            (along - across) * uxy + turning * (uyy - uxx),
            along * uyy + across * uxx - twist,
        ),
    )


@kernel
def node_slopes(rods, work, node, gamma, inverse_gamma):
    """(energy, gradient (x, y), Hessian (xx, xy, yy)) of a node's inertia and drag."""
    qx, qy = load(work.q, 2 * node), load(work.q, 2 * node + 1)
    m = load(rods.mass, node) * inverse_gamma * inverse_gamma
    dx, dy = qx - load(work.q_free, 2 * node), qy - load(work.q_free, 2 * node + 1)
    vx = (qx - load(work.q_hat, 2 * node)) * inverse_gamma
    vy = (qy - load(work.q_hat, 2 * node + 1)) * inverse_gamma
    potential, c_speed, c_over_speed = drag_slopes(load(rods.drag, node), vx, vy)
    wx, wy = c_over_speed * vx * inverse_gamma, c_over_speed * vy * inverse_gamma
    diagonal = m + c_speed * inverse_gamma
    return (
        0.5 * m * (dx * dx + dy * dy) + gamma * potential,
        (m * dx + c_speed * vx, m * dy + c_speed * vy),
        (diagonal + wx * vx, wx * vy, diagonal + wy * vy),
    )


@kernel
def coupling(s, outer_ux, outer_uy, inner_ux, inner_uy):
    """P = s grad theta(outer) grad theta(inner)^T, row by row, with grad theta = (-u_y, u_x)."""
    sx, sy = -s * outer_uy, s * outer_ux
    return -sx * inner_uy, sx * inner_ux, -sy * inner_uy, sy * inner_ux


@kernel
def assemble_hub_hinges(rods, work, convex):
    """Root edges, hub hinges and their couplings, into `work`; returns the hinges' energy [J]."""
    n_limbs, edges = rods.n_limbs, rods.nodes_per_limb - 1
    for limb in range(n_limbs):
        geometry = edge_geometry(work.q, 0, limb * edges + 1)
        for k in range(5):
            store(work.root_edges, 5 * limb + k, geometry[k])
        store(work.hub_moment, limb, 0.0)
        store(work.hub_stiffness, limb, 0.0)
    energy = splat(0.0)
    for a in range(n_limbs):
        b = (a + 1) % n_limbs
        ax, ay, a_length, aux, auy = load_root_edge(work, a)
        bx, by, b_length, bux, buy = load_root_edge(work, b)
        hinge = a * edges
        t = half_angle(ax, ay, a_length, bx, by, b_length, rods.hub_side)
        bend = moment(rods, hinge, t, load(work.hub_EI_kappa_bar, a))
        slope, s = bending_slopes(rods, hinge, t, bend, convex)
        energy += bending_energy(rods, hinge, bend)
        store(work.hub_t, a, t)
        store(work.hub_moment, a, load(work.hub_moment, a) - slope)
        store(work.hub_moment, b, load(work.hub_moment, b) + slope)
        store(work.hub_stiffness, a, load(work.hub_stiffness, a) + s)
        store(work.hub_stiffness, b, load(work.hub_stiffness, b) + s)
        Q = coupling(s, bux, buy, aux, auy)
        for k in range(4):
            store(work.hub_coupling, 4 * a + k, Q[k])
    return energy


@kernel
def load_root_edge(work, limb):
    """Geometry of a limb's root edge, as edge_geometry gave it."""
    row = 5 * limb
    return (
        load(work.root_edges, row),
        load(work.root_edges, row + 1),
        load(work.root_edges, row + 2),
        load(work.root_edges, row + 3),
        load(work.root_edges, row + 4),
    )


@kernel
def sweep_limb(rods, work, limb, gamma, inverse_gamma, convex):
    """Assemble and eliminate a limb from its tip to its root node; root node and hub go into the dense system.

    Returns (energy, decrement, pivot): the limb's part of Phi and of the Newton decrement [J], and its smallest pivot.
    """
    hub, edges = rods.n_limbs, rods.nodes_per_limb - 1
    first = limb * edges
    zero = splat(0.0)
    energy, decrement, pivot = zero, zero, splat(np.inf)
    # What the outer edge and the hinge at the node bring; the tip has neither.
    outer_f, outer_K, slope, s, P = (zero, zero), (zero, zero, zero), zero, zero, (zero, zero, zero, zero)
    # What eliminated nodes take away: the last one from this node (S, h), its coupling (T) and the node before (U, k),
    # the one before the last from this node (V, w).
    S, T, U, V = (zero, zero, zero), (zero, zero, zero, zero), (zero, zero, zero), (zero, zero, zero)
    h, k, w = (zero, zero), (zero, zero), (zero, zero)
    inner = inner_edge(work, limb, first, edges)
    for i in range(edges, 1, -1):
        node = first + i
        e = node - 1
        below = inner_edge(work, limb, first, i - 1)
        t = half_angle(below[0], below[1], below[2], inner[0], inner[1], inner[2], 1.0)
        bend = moment(rods, e, t, load(rods.EI_kappa_bar, e))
        below_slope, below_s = bending_slopes(rods, e, t, bend, convex)
        E_s, f, K = edge_slopes(rods, e, inner[2], inner[3], inner[4], below_slope - slope, below_s + s, convex)
        E_n, r, D = node_slopes(rods, work, node, gamma, inverse_gamma)
        R = coupling(below_s, inner[3], inner[4], below[3], below[4])
        previous_U, previous_k = U, k
        S, T, U, h, k, node_decrement, node_pivot = eliminate_node(
            work,
            node,
            diagonal_block(D, K, outer_K, P, S, V),
            (
                -K[0] - P[0] - R[0] - T[0],
                -K[1] - P[1] - R[1] - T[1],
                -K[1] - P[2] - R[2] - T[2],
                -K[2] - P[3] - R[3] - T[3],
            ),
            R,
            (r[0] + f[0] - outer_f[0] - h[0] - w[0], r[1] + f[1] - outer_f[1] - h[1] - w[1]),
        )
        V, w = previous_U, previous_k
        energy += E_s + E_n + bending_energy(rods, e, bend)
        decrement += node_decrement
        pivot = smaller(pivot, node_pivot)
        outer_f, outer_K, slope, s, P, inner = f, K, below_slope, below_s, R, below
    net_moment, stiffness = load(work.hub_moment, limb) - slope, load(work.hub_stiffness, limb) + s
    E_s, f, K = edge_slopes(rods, first, inner[2], inner[3], inner[4], net_moment, stiffness, convex)
    E_n, r, D = node_slopes(rods, work, first + 1, gamma, inverse_gamma)
    add_diagonal(work, limb, diagonal_block(D, K, outer_K, P, S, V))
    add_coupling(work, limb, hub, (-K[0] - P[0] - T[0], -K[1] - P[1] - T[1], -K[1] - P[2] - T[2], -K[2] - P[3] - T[3]))
    add_diagonal(work, hub, (K[0] - U[0], K[1] - U[1], K[2] - U[2]))
    add_to_rhs(work, limb, r[0] + f[0] - outer_f[0] - h[0] - w[0], r[1] + f[1] - outer_f[1] - h[1] - w[1])
    add_to_rhs(work, hub, -f[0] - k[0], -f[1] - k[1])
    return energy + E_s + E_n, decrement, pivot


@kernel
def inner_edge(work, limb, first, i):
    """Geometry of the edge that ends at node i of a limb; that of a root edge is known already."""
    if i == 1:
        return load_root_edge(work, limb)
    return edge_geometry(work.q, first + i - 1, first + i)


@kernel
def diagonal_block(D, K, outer_K, P, S, V):
    """D + K_inner + K_outer + P + P^T less the Schur complements S and V."""
    return (
        D[0] + K[0] + outer_K[0] + 2.0 * P[0] - S[0] - V[0],
        D[1] + K[1] + outer_K[1] + P[1] + P[2] - S[1] - V[1],
        D[2] + K[2] + outer_K[2] + 2.0 * P[3] - S[2] - V[2],
    )


@kernel
def add_hub(rods, work, gamma, inverse_gamma):
    """The hub's inertia and drag and the hub hinges' couplings, into the dense system; returns the energy [J]."""
    n_limbs = hub = rods.n_limbs
    energy, r, D = node_slopes(rods, work, 0, gamma, inverse_gamma)
    add_diagonal(work, hub, D)
    add_to_rhs(work, hub, r[0], r[1])
    for a in range(n_limbs):
        b = (a + 1) % n_limbs
        xx, xy = load(work.hub_coupling, 4 * a), load(work.hub_coupling, 4 * a + 1)
        yx, yy = load(work.hub_coupling, 4 * a + 2), load(work.hub_coupling, 4 * a + 3)
        add_coupling(work, b, a, (-xx, -xy, -yx, -yy))
        add_coupling(work, b, hub, (xx, xy, yx, yy))
        add_coupling(work, a, hub, (xx, yx, xy, yy))
        add_diagonal(work, hub, (-2.0 * xx, -xy - yx, -2.0 * yy))
    return energy


@kernel
def newton_direction(rods, work, gamma, inverse_gamma, convex):
    """Solve Hessian x = gradient of Phi at work.q into work.solution.

    Returns (Phi, decrement, pivot): the potential [J], gradient^T Hessian^-1 gradient [J], and the smallest pivot,
    which is not positive (or NaN) where the Hessian is not positive definite.
    """
    n_limbs = rods.n_limbs
    n_roots = 2 * (n_limbs + 1)
    clear_roots(work, n_roots)
    energy = assemble_hub_hinges(rods, work, convex)
    decrement, pivot = splat(0.0), splat(np.inf)
    for limb in range(n_limbs):
        limb_energy, limb_decrement, limb_pivot = sweep_limb(rods, work, limb, gamma, inverse_gamma, convex)
        energy += limb_energy
        decrement += limb_decrement
        pivot = smaller(pivot, limb_pivot)
    energy += add_hub(rods, work, gamma, inverse_gamma)
    root_decrement, root_pivot = solve_roots(work, n_roots)
    edges = rods.nodes_per_limb - 1
    for axis in range(2):
        store(work.solution, axis, load(work.roots_rhs, 2 * n_limbs + axis))
        for limb in range(n_limbs):
            store(work.solution, 2 * (limb * edges + 1) + axis, load(work.roots_rhs, 2 * limb + axis))
    for limb in range(n_limbs):
        substitute_limb(work, limb * edges, rods.nodes_per_limb)
    return energy, decrement + root_decrement, smaller(pivot, root_pivot)
