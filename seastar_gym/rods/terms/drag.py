"""Quadratic drag (13.8): F = -c |w| w with c = 1/2 rho_f C_d D dl_i, from the dissipation potential c |w|^3 / 3.

`drag_slopes` is this law; `node_slopes` in potential.py adds it to the other terms of a node.

w = v - u is a node's velocity relative to the fluid. With a coefficient C_t < C_d of its own for flow along a limb,
c has C_t for C_d, and the flow across each edge that a node ends adds -c_n |w_n| w_n n, w_n = w n, from the potential
c_n |w_n|^3 / 3: half the edge belongs to the node, so c_n = 1/2 rho_f (C_d - C_t) D l/2. Across a limb the two make
C_d, along it C_t; both potentials are convex. n is the edge's normal where the stage's first guess has it, which is off
by the square of the step: a constant of the minimisation, and schemes keep their order up to 2.

The continuum's discretisation integrates both potentials by Simpson's rule: a third of that at the nodes, and the rest
in the middle of edges, where w is the mean of the ends' velocities.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import absolute, add_product, load, select, sqrt
from seastar_gym.rods.star import Mesh, root_place

Floats = NDArray[np.float64]


def drag_per_length(density: float, coefficient: float, width: Floats) -> Floats:
    """1/2 rho_f C_d D of (13.8), per length and squared speed, of limbs of these widths D [kg/m^2]."""
    return 0.5 * density * coefficient * width


class Drag(NamedTuple):
    """Drag of limbs [kg/m].

    node: c of flow in any direction, per node; with a body, per place, see star.py.
    across: c_n of flow across an edge; two rows per node, for half of its inner and of its outer edge, zero for hub and
        tips, which have none. None for isotropic drag.
    middle, middle_across: c and c_n in the middle of edges over 8, see middle_slopes, per edge; None unless by
        Simpson's rule.
    """

    node: Floats
    across: Floats | None
    middle: Floats | None
    middle_across: Floats | None


def coefficients(mesh: Mesh, density: float, C_d: float, C_t: float | None, simpson: bool) -> Drag:
    """Drag in a fluid of a density [kg/m^3]: at the nodes, or by Simpson's rule, a third there, the rest in the middle.

    c = 1/2 rho_f C D dl, C = C_t along limbs; c_n = 1/2 rho_f (C_d - C_t) D l/2.
    """
    C = C_d if C_t is None else C_t
    node = mesh.per_node(drag_per_length(density, C, mesh.at_nodes.width)) * mesh.dl
    across = None if C_t is None else across_half_edges(mesh, density, C_d, C_t)
    if not simpson:
        return Drag(node, None if across is None else mesh.per_half_edge(across), None, None)
    middle = drag_per_length(density, C, mesh.at_edges.width) * mesh.l * (2.0 / 3.0) / 8.0
    if across is None:
        return Drag(node / 3.0, None, middle, None)
    return Drag(node / 3.0, mesh.per_half_edge(across / 3.0), middle, across * (4.0 / 3.0) / 8.0)


def across_half_edges(mesh: Mesh, density: float, C_d: float, C_t: float) -> Floats:
    """c_n of every edge [kg/m]."""
    width = mesh.at_edges.width
    return (drag_per_length(density, C_d, width) - drag_per_length(density, C_t, width)) * 0.5 * mesh.l


@kernel
def drag_slopes(c, wx, wy):
    """(potential, c |w|, c/|w|): the force is -(c |w|) w, the Hessian in w is (c |w|) 1 + (c/|w|) w w^T."""
    squared = add_product(wx * wx, wy, wy)
    speed = sqrt(squared)
    c_speed = c * speed
    # w w^T/|w| tends to zero with w.
    c_over_speed = select(speed > 0.0, c / speed, 0.0)
    return c_speed * squared * (1.0 / 3.0), c_speed, c_over_speed


@kernel
def add_half_edge(c, normals, e, wx, wy, gamma, inverse_gamma, slopes):
    """Add the drag of flow across half of edge e to (energy, gradient, Hessian) in q, see potential.py."""
    energy, (fx, fy), (xx, xy, yy) = slopes
    nx, ny = load(normals, 2 * e), load(normals, 2 * e + 1)
    across = add_product(wx * nx, wy, ny)
    c_across = c * absolute(across)
    force = c_across * across
    slope = 2.0 * inverse_gamma * c_across
    sx, sy = slope * nx, slope * ny
    return (
        add_product(energy, gamma * (1.0 / 3.0), force * across),
        (add_product(fx, force, nx), add_product(fy, force, ny)),
        (add_product(xx, sx, nx), add_product(xy, sx, ny), add_product(yy, sy, ny)),
    )


@kernel
def add_cross_flow(rods, normals, node, wx, wy, gamma, inverse_gamma, slopes):
    """Add the drag of flow across a node's edges to its slopes; without such drag it is gone when compiled."""
    if rods.drag.across is None:
        return slopes
    if node == 0 or (rods.body is not None and node > rods.n_nodes):
        return add_hub_cross_flow(rods, normals, node, wx, wy, gamma, inverse_gamma, slopes)
    inner, outer = load(rods.drag.across, 2 * node), load(rods.drag.across, 2 * node + 1)
    slopes = add_half_edge(inner, normals, node - 1, wx, wy, gamma, inverse_gamma, slopes)
    return add_half_edge(outer, normals, node, wx, wy, gamma, inverse_gamma, slopes)


@kernel
def add_hub_cross_flow(rods, normals, node, wx, wy, gamma, inverse_gamma, slopes):
    """Add the drag of flow across half of all root edges at the hub, or across half of one at its root on a body."""
    edges = rods.edges_per_limb
    if rods.body is None:
        for e in range(0, rods.n_edges, edges):
            slopes = add_half_edge(load(rods.drag.across, 2 * e + 2), normals, e, wx, wy, gamma, inverse_gamma, slopes)
        return slopes
    if node == 0:
        return slopes
    e = (node - root_place(rods, 0)) * edges
    return add_half_edge(load(rods.drag.across, 2 * e + 2), normals, e, wx, wy, gamma, inverse_gamma, slopes)


@kernel
def middle_slopes(rods, work, stage, e, tail, head):
    """(potential, force on either end, Hessian block) of the drag in the middle of edge e.

    With s = w_tail + w_head, twice the velocity of the middle, the potential is gamma c |s|^3/3, c an eighth of the
    middle's own coefficient. So s has the slopes of a node's w, each end feels the force c |s| s, and the block
    c (|s| 1 + s s^T/|s|)/gamma stands at both ends and couples them. tail, head: Motions of the ends.
    """
    return middle_drag_slopes(
        rods, work.normals, e, tail.wx + head.wx, tail.wy + head.wy, stage.gamma, stage.inverse_gamma
    )


@kernel
def middle_drag_slopes(rods, normals, e, sx, sy, gamma, inverse_gamma):
    """(potential, force on either end, Hessian over gamma) of the drag in the middle of edge e, see middle_slopes."""
    potential, c_speed, c_over_speed = drag_slopes(load(rods.drag.middle, e), sx, sy)
    c_over_speed *= inverse_gamma
    hx, hy = c_over_speed * sx, c_over_speed * sy
    diagonal = c_speed * inverse_gamma
    slopes = (
        gamma * potential,
        (c_speed * sx, c_speed * sy),
        (add_product(diagonal, hx, sx), hx * sy, add_product(diagonal, hy, sy)),
    )
    if rods.drag.middle_across is None:
        return slopes
    return add_half_edge(load(rods.drag.middle_across, e), normals, e, sx, sy, gamma, inverse_gamma, slopes)


@kernel
def add_middle_drag(rods, work, stage, e, tail, head, energy, f, K):
    """Add the drag in the middle of edge e to an energy [J], and to the edge's gradient f and Hessian K.

    Returns the energy, the gradients in head and, turned round, in tail, the Hessian of either end, and, turned round,
    that between them.
    """
    if rods.drag.middle is None:
        return energy, f, f, K, K
    potential, g, h = middle_slopes(rods, work, stage, e, tail, head)
    return (
        energy + potential,
        (f[0] + g[0], f[1] + g[1]),
        (f[0] - g[0], f[1] - g[1]),
        (K[0] + h[0], K[1] + h[1], K[2] + h[2]),
        (K[0] - h[0], K[1] - h[1], K[2] - h[2]),
    )
