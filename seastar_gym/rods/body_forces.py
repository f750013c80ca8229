"""Inertia, drag and weight of a body, and what the roots of its limbs pass on to it, see body.py.

Drag is that of flow onto strips of the outline: a strip with the normal n, at b, feels the flow
w_p = n . (w + omega x b) = n . w + m omega and has the dissipation potential c |w_p|^3/3, convex like that of a node. A
coefficient of turning alone is a strip with n = 0. Drag that is the same in all directions is node 0's, see drag.py. w
is the velocity relative to the fluid at the hub.

Fluid that moves along has the mass P = R P_0 R^T, which turns with the body. Its rate omega P' takes the force
-omega P' w and gives the torque w . P' w/2 (Munk's), P' = dP/dtheta: constants of a stage.
"""

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import absolute, add_product, load, load_number, select, splat, store, subtract_product
from seastar_gym.rods.body import (
    F_X,
    F_Y,
    G_X,
    G_Y,
    J_X,
    J_Y,
    OMEGA,
    TORQUE,
    V_X,
    V_Y,
    C,
    S,
    add_to_system,
    angle,
    turned,
)
from seastar_gym.rods.star import convex_part, relative, rotation

STRIP_ROWS = 4


@kernel
def body_added_mass(rods, work):
    """P (xx, xy, yy) [kg] where the stage's first guess has the body; zeros without."""
    added_mass = rods.body.added_mass
    if added_mass is None:
        return splat(0.0), splat(0.0), splat(0.0)
    c, s = load(work.body.frozen, C), load(work.body.frozen, S)
    xx, xy, yy = load(added_mass, 0), load(added_mass, 1), load(added_mass, 2)
    # R P_0, then times R^T.
    ax, ay = subtract_product(c * xx, s, xy), subtract_product(c * xy, s, yy)
    bx, by = add_product(s * xx, c, xy), add_product(s * xy, c, yy)
    return subtract_product(c * ax, s, ay), add_product(s * ax, c, ay), add_product(s * bx, c, by)


@kernel
def freeze_turning_mass(rods, work):
    """Force and torque of fluid whose mass turns with the body, from work.added_mass, in scenes with a body."""
    if rods.body is None or rods.body.added_mass is None:
        return
    xx, xy, yy = load(work.added_mass, 0), load(work.added_mass, 1), load(work.added_mass, 2)
    wx, wy = relative(work, 0, load(work.body.frozen, V_X), load(work.body.frozen, V_Y))
    # P' = [[-2 xy, xx - yy], [xx - yy, 2 xy]]
    px = subtract_product((xx - yy) * wy, 2.0 * xy, wx)
    py = add_product((xx - yy) * wx, 2.0 * xy, wy)
    omega = load(work.body.frozen, OMEGA)
    store(work.body.frozen, G_X, -omega * px)
    store(work.body.frozen, G_Y, -omega * py)
    store(work.body.frozen, TORQUE, 0.5 * add_product(px * wx, py, wy))


@kernel
def add_body(rods, work, stage, convex, motion, energy, gradient, hessian):
    """Add what a body has beyond the inertia and drag of node 0 to that node's slopes, and to the angle's system.

    motion: Motion of node 0.
    """
    if rods.body is None:
        return energy, gradient, hessian
    row = 2 * rods.n_nodes
    inverse = load(rods.body.inverse_scale, 0)
    omega = (load(work.q, row) - load(stage.q_hat, row)) * stage.inverse_gamma * inverse
    turn = omega - load(stage.v_hat, row) * inverse  # d_theta
    inertia = load(rods.body.inertia, 0)
    jx, jy = load(work.body.frozen, J_X), load(work.body.frozen, J_Y)
    fx = load(work.body.frozen, F_X) + load(work.body.frozen, G_X)
    fy = load(work.body.frozen, F_Y) + load(work.body.frozen, G_Y)
    torque = load(work.body.frozen, TORQUE)
    offset = add_product(jx * motion.dx, jy, motion.dy)
    work_of_forces = add_product(add_product(fx * motion.dx, fy, motion.dy), torque, turn)
    energy += subtract_product(add_product(0.5 * inertia * turn * turn, turn, offset), stage.gamma, work_of_forces)
    rate = stage.inverse_gamma * turn
    gx, gy = add_product(gradient[0], rate, jx) - fx, add_product(gradient[1], rate, jy) - fy
    squared = stage.inverse_gamma * stage.inverse_gamma
    residual = add_product(offset, inertia, turn) * stage.inverse_gamma - torque
    add_to_system(work, squared * jx, squared * jy, squared * inertia, residual)
    energy = add_weight(rods, work, stage, convex, energy)
    return add_strips(rods.body, work, stage, motion, omega, energy, (gx, gy), hessian)


@kernel
def strip_flow(body, work, strip, wx, wy, omega):
    """(w_p, n_x, n_y, m, c): flow onto a strip [m/s], its normal and arm where the body is frozen, its coefficient."""
    row = STRIP_ROWS * strip
    c, s = load(work.body.frozen, C), load(work.body.frozen, S)
    x, y, m = load(body.strips, row), load(body.strips, row + 1), load(body.strips, row + 2)
    nx, ny = subtract_product(c * x, s, y), add_product(s * x, c, y)
    return add_product(add_product(nx * wx, ny, wy), m, omega), nx, ny, m, load(body.strips, row + 3)


@kernel
def add_strips(body, work, stage, motion, omega, energy, gradient, hessian):
    """Add the drag of flow onto strips to slopes and system."""
    gx, gy = gradient
    xx, xy, yy = hessian
    potential = splat(0.0)
    for strip in range(body.n_strips):
        flow, nx, ny, m, c = strip_flow(body, work, strip, motion.wx, motion.wy, omega)
        c_flow = c * absolute(flow)
        force = c_flow * flow
        slope = 2.0 * stage.inverse_gamma * c_flow
        sx, sy = slope * nx, slope * ny
        potential = add_product(potential, force, flow)
        gx, gy = add_product(gx, force, nx), add_product(gy, force, ny)
        xx, xy, yy = add_product(xx, sx, nx), add_product(xy, sx, ny), add_product(yy, sy, ny)
        add_to_system(work, m * sx, m * sy, m * m * slope, m * force)
    return add_product(energy, stage.gamma * (1.0 / 3.0), potential), (gx, gy), (xx, xy, yy)


@kernel
def add_weight(rods, work, stage, convex, energy):
    """Add the potential of the weight's moment to the energy [J], and its slopes to the system; unchanged without."""
    weight = rods.body.weight
    if weight is None:
        return energy
    x, y = turned(load(work.body.turn, 0), load(work.body.turn, 1), weight, 1)
    g_x, g_y = load(weight, 0), load(weight, 1)
    fall = add_product(g_x * x, g_y, y)
    stiffness = convex_part(convex, fall)
    add_to_system(work, splat(0.0), splat(0.0), stiffness, subtract_product(g_x * y, g_y, x))
    return energy - (fall - fallen(rods, stage.q_hat))


@kernel
def fallen(rods, q):
    """Work that gravity has done on the weight's moment at q, from where it stands across gravity [J]."""
    c, s = rotation(angle(rods, q))
    x, y = turned(c, s, rods.body.weight, 1)
    return add_product(load(rods.body.weight, 0) * x, load(rods.body.weight, 1), y)


@kernel
def pass_to_hub(rods, work, limb, convex, D, r, pull):
    """Turn a root's block D and right-hand side r, of elimination so far, into the angle's part of the system.

    pull: Gradient of Phi in the root's place [N].
    """
    x, y = load(work.body.arm, 2 * limb), load(work.body.arm, 2 * limb + 1)
    kx, ky = subtract_product(D[1] * x, D[0], y), subtract_product(D[2] * x, D[1], y)
    curvature = convex_part(convex, -add_product(pull[0] * x, pull[1], y))
    stiffness = add_product(curvature, ky, x) - kx * y
    add_to_system(work, kx, ky, stiffness, subtract_product(r[1] * x, r[0], y))


@kernel
def mass_moment(rods, q):
    """R S (x, y), a body's moment of mass about the hub where it is turned as in q [kg m]."""
    c, s = rotation(angle(rods, q))
    return turned(c, s, rods.body.moment, 0)


@kernel
def add_turning_energy(rods, q, v, frame, energy):
    """Add what the turning of a body has of kinetic energy [J], as seen from a frame; unchanged without a body."""
    if rods.body is None:
        return energy
    omega = angle(rods, v)
    x, y = mass_moment(rods, q)
    vx, vy = load(v, 0) - frame[0], load(v, 1) - frame[1]
    offset = subtract_product(vy * x, vx, y)
    return energy + omega * add_product(offset, 0.5 * load(rods.body.inertia, 0), omega)


@kernel
def add_turning_momentum(rods, q, v, p):
    """Add the momentum that a body has because it turns about the hub [kg m/s]; unchanged without a body."""
    if rods.body is None:
        return p
    omega = angle(rods, v)
    x, y = mass_moment(rods, q)
    return subtract_product(p[0], omega, y), add_product(p[1], omega, x)


@kernel
def begin_turning(rods, work, scheme, k, q_0, v_0, h):
    """Put b_hat of stage k of a step from (q_0, v_0) into work.body.turning, in scenes with a body."""
    if rods.body is None:
        return
    zero = splat(0.0)
    x, y = add_turning_momentum(rods, q_0, v_0, (zero, zero))
    for other in range(k):
        weight = load_number(scheme.a, k * scheme.n_stages + other) * h
        x = add_product(x, weight, load(work.body.turning, 2 + 2 * other))
        y = add_product(y, weight, load(work.body.turning, 3 + 2 * other))
    store(work.body.turning, 0, x)
    store(work.body.turning, 1, y)


@kernel
def turning_rate(rods, work, scheme, k, stage):
    """B (x, y) of stage k [N], by the iterate."""
    row, inverse = 2 * rods.n_nodes, load(rods.body.inverse_scale, 0)
    theta, theta_hat = load(work.q, row) * inverse, load(stage.q_hat, row) * inverse
    omega, omega_hat = (theta - theta_hat) * stage.inverse_gamma, load(stage.v_hat, row) * inverse
    rate = stage.inverse_gamma
    if stage.ahead:
        share = load_number(scheme.a, k * scheme.n_stages + k)
        left = 1.0 / share - 1.0
        theta, omega = theta + left * (theta - theta_hat), omega + left * (omega - omega_hat)
        rate = share * rate
    c, s = rotation(theta)
    x, y = turned(c, s, rods.body.moment, 0)
    b_x, b_y = load(work.body.turning, 0), load(work.body.turning, 1)
    return rate * (-omega * y - b_x), rate * (omega * x - b_y)


@kernel
def add_turning_rate(rods, work, scheme, k, stage, force):
    """Replace what add_body takes for the rate of b by B, in a residual [N]."""
    row, inverse = 2 * rods.n_nodes, load(rods.body.inverse_scale, 0)
    omega = (load(work.q, row) - load(stage.q_hat, row)) * stage.inverse_gamma * inverse
    rate = (omega - load(stage.v_hat, row) * inverse) * stage.inverse_gamma
    x, y = turning_rate(rods, work, scheme, k, stage)
    x -= rate * load(work.body.frozen, J_X) - load(work.body.frozen, F_X)
    y -= rate * load(work.body.frozen, J_Y) - load(work.body.frozen, F_Y)
    return force[0] + x, force[1] + y


@kernel
def end_turning(rods, work, scheme, k, stage):
    """Keep B of stage k, in scenes with a body."""
    if rods.body is None:
        return
    x, y = turning_rate(rods, work, scheme, k, stage)
    store(work.body.turning, 2 + 2 * k, x)
    store(work.body.turning, 3 + 2 * k, y)


@kernel
def add_mass_moment(rods, q, moment):
    """Add the moment of mass about the hub [kg m]; unchanged without a body."""
    if rods.body is None:
        return moment
    x, y = mass_moment(rods, q)
    return moment[0] + x, moment[1] + y


@kernel
def add_spin(rods, q, velocity, omega, arm, p, spin):
    """Add a body's momentum and spin about a point, beyond those of node 0's mass: (p, spin); unchanged without a body.

    velocity: Of the hub [m/s]. omega: Angular velocity [rad/s]. arm: From the point to the hub [m].
    """
    if rods.body is None:
        return p, spin
    x, y = mass_moment(rods, q)
    px, py = -omega * y, omega * x
    own = load(rods.body.inertia, 0) * omega + (x * velocity[1] - y * velocity[0])
    return (p[0] + px, p[1] + py), spin + own + (arm[0] * py - arm[1] * px)


@kernel
def spin_rate(rods, v):
    """Angular velocity of a body [rad/s]; zero, and not used, without."""
    if rods.body is None:
        return splat(0.0)
    return angle(rods, v)


@kernel
def cut_spin(rods, v, omega, less, robots):
    """Add `less` (below zero) of a body's angular velocity about omega to it, for the robots in the mask."""
    if rods.body is None:
        return
    row = 2 * rods.n_nodes
    now = load(v, row)
    about = subtract_product(now, omega, load(rods.body.scale, 0))
    store(v, row, select(robots, add_product(now, less, about), now))


@kernel
def add_work_on_body(rods, work, q_0, q, v, h, frame, energy):
    """Add the work of gravity on a body's turning, and of fluid whose mass turns, in a step to (q, v) [J]."""
    if rods.body is None:
        return energy
    px = load(work.body.frozen, G_X) * (load(v, 0) - frame[0])
    power = add_product(px, load(work.body.frozen, G_Y), load(v, 1) - frame[1])
    power = add_product(power, load(work.body.frozen, TORQUE), angle(rods, v))
    energy = add_product(energy, h, power)
    if rods.body.weight is None:
        return energy
    return energy + (fallen(rods, q) - fallen(rods, q_0))


@kernel
def add_power_on_strips(rods, work, v, frame, power):
    """Add the power that drag on a body's strips takes from the fluid's motion [W]; unchanged without a body."""
    if rods.body is None:
        return power
    wx, wy = relative(work, 0, load(v, 0), load(v, 1))
    u_x, u_y = load(work.current, 0) - frame[0], load(work.current, 1) - frame[1]
    omega = angle(rods, v)
    for strip in range(rods.body.n_strips):
        flow, nx, ny, _, c = strip_flow(rods.body, work, strip, wx, wy, omega)
        force = c * absolute(flow) * flow
        power = subtract_product(power, force * nx, u_x)
        power = subtract_product(power, force * ny, u_y)
    return power
