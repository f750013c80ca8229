"""The body: a rigid hub with a size, an orientation of its own, mass and rotational inertia.

Its unknowns are the hub's place x and its angle theta, which stands behind the nodes as the arc s theta, s a length of
the robot's size, so that it has the unit of a coordinate. The root of limb k is at X_k = x + A_k, A_k = R(theta) a_k,
a_k fixed in the body. The roots' places and velocities stand behind the angle, so that whatever asks for the ends of an
edge finds them there; `place_roots` keeps them at what x and theta say. With J_k = dA_k/dtheta = (-A_ky, A_kx), the
potential U has in theta

    slope J_k . g_k,    second slope J_k . H_k J_k - g_k . A_k,    g_k, H_k its gradient and Hessian in X_k.

The last term may be negative. A regularised matrix (see potential.py) has the positive part of it.

What depends on velocities is linear in them with coefficients of the stage's first guess (marked *), as normals are:
R* = R(theta*), omega* its angular velocity, both off by the square of the step. In a stage a root has the velocity
U = (X - X_hat)/gamma, whose X_hat is such that U* = v_x* + omega* J*, and the acceleration (U - U_hat)/gamma, whose
U_hat = v_hat + omega_hat J* + gamma omega*^2 A* makes it d(v_x)/dt + d(omega)/dt J* - omega*^2 A*.

Body and halves of the root edges that sit on it are one rigid mass: M, at node 0, its moment S = sum m a and its
inertia I = sum m |a|^2 about the hub, with d = v - v_hat as for nodes,

    I d_theta^2/2 + d_theta d_x . J*_S - gamma d_x . omega*^2 A*_S,    the part of Phi that M d_x^2/2 leaves out.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import N_LANES, add_product, load, splat, store, subtract_product
from seastar_gym.lanes.rows import aligned_rows
from seastar_gym.rods.star import Mesh, Motion, convex_part, node_motion, relative, root_place, rotation, tail_node

Floats = NDArray[np.float64]


class Body(NamedTuple):
    """Coefficients of a body, in its own frame.

    scale, inverse_scale: s [m] and 1/s.
    n_arms, arm: a_k, (x, y) per limb and, in scenes with contact, per corner of the outline [m]; how many there are.
    inertia: I, with the fluid that turns along [kg m^2]. moment: S, (x, y) [kg m].
    added_mass: Mass of fluid that moves along, xx, xy, yy [kg]; None without.
    n_strips, strips: Drag of flow onto strips of the outline, see forces.py: n_x, n_y [1], m [m], c [kg/m] each.
    weight: Acceleration of free fall (x, y) [m/s^2] and the moment of mass less that of the fluid displaced, (x, y)
        [kg m]; None without gravity.
    """

    scale: Floats
    inverse_scale: Floats
    n_arms: int
    arm: Floats
    inertia: Floats
    moment: Floats
    added_mass: Floats | None
    n_strips: int
    strips: Floats
    weight: Floats | None


class BodyWork(NamedTuple):
    """Memory of a body.

    turn: (cos, sin) of its angle, by the iterate. arm: A_k by the iterate, (x, y) per limb and corner [m].
    frozen: What a stage takes from its first guess, see FROZEN. hat: X_hat and U_hat, per limb [m], [m/s].
    turning: b_hat [kg m/s] of the stage, then B [N] of every stage, (x, y) each, see guard.py.
    system: Coupling of hub and angle, (x, y) [N]; stiffness of the angle [N m] and its residual [N m].
    """

    turn: np.ndarray
    arm: np.ndarray
    frozen: np.ndarray
    hat: np.ndarray
    turning: np.ndarray
    system: np.ndarray


FROZEN = 12
C, S, OMEGA, V_X, V_Y, J_X, J_Y, F_X, F_Y, G_X, G_Y, TORQUE = range(FROZEN)
"""Rows of `frozen`: cos, sin of theta*; omega* [rad/s]; the hub's velocity [m/s]; J*_S [kg m]; omega*^2 A*_S [N]; force
[N] and torque [N m] of the fluid that moves along, whose mass turns with the body.
"""
HAT = 4
SYSTEM = 4


def coefficients(
    mesh: Mesh,
    density: float,
    arms: Sequence[tuple[float, float]],
    mass: float,
    centre: tuple[float, float],
    inertia: float,
    scale: float,
    added_mass: Floats | None,
    strips: Floats,
    weight: Floats | None,
) -> Body:
    """Coefficients of a body with limbs of this density [kg/m^3] at `arms` [m].

    mass, centre, inertia: Of the body alone [kg], [m], and about its centre of mass, with the fluid's [kg m^2].
    weight: As in `Body`, of the body alone.
    """
    places, halves = np.array(arms), half_volumes(mesh, mesh.at_nodes.inert)
    own = mass * np.square(centre).sum() + inertia
    of_roots = density * halves @ np.square(places).sum(axis=1)
    return Body(
        scale=np.array([scale]),
        inverse_scale=np.array([1.0 / scale]),
        n_arms=len(places),
        arm=places.reshape(-1),
        inertia=np.array([own + of_roots]),
        moment=mass * np.array(centre) + density * halves @ places,
        added_mass=added_mass,
        n_strips=len(strips),
        strips=strips.reshape(-1),
        weight=weight,
    )


def half_volumes(mesh: Mesh, area: Floats) -> Floats:
    """Volume of the inner halves of root edges, per limb [m^3]; area: At the nodes of every limb [m^2]."""
    return area[:, 0] * 0.5 * mesh.root_edges


def with_corners(body: Body, corners: Floats) -> Body:
    """A body with the corners of its outline [m], shape (n, 2), for contact."""
    return body._replace(n_arms=body.n_arms + len(corners), arm=np.concatenate([body.arm, corners.reshape(-1)]))


def memory(body: Body | None, n_limbs: int, n_stages: int) -> BodyWork | None:
    """Zeroed memory for the body of one lane group, and a scheme of n_stages stages."""
    if body is None:
        return None
    counts = (2, 2 * body.n_arms, FROZEN, HAT * n_limbs, 2 + 2 * n_stages, SYSTEM)
    return BodyWork(*(aligned_rows(count, N_LANES) for count in counts))


@kernel
def angle(rods, q):
    """theta [rad], or its rate from rows of velocities."""
    return load(q, 2 * rods.n_nodes) * load(rods.body.inverse_scale, 0)


@kernel
def turned(c, s, rows, k):
    """The k-th (x, y) of rows, turned by (c, s)."""
    x, y = load(rows, 2 * k), load(rows, 2 * k + 1)
    return subtract_product(c * x, s, y), add_product(s * x, c, y)


@kernel
def place_roots(rods, q):
    """Put the roots of the limbs, and corners, where hub and angle say [m], in scenes with a body."""
    if rods.body is None:
        return
    c, s = rotation(angle(rods, q))
    for k in range(rods.body.n_arms):
        x, y = turned(c, s, rods.body.arm, k)
        place = root_place(rods, 0) + k
        store(q, 2 * place, load(q, 0) + x)
        store(q, 2 * place + 1, load(q, 1) + y)


@kernel
def move_roots(rods, q, v):
    """Put roots and corners where hub and angle say [m], with the velocities of there [m/s], in scenes with a body."""
    if rods.body is None:
        return
    c, s = rotation(angle(rods, q))
    omega = angle(rods, v)
    for k in range(rods.body.n_arms):
        x, y = turned(c, s, rods.body.arm, k)
        place = root_place(rods, 0) + k
        store(q, 2 * place, load(q, 0) + x)
        store(q, 2 * place + 1, load(q, 1) + y)
        store(v, 2 * place, subtract_product(load(v, 0), omega, y))
        store(v, 2 * place + 1, add_product(load(v, 1), omega, x))


@kernel
def tail_motion(rods, work, stage, e):
    """Motion of the node where edge e starts, see star.tail_node."""
    if rods.body is not None and e % rods.edges_per_limb == 0:
        return root_motion(rods, work, stage, e // rods.edges_per_limb)
    return node_motion(work, stage, tail_node(rods, e))


@kernel
def root_motion(rods, work, stage, limb):
    """Motion of a limb's root on a body."""
    place, row = root_place(rods, limb), HAT * limb
    vx = (load(work.q, 2 * place) - load(work.body.hat, row)) * stage.inverse_gamma
    vy = (load(work.q, 2 * place + 1) - load(work.body.hat, row + 1)) * stage.inverse_gamma
    wx, wy = relative(work, place, vx, vy)
    return Motion(vx - load(work.body.hat, row + 2), vy - load(work.body.hat, row + 3), wx, wy)


@kernel
def freeze_body(rods, work, stage, guess):
    """What a stage takes from its first guess, into work.body.frozen and hat, in scenes with a body.

    guess: Velocity of the hub [m/s] and angular velocity [rad/s]; the place is that of the iterate.
    """
    if rods.body is None:
        return
    vx, vy, omega = guess
    c, s = rotation(angle(rods, work.q))
    omega_hat = angle(rods, stage.v_hat)
    squared = omega * omega
    sx, sy = turned(c, s, rods.body.moment, 0)
    frozen = (c, s, omega, vx, vy, -sy, sx, squared * sx, squared * sy)
    for k in range(9):
        store(work.body.frozen, k, frozen[k])
    for limb in range(rods.n_limbs):
        x, y = turned(c, s, rods.body.arm, limb)
        row = HAT * limb
        store(work.body.hat, row, load(work.q, 0) + subtract_product(x, stage.gamma, subtract_product(vx, omega, y)))
        store(work.body.hat, row + 1, load(work.q, 1) + subtract_product(y, stage.gamma, add_product(vy, omega, x)))
        away = stage.gamma * squared
        hat_x = subtract_product(load(stage.v_hat, 0), omega_hat, y)
        hat_y = add_product(load(stage.v_hat, 1), omega_hat, x)
        store(work.body.hat, row + 2, add_product(hat_x, away, x))
        store(work.body.hat, row + 3, add_product(hat_y, away, y))


@kernel
def begin_body(rods, work):
    """Turn the arms as the iterate has them, and begin the part of the system that belongs to the angle."""
    if rods.body is None:
        return
    c, s = rotation(angle(rods, work.q))
    store(work.body.turn, 0, c)
    store(work.body.turn, 1, s)
    for k in range(rods.body.n_arms):
        x, y = turned(c, s, rods.body.arm, k)
        store(work.body.arm, 2 * k, x)
        store(work.body.arm, 2 * k + 1, y)
    for row in range(SYSTEM):
        store(work.body.system, row, 0.0)


@kernel
def add_to_system(work, x, y, stiffness, residual):
    """Add to the coupling of hub and angle, to the stiffness of the angle and to its residual."""
    store(work.body.system, 0, load(work.body.system, 0) + x)
    store(work.body.system, 1, load(work.body.system, 1) + y)
    store(work.body.system, 2, load(work.body.system, 2) + stiffness)
    store(work.body.system, 3, load(work.body.system, 3) + residual)


@kernel
def tail_solution(rods, work, limb, hub):
    """Solution of the node where a limb starts, from that of the hub (x, y) and that of the angle, if there is one."""
    if rods.body is None:
        return hub
    turn = load(work.system.root_solution, 2 * rods.n_limbs + 2)
    x, y = load(work.body.arm, 2 * limb), load(work.body.arm, 2 * limb + 1)
    return subtract_product(hub[0], turn, y), add_product(hub[1], turn, x)


@kernel
def carry_roots(rods, work, p):
    """Extend rows of a direction of the unknowns, the angle [rad], to roots and corners, which it carries along."""
    if rods.body is None:
        return
    turn = load(p, 2 * rods.n_nodes)
    for k in range(rods.body.n_arms):
        place = root_place(rods, 0) + k
        x, y = load(work.body.arm, 2 * k), load(work.body.arm, 2 * k + 1)
        store(p, 2 * place, subtract_product(load(p, 0), turn, y))
        store(p, 2 * place + 1, add_product(load(p, 1), turn, x))


@kernel
def gather_roots(rods, work, rows):
    """Move what rows have at roots and corners to the hub and, as a torque, to the angle: the transpose of carry."""
    if rods.body is None:
        return
    angle_row = 2 * rods.n_nodes
    for k in range(rods.body.n_arms):
        x, y = load(work.body.arm, 2 * k), load(work.body.arm, 2 * k + 1)
        row = 2 * (root_place(rods, 0) + k)
        f_x, f_y = load(rows, row), load(rows, row + 1)
        store(rows, 0, load(rows, 0) + f_x)
        store(rows, 1, load(rows, 1) + f_y)
        store(rows, angle_row, subtract_product(add_product(load(rows, angle_row), x, f_y), y, f_x))
        store(rows, row, 0.0)
        store(rows, row + 1, 0.0)


@kernel
def push_body_at_roots(rods, work, convex, force):
    """Move forces at roots and corners [N] to the hub, and their torque into the angle's part of the system."""
    if rods.body is None:
        return
    curvature = splat(0.0)
    for k in range(rods.body.n_arms):
        row = 2 * (root_place(rods, 0) + k)
        x, y = load(work.body.arm, 2 * k), load(work.body.arm, 2 * k + 1)
        curvature = add_product(add_product(curvature, load(force, row), x), load(force, row + 1), y)
    angle_row = 2 * rods.n_nodes
    store(force, angle_row, 0.0)
    gather_roots(rods, work, force)
    add_to_system(work, splat(0.0), splat(0.0), convex_part(convex, curvature), -load(force, angle_row))
