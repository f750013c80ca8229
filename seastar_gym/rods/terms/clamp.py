"""The rigid hub of the continuum: limbs clamped at given angles into a massless point that turns freely.

Limb j: root edge e_j, t_j = e_j/|e_j|, natural direction n_j (at rest, turned by its actuator), stiffness
K_j = EI_j/(w_0 l_j) with Gregory's weight w_0 (see bending.py). The hub's orientation Phi makes its energy least:

    c_j = t_j . n_j,  s_j = n_j x t_j,  S = sum_j K_j (c_j, s_j),
    E = min over Phi of sum_j K_j (1 - cos(theta_j - natural_j - Phi)) = sum_j K_j - |S|.

With p = S/|S| = (cos Phi, sin Phi), C_j = K_j (c_j p_x + s_j p_y) and M_j = K_j (s_j p_x - c_j p_y):

    dE/dtheta_j = M_j,    sum_j M_j = 0,    E = sum_j M_j^2/(K_j + C_j) without cancellation.

For Newton's method Phi is a third unknown of the hub: C_j is the stiffness of root edge j, -C_j grad theta_j its
coupling with Phi, and sum_j C_j the stiffness of Phi, whose residual is zero. Only relative angles matter: no pole, no
trigonometry of the state, no coupling between limbs. C_j is replaced by max(C_j, 0) where the matrix is regularised.

Damping (see damping.py) is the same function once more: K_j tau/gamma for K_j, and for n_j the direction t_j that the
root edge had when the stage began. The hub turns by an angle of its own there, a fourth unknown: moments of both kinds
add up to zero each, so nothing has to be remembered of the hub.

On a body (body.py) Phi is the body's angle, and what turns root edges turns the body back: the residual of Phi is
-sum_j M_j. Damping is about the directions that root edges had on the body, and has no angle of its own.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import N_LANES, add_product, load, select, splat, sqrt, store, subtract_product
from seastar_gym.lanes.rows import aligned_rows
from seastar_gym.rods.body import add_to_system, angle
from seastar_gym.rods.star import Mesh, convex_part, load_root_edge, root_direction, rotation, tangent
from seastar_gym.rods.terms.along import bending_stiffness, stiffening_rate, turned, turned_at_hub


class Clamp(NamedTuple):
    """Natural directions (x, y) of the root edges at rest, two rows per limb; bending.py has their stiffnesses K."""

    direction: np.ndarray


class ClampWork(NamedTuple):
    """Memory of clamps, (x, y) per limb.

    direction: Natural directions. turn: What root edges are turned from them. hat: Directions of root edges where a
    stage began; None without damping.
    """

    direction: np.ndarray
    turn: np.ndarray
    hat: np.ndarray | None


ELASTIC, VISCOUS = 0, 1
"""Columns of a limb in work.hub.coupling: C_j of elasticity and of damping."""
CLAMP_ROWS = 2


def coefficients(mesh: Mesh, directions: Sequence[float]) -> Clamp:
    """Clamps of limbs with these directions at the hub at rest [rad]; root edges of curved limbs turn by half a hinge's
    natural angle more.
    """
    angles = np.add(directions, 0.5 * np.array(mesh.natural_turn))
    return Clamp(np.stack([np.cos(angles), np.sin(angles)], axis=1).reshape(-1))


def memory(clamp: Clamp | None, is_damped: bool, n_limbs: int) -> ClampWork | None:
    """Zeroed memory for one lane group; None without clamps."""
    if clamp is None:
        return None
    direction, turn, hat = (aligned_rows(2 * n_limbs, N_LANES) for _ in range(3))
    return ClampWork(direction, turn, hat if is_damped else None)


@kernel
def clamp_stiffness(rods, work, limb):
    """K_j [N m]."""
    return bending_stiffness(rods, work, limb * rods.edges_per_limb)


@kernel
def set_natural_directions(rods, work, actuation, fraction):
    """Fill work.clamp.direction with n_j at `fraction` (lanes) of an interval."""
    for limb in range(rods.n_limbs):
        t = tangent(0.5 * turned_at_hub(rods, limb, turned(actuation, limb, fraction)))
        scale = 1.0 / add_product(1.0, t, t)
        c, s = subtract_product(1.0, t, t) * scale, 2.0 * t * scale
        x, y = load(rods.clamp.direction, 2 * limb), load(rods.clamp.direction, 2 * limb + 1)
        store(work.clamp.direction, 2 * limb, subtract_product(c * x, s, y))
        store(work.clamp.direction, 2 * limb + 1, add_product(s * x, c, y))


@kernel
def freeze_directions(rods, work, q_hat):
    """Fill work.clamp.hat with the directions of the root edges at q_hat, in scenes with a rigid hub and damping."""
    if rods.clamp is None:
        return
    for limb in range(rods.n_limbs):
        x, y = root_direction(rods, q_hat, limb)
        tx, ty = on_body(rods, q_hat, x, y)
        store(work.clamp.hat, 2 * limb, tx)
        store(work.clamp.hat, 2 * limb + 1, ty)


@kernel
def on_body(rods, q, x, y):
    """A direction as it is seen from a body, which keeps it when it turns; unchanged without one."""
    if rods.body is None:
        return x, y
    c, s = rotation(angle(rods, q))
    return add_product(c * x, s, y), subtract_product(c * y, s, x)


@kernel
def turn_from(directions, limb, tx, ty):
    """(c, s) = (t . n, n x t) of a root edge's direction t and that in rows, n."""
    nx, ny = load(directions, 2 * limb), load(directions, 2 * limb + 1)
    return add_product(tx * nx, ty, ny), subtract_product(nx * ty, ny, tx)


@kernel
def orientation(S_x, S_y):
    """(cos Phi, sin Phi) of the hub; (1, 0) where every orientation is as good."""
    size = sqrt(add_product(S_x * S_x, S_y, S_y))
    return select(size > 0.0, S_x / size, 1.0), select(size > 0.0, S_y / size, 0.0)


@kernel
def hub_orientation(rods, q, S_x, S_y):
    """(cos Phi, sin Phi) of the hub: that of a body at q, or the one that makes the energy least.

    q: None for a body that has not turned.
    """
    if rods.body is None:
        return orientation(S_x, S_y)
    if q is None:
        return splat(1.0), splat(0.0)
    return rotation(angle(rods, q))


@kernel
def turned_energy(K, c, s, p_x, p_y):
    """K (1 - cos(turn)) [J] of a root edge that is turned by (c, s) from its natural direction on a hub turned by p."""
    along, across = add_product(c * p_x, s, p_y), subtract_product(s * p_x, c, p_y)
    # 1 - cos = sin^2/(1 + cos), but for turns beyond a quarter.
    return K * select(along > 0.0, across * across / (1.0 + along), 1.0 - along)


@kernel
def sum_of_turns(rods, work):
    """S [N m] of root edges turned by (c, s) in work.clamp.turn."""
    S_x, S_y = splat(0.0), splat(0.0)
    for limb in range(rods.n_limbs):
        K = clamp_stiffness(rods, work, limb)
        c, s = load(work.clamp.turn, 2 * limb), load(work.clamp.turn, 2 * limb + 1)
        S_x, S_y = add_product(S_x, K, c), add_product(S_y, K, s)
    return S_x, S_y


@kernel
def energy_of_turns(rods, work, q):
    """E [J] of root edges turned by (c, s) in work.clamp.turn, two rows per limb, from their natural directions.

    q: Where a body's orientation is found, or None for a body that has not turned.
    """
    S_x, S_y = sum_of_turns(rods, work)
    p_x, p_y = hub_orientation(rods, q, S_x, S_y)
    total = splat(0.0)
    for limb in range(rods.n_limbs):
        c, s = load(work.clamp.turn, 2 * limb), load(work.clamp.turn, 2 * limb + 1)
        total += turned_energy(clamp_stiffness(rods, work, limb), c, s, p_x, p_y)
    return total


@kernel
def turn_clamps(rods, work, q):
    """Fill work.clamp.turn with what root edges at q are turned by from the natural directions in `work`."""
    for limb in range(rods.n_limbs):
        x, y = root_direction(rods, q, limb)
        c, s = turn_from(work.clamp.direction, limb, x, y)
        store(work.clamp.turn, 2 * limb, c)
        store(work.clamp.turn, 2 * limb + 1, s)


@kernel
def clamp_energy(rods, work, q):
    """E [J] at the natural directions in `work`."""
    turn_clamps(rods, work, q)
    return energy_of_turns(rods, work, q)


@kernel
def add_clamp_moments(rods, work, actuation, q, moments):
    """Add dE/d(delta) of the clamps [N m], of every limb's rotation delta, at the natural directions in `work`.

    With stiffness f K, f that of along.py, a clamp has -share M_j + E_j d(ln f)/d(delta), E_j its part of E.
    """
    turn_clamps(rods, work, q)
    S_x, S_y = sum_of_turns(rods, work)
    p_x, p_y = hub_orientation(rods, q, S_x, S_y)
    for limb in range(rods.n_limbs):
        K, c, s = (
            clamp_stiffness(rods, work, limb),
            load(work.clamp.turn, 2 * limb),
            load(work.clamp.turn, 2 * limb + 1),
        )
        moment = turned_at_hub(rods, limb, K * subtract_product(s * p_x, c, p_y))
        rate = stiffening_rate(rods, load(actuation.delta_psi_start, limb))
        stiffer = add_product(-moment, rate, turned_energy(K, c, s, p_x, p_y))
        store(moments, limb, load(moments, limb) + stiffer)


@kernel
def moved_clamp_energy(rods, work, actuation, start, end):
    """Energy of a robot at its natural directions, once those have moved from `start` to `end` of the interval [J]."""
    set_natural_directions(rods, work, actuation, start)
    for row in range(2 * rods.n_limbs):
        store(work.clamp.turn, row, load(work.clamp.direction, row))
    set_natural_directions(rods, work, actuation, end)
    for limb in range(rods.n_limbs):
        c, s = turn_from(
            work.clamp.direction, limb, load(work.clamp.turn, 2 * limb), load(work.clamp.turn, 2 * limb + 1)
        )
        store(work.clamp.turn, 2 * limb, c)
        store(work.clamp.turn, 2 * limb + 1, s)
    return energy_of_turns(rods, work, None)


@kernel
def assemble_clamps(rods, work, stage, convex):
    """Moments on root edges and their stiffnesses, into work.hub: moment, stiffness and coupling.

    Returns E [J], with that of damping.
    """
    energy = add_clamps(rods, work, work.clamp.direction, splat(1.0), convex, ELASTIC)
    if rods.damping is None:
        return energy
    ratio = load(rods.damping, 0) * stage.inverse_gamma
    return energy + add_clamps(rods, work, work.clamp.hat, ratio, convex, VISCOUS)


@kernel
def add_clamps(rods, work, directions, ratio, convex, column):
    """Add clamps of `ratio` times the stiffness, with these natural directions, in this column of work.hub.coupling.

    Returns their energy [J].
    """
    S_x, S_y = splat(0.0), splat(0.0)
    for limb in range(rods.n_limbs):
        edge, K = load_root_edge(work, limb), ratio * clamp_stiffness(rods, work, limb)
        inverse = edge.length * edge.inverse
        c, s = turn_from(directions, limb, edge.x * inverse, edge.y * inverse)
        S_x, S_y = add_product(S_x, K, c), add_product(S_y, K, s)
        store(work.clamp.turn, 2 * limb, c)
        store(work.clamp.turn, 2 * limb + 1, s)
    if rods.body is None:
        p_x, p_y = orientation(S_x, S_y)
    else:
        p_x, p_y = load(work.body.turn, 0), load(work.body.turn, 1)
    energy = splat(0.0)
    for limb in range(rods.n_limbs):
        K = ratio * clamp_stiffness(rods, work, limb)
        c, s = load(work.clamp.turn, 2 * limb), load(work.clamp.turn, 2 * limb + 1)
        energy += turned_energy(K, c, s, p_x, p_y)
        C = convex_part(convex, K * add_product(c * p_x, s, p_y))
        moment = K * subtract_product(s * p_x, c, p_y)
        store(work.hub.moment, limb, load(work.hub.moment, limb) + moment)
        store(work.hub.stiffness, limb, load(work.hub.stiffness, limb) + C)
        store(work.hub.coupling, CLAMP_ROWS * limb + column, C)
        if rods.body is not None:  # without one, moments cancel
            add_to_system(work, splat(0.0), splat(0.0), splat(0.0), -moment)
    return energy
