"""The rigid hub of the continuum: limbs clamped at given angles into a massless point that turns freely.

Limb j: root edge e_j, t_j = e_j/|e_j|, natural direction n_j (at rest, turned by its actuator), stiffness
K_j = EI_j/(w_0 l_j) with Gregory's weight w_0 (see continuum.py). The hub's orientation Phi makes its energy least:

    c_j = t_j . n_j,  s_j = n_j x t_j,  S = sum_j K_j (c_j, s_j),
    E = min over Phi of sum_j K_j (1 - cos(theta_j - natural_j - Phi)) = sum_j K_j - |S|.

With p = S/|S| = (cos Phi, sin Phi), C_j = K_j (c_j p_x + s_j p_y) and M_j = K_j (s_j p_x - c_j p_y):

    dE/dtheta_j = M_j,    sum_j M_j = 0,    E = sum_j M_j^2/(K_j + C_j) without cancellation.

For Newton's method Phi is a third unknown of the hub: C_j is the stiffness of root edge j, -C_j grad theta_j its
coupling with Phi, and sum_j C_j the stiffness of Phi, whose residual is zero. Only relative angles matter: no pole, no
trigonometry of the state, no coupling between limbs. C_j is replaced by max(C_j, 0) where the matrix is regularised.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seastar_gym.der.geometry import edge_vector, tangent
from seastar_gym.der.mesh import Mesh
from seastar_gym.der.star import load_root_edge
from seastar_gym.der.terms.bending import clamp_stiffnesses
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load, select, splat, sqrt, store, subtract_product


class Clamp(NamedTuple):
    """Natural directions (x, y) of the root edges at rest, two rows per limb, and their stiffness K, per limb [N m]."""

    direction: np.ndarray
    stiffness: np.ndarray


def coefficients(mesh: Mesh, directions: Sequence[float]) -> Clamp:
    """Clamps of limbs with these directions of their root edges at rest [rad]."""
    at_rest = np.stack([np.cos(directions), np.sin(directions)], axis=1).reshape(-1)
    return Clamp(at_rest, clamp_stiffnesses(mesh))


@kernel
def set_natural_directions(clamp, rods, work, actuation, fraction):
    """Fill work.hub_direction with n_j at `fraction` (lanes) of an interval, in scenes with a rigid hub."""
    if clamp is None:
        return
    for limb in range(rods.n_limbs):
        start, end = load(actuation.delta_psi_start, limb), load(actuation.delta_psi_end, limb)
        t = tangent(0.5 * add_product(start, fraction, end - start))
        scale = 1.0 / add_product(1.0, t, t)
        c, s = subtract_product(1.0, t, t) * scale, 2.0 * t * scale
        x, y = load(clamp.direction, 2 * limb), load(clamp.direction, 2 * limb + 1)
        store(work.hub_direction, 2 * limb, subtract_product(c * x, s, y))
        store(work.hub_direction, 2 * limb + 1, add_product(s * x, c, y))


@kernel
def turn_from_natural(work, limb, ex, ey, inverse_length):
    """(c, s) = (t . n, n x t) of a root edge e."""
    nx, ny = load(work.hub_direction, 2 * limb), load(work.hub_direction, 2 * limb + 1)
    return add_product(ex * nx, ey, ny) * inverse_length, subtract_product(nx * ey, ny, ex) * inverse_length


@kernel
def orientation(S_x, S_y):
    """(cos Phi, sin Phi) of the hub; (1, 0) where every orientation is as good."""
    size = sqrt(add_product(S_x * S_x, S_y, S_y))
    return select(size > 0.0, S_x / size, 1.0), select(size > 0.0, S_y / size, 0.0)


@kernel
def clamp_energy(clamp, rods, work, q):
    """E [J] at the natural directions in `work`."""
    edges = rods.nodes_per_limb - 1
    S_x, S_y, total = splat(0.0), splat(0.0), splat(0.0)
    for limb in range(rods.n_limbs):
        c, s, _ = root_turn(work, q, limb, edges)
        K = load(clamp.stiffness, limb)
        S_x, S_y = add_product(S_x, K, c), add_product(S_y, K, s)
    p_x, p_y = orientation(S_x, S_y)
    for limb in range(rods.n_limbs):
        c, s, _ = root_turn(work, q, limb, edges)
        total += turned_energy(load(clamp.stiffness, limb), c, s, p_x, p_y)
    return total


@kernel
def turned_energy(K, c, s, p_x, p_y):
    """K (1 - cos(turn)) [J] of a root edge that is turned by (c, s) from its natural direction on a hub turned by p."""
    along, across = add_product(c * p_x, s, p_y), subtract_product(s * p_x, c, p_y)
    # 1 - cos = sin^2/(1 + cos), but for turns beyond a quarter.
    return K * select(along > 0.0, across * across / (1.0 + along), 1.0 - along)


@kernel
def root_turn(work, q, limb, edges):
    """(c, s, 1/|e|) of the root edge of a limb at q."""
    ex, ey = edge_vector(q, 0, limb * edges + 1)
    inverse = 1.0 / sqrt(add_product(ex * ex, ey, ey))
    c, s = turn_from_natural(work, limb, ex, ey, inverse)
    return c, s, inverse


@kernel
def assemble_clamp(clamp, rods, work, convex):
    """Moments M_j and stiffnesses C_j of the root edges, into work.hub_moment and work.hub_stiffness.

    Returns E [J].
    """
    S_x, S_y = splat(0.0), splat(0.0)
    for limb in range(rods.n_limbs):
        edge = load_root_edge(work, limb)
        c, s = turn_from_natural(work, limb, edge.x, edge.y, edge.length * edge.inverse)
        K = load(clamp.stiffness, limb)
        S_x, S_y = add_product(S_x, K, c), add_product(S_y, K, s)
        store(work.hub_moment, limb, c)
        store(work.hub_stiffness, limb, s)
    p_x, p_y = orientation(S_x, S_y)
    energy = splat(0.0)
    for limb in range(rods.n_limbs):
        K = load(clamp.stiffness, limb)
        c, s = load(work.hub_moment, limb), load(work.hub_stiffness, limb)
        energy += turned_energy(K, c, s, p_x, p_y)
        C = K * add_product(c * p_x, s, p_y)
        store(work.hub_moment, limb, K * subtract_product(s * p_x, c, p_y))
        store(work.hub_stiffness, limb, select(convex, select(C > 0.0, C, 0.0), C))
    return energy


@kernel
def moved_clamp_energy(clamp, rods, work, actuation, start, end):
    """Energy of a robot at its natural directions, once those have moved from `start` to `end` of the interval [J]."""
    set_natural_directions(clamp, rods, work, actuation, start)
    for limb in range(rods.n_limbs):
        store(work.hub_moment, limb, load(work.hub_direction, 2 * limb))
        store(work.hub_stiffness, limb, load(work.hub_direction, 2 * limb + 1))
    set_natural_directions(clamp, rods, work, actuation, end)
    S_x, S_y, total = splat(0.0), splat(0.0), splat(0.0)
    for limb in range(rods.n_limbs):
        x, y = load(work.hub_moment, limb), load(work.hub_stiffness, limb)
        c, s = turn_from_natural(work, limb, x, y, splat(1.0))
        K = load(clamp.stiffness, limb)
        S_x, S_y = add_product(S_x, K, c), add_product(S_y, K, s)
    p_x, p_y = orientation(S_x, S_y)
    for limb in range(rods.n_limbs):
        x, y = load(work.hub_moment, limb), load(work.hub_stiffness, limb)
        c, s = turn_from_natural(work, limb, x, y, splat(1.0))
        total += turned_energy(load(clamp.stiffness, limb), c, s, p_x, p_y)
    return total
