"""One implicit stage as a minimisation: gradient and Hessian of the incremental potential

    Phi(q) = |v - v_hat|^2_M / 2 + U(q) + gamma sum_i c_i |w_i|^3 / 3,    v = (q - q_hat)/gamma, w = v - u,

whose stationary point satisfies (13.9) with gamma for h; scenes with more terms add theirs (damping.py, drag.py,
added_mass.py). That of a dead load F is -gamma F (v - v_hat): what differs from -F q is constant, and like the rest of
Phi it is the same for every observer who moves uniformly. The Hessian is (13.12).

U is a sum over edges and hinges. For an edge with net moment mu (slopes of the hinges it ends, minus slopes of the
hinges it begins), tension T, hinge stiffness sigma (sum of second slopes), u = e/|e|^2 and theta its direction:

    gradient  T e/|e| + mu grad theta,
    Hessian   K = EA/l e e^T/|e|^2 + T/|e| n n^T + mu Hess theta + sigma grad theta grad theta^T,

and a hinge of edges (a, b) couples them by -s grad theta_a grad theta_b^T, s its second slope. With K of the inner
edge and P_i = s_i grad theta(outer edge) grad theta(inner edge)^T at node i, the blocks of node i are

    D_i = inertia + drag + K_inner + K_outer + P_i + P_i^T    with itself,
    B_i = -K_inner - P_i - P_{i-1}                            with node i - 1,
    C_i = P_{i-1}                                             with node i - 2.

A limb is assembled and eliminated in one sweep from tip to root. Where a pivot is not positive, the robot's matrix is
regularised: made again from the convex parts alone (mask `convex`): the Gauss-Newton part
of bending, no compression in T/|e| n n^T, no mu Hess theta. That matrix is positive definite by construction, and the
full one, with its quadratic convergence, is used wherever its pivots allow it.

At the end are the elastic and kinetic energy of a lane group, and the moments that resist its actuators.
"""

import numpy as np

from seastar_gym.lanes.compile import entry_point, inlined_kernel, kernel
from seastar_gym.lanes.registers import add_product, borrow, load, select, splat, store, subtract_product
from seastar_gym.rods.body import begin_body, move_roots, tail_motion
from seastar_gym.rods.body_forces import add_body, add_turning_energy, pass_to_hub
from seastar_gym.rods.contact.forces import add_contact, contact_force
from seastar_gym.rods.linear import (
    add_symmetric,
    eliminate_node,
    negative,
    smaller,
    solve_lone_root,
    solve_rigid_hub,
    solve_ring,
    store_root,
)
from seastar_gym.rods.star import (
    EDGE_ROWS,
    convex_part,
    edge_geometry,
    edge_of,
    half_angle,
    load_root_edge,
    node_motion,
    root_place,
    tail_node,
)
from seastar_gym.rods.terms.added_mass import add_fluid_inertia, subtract_edge_fluid_inertia
from seastar_gym.rods.terms.along import (
    bending_compliance,
    bending_stiffness,
    natural_moment,
    natural_tangent,
    stiffening_rate,
)
from seastar_gym.rods.terms.bending import bending_energy, bending_slopes, moment
from seastar_gym.rods.terms.clamp import add_clamp_moments, assemble_clamps, clamp_energy
from seastar_gym.rods.terms.damping import damped_energy, damped_stiffness, damped_stress
from seastar_gym.rods.terms.drag import add_cross_flow, add_middle_drag, drag_slopes
from seastar_gym.rods.terms.fluid import fluid_velocity
from seastar_gym.rods.terms.hub import set_natural_hub_angles
from seastar_gym.rods.terms.inertia import kinetic_energy, subtract_edge_inertia
from seastar_gym.rods.terms.load import load_power, nodal_load
from seastar_gym.rods.terms.own import add_own_slopes, own_energy
from seastar_gym.rods.terms.stretching import stretching_energy, tension


@kernel
def edge_slopes(rods, work, stage, e, edge, net_moment, stiffness, convex, tail, head):
    """(E, f, K) of an edge: elasticity, damping and, with consistent masses, what its inertia differs from lumped.

    tail, head: Motions of its ends.
    """
    slopes = elastic_slopes(rods, work, stage, e, edge, net_moment, stiffness, convex)
    slopes = subtract_edge_inertia(rods, stage, e, tail, head, slopes)
    return subtract_edge_fluid_inertia(rods, work, stage, e, tail, head, slopes)


@kernel
def elastic_slopes(rods, work, stage, e, edge, net_moment, stiffness, convex):
    """(E_s, f, K): stretching energy, gradient and Hessian of U in edge e, whose geometry is `edge`, with damping.

    With n = (u_y, -u_x): K = across |u|^2 1 + (along - across) u u^T + mu (u n^T + n u^T), along = EA |e|^2/l.
    """
    ux, uy = edge.ux, edge.uy
    T = tension(rods, e, edge.length)
    natural = splat(0.0)
    pull = damped_stress(rods, work.damping.tension, e, stage.inverse_gamma, T, natural) * edge.length
    across = convex_part(convex, pull) + stiffness
    mu = select(convex, 0.0, net_moment)
    twice_mu = mu + mu
    stretching = damped_stiffness(rods, stage.inverse_gamma, load(rods.stretching.EA_over_l, e))
    difference = stretching * edge.squared - across
    isotropic = across * edge.inverse
    wx = add_product(difference * ux, twice_mu, uy)
    wy = subtract_product(difference * uy, twice_mu, ux)
    return (
        damped_energy(
            rods,
            work.damping.tension,
            e,
            stage.inverse_gamma,
            T,
            natural,
            load(rods.stretching.l_over_EA, e),
            stretching_energy(rods, e, T),
        ),
        (subtract_product(pull * ux, net_moment, uy), add_product(pull * uy, net_moment, ux)),
        (
            add_product(isotropic, wx, ux),
            subtract_product(wx * uy, mu, edge.inverse),
            add_product(isotropic, wy, uy),
        ),
    )


@kernel
def hinge_slopes(rods, work, stage, hinge, t, EI_kappa_bar, convex):
    """(E_b, slope, s): energy of a hinge and its first and second slope in phi, with damping."""
    bend = moment(rods, work, hinge, t, EI_kappa_bar)
    inverse_gamma = stage.inverse_gamma
    energy = damped_energy(
        rods, work.damping.bending, hinge, inverse_gamma, bend, EI_kappa_bar, bending_compliance(rods, work, hinge),
        bending_energy(rods, work, hinge, bend),
    )  # fmt: skip
    stiffness = damped_stiffness(rods, inverse_gamma, bending_stiffness(rods, work, hinge))
    damped = damped_stress(rods, work.damping.bending, hinge, inverse_gamma, bend, EI_kappa_bar)
    slope, s = bending_slopes(stiffness, t, damped, convex)
    return energy, slope, s


@kernel
def node_slopes(rods, work, stage, node, motion, push):
    """(energy, gradient, Hessian) of a node's inertia, drag and load, and of a force that pushes it, (x, y) [N]."""
    dx, dy, wx, wy = motion
    m = load(rods.inertia.node, node)
    m_over_gamma = m * stage.inverse_gamma
    potential, c_speed, c_over_speed = drag_slopes(load(rods.drag.node, node), wx, wy)
    c_over_speed *= stage.inverse_gamma
    sx, sy = c_over_speed * wx, c_over_speed * wy
    diagonal = (m_over_gamma + c_speed) * stage.inverse_gamma
    Fx, Fy = nodal_load(rods, node)
    slopes = (
        add_product(0.5 * m * add_product(dx * dx, dy, dy), stage.gamma, potential - load_power(rods, node, dx, dy)),
        (
            add_product(c_speed * wx, m_over_gamma, dx) - Fx - push[0],
            add_product(c_speed * wy, m_over_gamma, dy) - Fy - push[1],
        ),
        (add_product(diagonal, sx, wx), sx * wy, add_product(diagonal, sy, wy)),
    )
    slopes = add_fluid_inertia(work, node, dx, dy, stage.inverse_gamma, slopes)
    if rods.own is not None:
        slopes = add_own_slopes(rods, work, stage, node, wx, wy, slopes)
    return add_cross_flow(rods, work.normals, node, wx, wy, stage.gamma, stage.inverse_gamma, slopes)


@kernel
def coupling(s, outer, inner):
    """P = s grad theta(outer) grad theta(inner)^T, row by row, with grad theta = (-u_y, u_x)."""
    sx, sy = s * outer.ux, s * outer.uy
    return sy * inner.uy, -sy * inner.ux, -sx * inner.uy, sx * inner.ux


@kernel
def assemble_hub(rods, work, stage, convex):
    """Root edges, the hub's moments on them, stiffnesses and couplings, into `work`; returns the hub's energy [J]."""
    begin_body(rods, work)
    n_limbs, edges = rods.n_limbs, rods.edges_per_limb
    for limb in range(n_limbs):
        edge = edge_geometry(work.q, tail_node(rods, limb * edges), limb * edges + 1)
        for k in range(EDGE_ROWS):
            store(work.root_edges, EDGE_ROWS * limb + k, edge[k])
        store(work.hub.moment, limb, 0.0)
        store(work.hub.stiffness, limb, 0.0)
        store(work.hub.t, limb, 0.0)
    if rods.clamp is None:
        return assemble_hub_hinges(rods, work, stage, convex)
    return assemble_clamps(rods, work, stage, convex)


@kernel
def assemble_hub_hinges(rods, work, stage, convex):
    """Hub hinges and their couplings, into `work`; returns the hinges' energy [J]."""
    n_limbs, edges = rods.n_limbs, rods.edges_per_limb
    energy = splat(0.0)
    for a in range(n_limbs):
        b = a + 1 if a + 1 < n_limbs else 0
        hinge = a * edges
        first, second = load_root_edge(work, a), load_root_edge(work, b)
        t = half_angle(first, second, rods.hub.side)
        E_b, slope, s = hinge_slopes(rods, work, stage, hinge, t, load(work.hub.EI_kappa_bar, a), convex)
        energy += E_b
        store(work.hub.t, a, t)
        store(work.hub.moment, a, load(work.hub.moment, a) - slope)
        store(work.hub.moment, b, load(work.hub.moment, b) + slope)
        store(work.hub.stiffness, a, load(work.hub.stiffness, a) + s)
        store(work.hub.stiffness, b, load(work.hub.stiffness, b) + s)
        Q = coupling(s, second, first)
        for k in range(4):
            store(work.hub.coupling, 4 * a + k, Q[k])
    return energy


@kernel
def inner_edge(work, limb, first, i):
    """Geometry of the edge that ends at node i of a limb; that of a root edge is known already."""
    if i == 1:
        return load_root_edge(work, limb)
    return edge_geometry(work.q, first + i - 1, first + i)


@kernel
def join_hub(rods, work, stage, limb, convex, motion, energy, hub, D, r, f_tail):
    """Add a limb's block and right-hand side (D, r) where it starts, and its root edge's pull, to those of the hub.

    motion: Motion of the limb's root. hub: (D, r) of the hub. A root on a body has drag and fluid of its own.

    Returns the energy [J] and the hub's (D, r).
    """
    D_hub, r_hub = hub
    if rods.body is None:
        return energy, add_symmetric(D_hub, D), (r_hub[0] + r[0] - f_tail[0], r_hub[1] + r[1] - f_tail[1])
    place = root_place(rods, limb)
    E_r, g, drag = node_slopes(rods, work, stage, place, motion, contact_force(work, place))
    pull = (g[0] - f_tail[0], g[1] - f_tail[1])
    D, r = add_symmetric(D, drag), (r[0] + pull[0], r[1] + pull[1])
    pass_to_hub(rods, work, limb, convex, D, r, pull)
    return energy + E_r, add_symmetric(D_hub, D), (r_hub[0] + r[0], r_hub[1] + r[1])


@inlined_kernel
def sweep_limb(rods, work, stage, limb, convex, D_hub, r_hub):
    """Assemble and eliminate a limb from its tip to node 2, and put its root node into the ring.

    Returns the hub's block and right-hand side (D_hub, r_hub), updated, the limb's part of Phi and of the Newton
    decrement [J], and its smallest pivot.
    """
    edges = rods.edges_per_limb
    first = limb * edges
    zero = splat(0.0)
    energy, decrement, pivot = zero, zero, splat(np.inf)
    # Blocks of the node at hand and of the one before it, as far as the outer nodes and edges have made them.
    D, B, r = (zero, zero, zero), (zero, zero, zero, zero), (zero, zero)
    D_before, r_before = D, r
    slope, s = zero, zero
    edge, motion = inner_edge(work, limb, first, edges), node_motion(work, stage, first + edges)
    for i in range(edges, 1, -1):
        node = first + i
        e = node - 1
        before, motion_before = inner_edge(work, limb, first, i - 1), node_motion(work, stage, node - 1)
        t = half_angle(before, edge, 1.0)
        natural = natural_moment(rods, work, e)
        E_b, slope_before, s_before = hinge_slopes(rods, work, stage, e, t, natural, convex)
        net_moment, stiffness = slope_before - slope, s_before + s
        E_s, f, K = edge_slopes(rods, work, stage, e, edge, net_moment, stiffness, convex, motion_before, motion)
        E_n, g, inertia = node_slopes(rods, work, stage, node, motion, contact_force(work, node))
        energy += (E_s + E_n) + E_b
        P = coupling(s_before, edge, before)
        energy, f_head, f_tail, K, K_B = add_middle_drag(rods, work, stage, e, motion_before, motion, energy, f, K)
        D_1 = (D_before[0] + K[0] + 2.0 * P[0], D_before[1] + K[1] + (P[1] + P[2]), D_before[2] + K[2] + 2.0 * P[3])
        K_P = (K_B[0] + P[0], K_B[1] + P[1], K_B[1] + P[2], K_B[2] + P[3])
        D, B, D_before, r, r_before, part, node_pivot = eliminate_node(
            work,
            node,
            add_symmetric(D, add_symmetric(inertia, K)),
            (B[0] - K_P[0], B[1] - K_P[1], B[2] - K_P[2], B[3] - K_P[3]),
            P,
            (r[0] + (g[0] + f_head[0]), r[1] + (g[1] + f_head[1])),
            D_1,
            negative(P),
            (zero, zero, zero),
            (r_before[0] - f_tail[0], r_before[1] - f_tail[1]),
            (zero, zero),
        )
        decrement += part
        pivot = smaller(pivot, node_pivot)
        slope, s, edge, motion = slope_before, s_before, before, motion_before
    net_moment, stiffness = load(work.hub.moment, limb) - slope, load(work.hub.stiffness, limb) + s
    of_hub = motion if rods.clamp is None else tail_motion(rods, work, stage, first)  # hub hinges do not ask for it
    E_s, f, K = edge_slopes(rods, work, stage, first, edge, net_moment, stiffness, convex, of_hub, motion)
    E_n, g, inertia = node_slopes(rods, work, stage, first + 1, motion, contact_force(work, first + 1))
    energy, f_head, f_tail, K, K_B = add_middle_drag(rods, work, stage, first, of_hub, motion, energy, f, K)
    store_root(
        work,
        limb,
        add_symmetric(D, add_symmetric(inertia, K)),
        (B[0] - K_B[0], B[1] - K_B[1], B[2] - K_B[1], B[3] - K_B[2]),
        (r[0] + (g[0] + f_head[0]), r[1] + (g[1] + f_head[1])),
    )
    energy, D_hub, r_hub = join_hub(
        rods, work, stage, limb, convex, of_hub, energy + E_s + E_n, (D_hub, r_hub),
        add_symmetric(D_before, K), r_before, f_tail,
    )  # fmt: skip
    return D_hub, r_hub, energy, decrement, pivot


@kernel
def factorise(rods, work, stage, convex):
    """Assemble and eliminate the Hessian and gradient of Phi at work.q; substitution is left to newton.py.

    convex: Mask of the robots whose matrix is made from convex parts alone, or None for none.

    Returns (Phi, decrement, pivot): the potential [J], gradient^T Hessian^-1 gradient [J], and the smallest pivot,
    which is not positive (or NaN) where the Hessian is not positive definite.
    """
    energy = assemble_hub(rods, work, stage, convex)
    energy = add_contact(rods, work, stage, convex, energy)
    of_hub = node_motion(work, stage, 0)
    E_n, r_hub, D_hub = node_slopes(rods, work, stage, 0, of_hub, contact_force(work, 0))
    E_n, r_hub, D_hub = add_body(rods, work, stage, convex, of_hub, E_n, r_hub, D_hub)
    energy += E_n
    decrement, pivot = splat(0.0), splat(np.inf)
    for limb in range(rods.n_limbs):
        D_hub, r_hub, limb_energy, limb_decrement, limb_pivot = sweep_limb(
            rods, work, stage, limb, convex, D_hub, r_hub
        )
        energy += limb_energy
        decrement += limb_decrement
        pivot = smaller(pivot, limb_pivot)
    hub_decrement, hub_pivot = solve_hub(rods, work, D_hub, r_hub)
    return energy, decrement + hub_decrement, smaller(pivot, hub_pivot)


@kernel
def solve_hub(rods, work, D_hub, r_hub):
    """Eliminate the root nodes and the hub, and solve for them, into work.system.root_solution.

    Returns the part of the Newton decrement [J] and the smallest pivot.
    """
    if rods.clamp is not None:
        return solve_rigid_hub(rods, work, D_hub, r_hub)
    if rods.n_limbs > 1:
        return solve_ring(work, rods.n_limbs, D_hub, r_hub)
    return solve_lone_root(work, D_hub, r_hub)


@kernel
def hinge_energy(rods, work, e, first, second, side, EI_kappa_bar):
    """Energy of the hinge that ends with edge e, between two edges [J]."""
    return bending_energy(rods, work, e, moment(rods, work, e, half_angle(first, second, side), EI_kappa_bar))


@kernel
def hub_hinge_energy(rods, work, q, limb, edge):
    """Energy of the hub hinge from a limb, whose root edge is given, to the next one [J]."""
    root = limb * rods.edges_per_limb
    next_root = edge_of(rods, q, (root + rods.edges_per_limb) % rods.n_edges)
    return hinge_energy(rods, work, root, edge, next_root, rods.hub.side, load(work.hub.EI_kappa_bar, limb))


@kernel
def elastic_energy(rods, work, q):
    """Stretching and bending energy (13.14) at the natural hub angles in `work`, and that of own terms [J]."""
    total = splat(0.0) if rods.clamp is None else clamp_energy(rods, work, q)
    edges = rods.edges_per_limb
    for limb in range(rods.n_limbs):
        root = limb * edges
        edge = edge_of(rods, q, root)
        hinge = hub_hinge_energy(rods, work, q, limb, edge) if rods.clamp is None else splat(0.0)
        total += stretching_energy(rods, root, tension(rods, root, edge.length)) + hinge
        for e in range(root + 1, root + edges):
            before, edge = edge, edge_of(rods, q, e)
            hinge = hinge_energy(rods, work, e, before, edge, 1.0, natural_moment(rods, work, e))
            total += stretching_energy(rods, e, tension(rods, e, edge.length)) + hinge
    if rods.own is not None:
        total = own_energy(rods, q, total)
    return total


@kernel
def add_hub_hinge_moments(rods, work, q, moments):
    """Add dU/d(delta) of the hub hinges [N m], of every limb's rotation delta.

    The natural angle of the hinge from limb j to limb j + 1 grows with the rotation of j + 1 and falls with that of j.
    """
    edges = rods.edges_per_limb
    for limb in range(rods.n_limbs):
        after = (limb + 1) % rods.n_limbs
        t = half_angle(edge_of(rods, q, limb * edges), edge_of(rods, q, after * edges), rods.hub.side)
        natural_moment = load(work.hub.EI_kappa_bar, limb)
        natural = 0.5 * load(rods.bending.dl_over_EI, limb * edges) * natural_moment
        push = moment(rods, work, limb * edges, t, natural_moment) * add_product(1.0, natural, natural)
        store(moments, limb, load(moments, limb) + push)
        store(moments, after, load(moments, after) - push)


@kernel
def add_moments_along(rods, work, actuation, q, moments):
    """Add dU/d(delta) of the hinges within limbs [N m], where actuators bend or stiffen them."""
    edges = rods.edges_per_limb
    for limb in range(rods.n_limbs):
        delta, total, edge = load(actuation.delta_psi_start, limb), splat(0.0), edge_of(rods, q, limb * edges)
        rate = stiffening_rate(rods, delta)
        for e in range(limb * edges + 1, (limb + 1) * edges):
            before, edge = edge, edge_of(rods, q, e)
            bend = moment(rods, work, e, half_angle(before, edge, 1.0), natural_moment(rods, work, e))
            natural = natural_tangent(rods.along, e, delta)
            total = subtract_product(total, load(rods.along.share, e) * bend, add_product(1.0, natural, natural))
            total = add_product(total, rate, bending_energy(rods, work, e, bend))
        store(moments, limb, load(moments, limb) + total)


@kernel
def fill_moments(rods, work, actuation, q, moments):
    """Fill rows with dU/d(delta) [N m] of every limb's rotation `actuation.delta_psi_start`: what resists its actuator.

    Leaves in `work` what is natural at these rotations.
    """
    set_natural_hub_angles(rods, work, actuation, splat(0.0))
    for limb in range(rods.n_limbs):
        store(moments, limb, 0.0)
    if rods.clamp is None:
        add_hub_hinge_moments(rods, work, q, moments)
    else:
        add_clamp_moments(rods, work, actuation, q, moments)
    if rods.along is not None:
        add_moments_along(rods, work, actuation, q, moments)


@entry_point
def energies(rods, work, actuation, q, v, elastic, kinetic):
    """Fill `elastic` (13.14) and `kinetic` [J], shape (1, N_LANES), at the rotations `actuation.delta_psi_end`."""
    rods, work, actuation = borrow(rods), borrow(work), borrow(actuation)
    q, v = borrow(q), borrow(v)
    move_roots(rods, q, v)
    set_natural_hub_angles(rods, work, actuation, splat(1.0))
    store(borrow(elastic), 0, elastic_energy(rods, work, q))
    store(borrow(kinetic), 0, energy_of_motion(rods, q, v))


@kernel
def energy_of_motion(rods, q, v):
    """Kinetic energy of nodes and body with velocities v [J]."""
    still = (splat(0.0), splat(0.0))
    return add_turning_energy(rods, q, v, still, kinetic_energy(rods, v, still))


@kernel
def fill_relative(rods, q, v, relative):
    """Fill `relative` with the velocities v [m/s] less those of the water at the nodes, and with those of a body."""
    for node in range(rods.n_nodes):
        x, y = fluid_velocity(rods, load(q, 2 * node), load(q, 2 * node + 1))
        store(relative, 2 * node, load(v, 2 * node) - x)
        store(relative, 2 * node + 1, load(v, 2 * node + 1) - y)
    if rods.body is not None:
        store(relative, 2 * rods.n_nodes, load(v, 2 * rods.n_nodes))
        move_roots(rods, q, relative)


@entry_point
def energies_in_water(rods, q, v, relative, kinetic):
    """Fill `kinetic` [J], shape (n_groups, 1, N_LANES), with the kinetic energies of lane groups relative to the water.

    relative: Rows for the velocities of a lane group, to be written over.
    """
    rods, relative = borrow(rods), borrow(relative)
    for group in range(q.shape[0]):
        place = borrow(q[group])
        fill_relative(rods, place, borrow(v[group]), relative)
        store(borrow(kinetic[group]), 0, energy_of_motion(rods, place, relative))
