"""The rigid motion that has a robot's momentum and angular momentum, and what its velocities are about it."""

from seastar_gym.der.body.body import move_roots
from seastar_gym.der.body.forces import add_mass_moment, add_spin, cut_spin, spin_rate
from seastar_gym.der.geometry import edge_vector
from seastar_gym.der.star import tail_node
from seastar_gym.der.terms.added_mass import fluid_momentum
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load, select, splat, store, subtract_product


@kernel
def subtract_edge_turn(rods, q, v, spin, turn):
    """(angular momentum, moment of inertia) less those of edges' differences; unchanged for lumped masses (None)."""
    if rods.edge_mass is None:
        return spin, turn
    for e in range(rods.n_edges):
        tail, mu = tail_node(rods, e), load(rods.edge_mass, e)
        rx, ry = edge_vector(q, tail, e + 1)
        vx, vy = edge_vector(v, tail, e + 1)
        spin = subtract_product(spin, mu, rx * vy - ry * vx)
        turn = subtract_product(turn, mu, rx * rx + ry * ry)
    return spin, turn


@kernel
def subtract_edge_fluid_turn(rods, work, q, v, spin, turn):
    """(angular momentum, moment of inertia) less those of edges' differences in the fluid that moves along.

    Unchanged without consistent added mass (None).
    """
    if rods.edge_added_mass is None:
        return spin, turn
    for e in range(rods.n_edges):
        tail, mu = tail_node(rods, e), load(rods.edge_added_mass, e)
        nx, ny = load(work.normals, 2 * e), load(work.normals, 2 * e + 1)
        rx, ry = edge_vector(q, tail, e + 1)
        vx, vy = edge_vector(v, tail, e + 1)
        arm = subtract_product(rx * ny, ry, nx)
        spin = subtract_product(spin, mu * arm, add_product(vx * nx, vy, ny))
        turn = subtract_product(turn, mu * arm, arm)
    return spin, turn


@kernel
def momentum_of(rods, work, node, vx, vy):
    """Momentum of a node at the velocity (vx, vy) [kg m/s], with that of the fluid it carries along."""
    m = load(rods.mass, node)
    if rods.added_mass is None:
        return m * vx, m * vy
    px, py = fluid_momentum(work, node, vx, vy)
    return m * vx + px, m * vy + py


@kernel
def rigid_motion(rods, work, q, v, frame):
    """(x, y, v_x, v_y, omega, energy): the motion of a rigid robot with the same momentum and angular momentum.

    x, y: Centre of mass [m]. v_x, v_y: Its velocity, as seen from the frame [m/s]. omega: Angular velocity [rad/s].
    energy: Its kinetic energy there. Momenta and energy are those of robot and fluid that moves along.
    """
    zero, one = splat(0.0), splat(1.0)
    mass, x, y = zero, zero, zero
    for node in range(rods.n_nodes):
        m = load(rods.mass, node)
        mass += m
        x, y = add_product(x, m, load(q, 2 * node)), add_product(y, m, load(q, 2 * node + 1))
    x, y = add_mass_moment(rods, q, (x, y))
    x, y = x / mass, y / mass
    p_x, p_y, spin = zero, zero, zero
    # What the motions along x, along y and about the centre of mass have in common: the inertia of a rigid robot.
    xx, xy, yy, x_turn, y_turn, turn = zero, zero, zero, zero, zero, zero
    for node in range(rods.n_places):
        r_x, r_y = load(q, 2 * node) - x, load(q, 2 * node + 1) - y
        p = momentum_of(rods, work, node, load(v, 2 * node) - frame[0], load(v, 2 * node + 1) - frame[1])
        along_x = momentum_of(rods, work, node, one, zero)
        along_y = momentum_of(rods, work, node, zero, one)
        about = momentum_of(rods, work, node, -r_y, r_x)
        p_x, p_y, spin = p_x + p[0], p_y + p[1], spin + (r_x * p[1] - r_y * p[0])
        xx, xy, yy = xx + along_x[0], xy + along_x[1], yy + along_y[1]
        x_turn, y_turn, turn = x_turn + about[0], y_turn + about[1], turn + (r_x * about[1] - r_y * about[0])
    hub = (load(q, 0) - x, load(q, 1) - y)
    v_hub, omega = (load(v, 0) - frame[0], load(v, 1) - frame[1]), spin_rate(rods, v)
    (p_x, p_y), spin = add_spin(rods, q, v_hub, omega, hub, (p_x, p_y), spin)
    (x_turn, y_turn), turn = add_spin(rods, q, (-hub[1], hub[0]), one, hub, (x_turn, y_turn), turn)
    spin, turn = subtract_edge_turn(rods, q, v, spin, turn)
    spin, turn = subtract_edge_fluid_turn(rods, work, q, v, spin, turn)
    # Elimination of x, then y.
    lower, turn_lower = xy / xx, x_turn / xx
    yy, y_turn, turn = yy - lower * xy, y_turn - lower * x_turn, turn - turn_lower * x_turn
    y_left, spin_left = p_y - lower * p_x, spin - turn_lower * p_x
    turn_lower = y_turn / yy
    omega = (spin_left - turn_lower * y_left) / (turn - turn_lower * y_turn)
    v_y = (y_left - y_turn * omega) / yy
    v_x = (p_x - xy * v_y - x_turn * omega) / xx
    return x, y, v_x, v_y, omega, 0.5 * (p_x * v_x + p_y * v_y + spin * omega)


@kernel
def cut_velocities(rods, q, v, frame, motion, share, robots):
    """Keep `share` of the velocities of the robots in the mask about a rigid motion that is seen from the frame."""
    x, y, v_x, v_y, omega, _ = motion
    less = share - 1.0
    for node in range(rods.n_nodes):
        vx, vy = load(v, 2 * node), load(v, 2 * node + 1)
        about_x = vx - frame[0] - (v_x - omega * (load(q, 2 * node + 1) - y))
        about_y = vy - frame[1] - (v_y + omega * (load(q, 2 * node) - x))
        store(v, 2 * node, select(robots, add_product(vx, less, about_x), vx))
        store(v, 2 * node + 1, select(robots, add_product(vy, less, about_y), vy))
    cut_spin(rods, v, omega, less, robots)
    move_roots(rods, q, v)
