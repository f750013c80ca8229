"""The guard of energy, the balance of momentum, and the rigid motion that both keep.

Energy: no retried or regularised step creates any, and none turns a hinge through its pole.

With U at the natural hub angles of the step's end, implicit Euler (13.9) over dq = q_1 - q_0 ends with the energy

    K_1 + U(q_1) = K_0 + U(q_0) - |v_1 - v_0|^2_M / 2 - h drag(v_1) v_1 - dq U'' dq / 2,

U'' taken somewhere on the way: what the robot would have had, had it stood still while its actuators moved, less what
inertia, drag and a convex U take. Where U is not convex along the step the last term may create energy, little
(compressed edges that turn) or much (a minimum of Phi beyond the pole of tan(phi/2), edges that collapse). In water at
moderate speeds, drag takes more than that. So the guard looks only at steps that were retried, regularised or
shortened, and at those with much energy to lose; in vacuum at those that may have created energy by what Newton's
method knows at their end.

Energies are measured in a frame that moves with the velocity c of the fluid at the hub, in vacuum with that of the
centre of mass. Seen from there, the kinetic energy is that of v - c, a current u does the work h drag (u - c), and a
dead load F does F (dq - h c). With the balance of momentum, P_1 - P_0 = h (drag + F), any c says the same: another one
changes the energy's growth by -c (P_1 - P_0) and the work by -c h (drag + F). But only implicit Euler has the drag of
the step's end throughout the step. With a c fixed in the laboratory, the other schemes would be held to one thing there
and to another where everything moves uniformly. In still water c is zero, and a uniform current changes nothing. It is
zero, too, where nodes are held in the laboratory.

A step that created energy is refused, or, where little is to be taken away, its velocities about the rigid motion with
the same momenta are cut down to the energy allowed: momentum and angular momentum, with those of added mass, stay, and
the cut is of the order of the scheme's own error.

Schemes of higher order take the energy in the middle of a step and promise no such balance. In a guarded step they are
held to the larger of the energies that the robot standing still has at the step's ends, and what moving the natural hub
angles, and natural curvature, alone can store. What limbs store that press each other, and may get back, counts at the
start of all steps, and at the end of implicit Euler's: where others look ahead (forces.py), limbs that part get nothing
back.

U is that of the stiffness that limbs have at the time, see along.py. So what actuators put in or take out by stiffening
a bent limb is in these balances as what they do by moving its natural state.

Where even the shortest step fails, edges collapse so violently that every way on creates energy. The robot then comes
to rest within itself: it keeps momentum and angular momentum, and loses what other motion it has. Without that,
implicit Euler minimises |dq|^2_M / (2 h^2) + U(q), the energy that its step ends with, and begins at the energy that
the robot has: no descent creates any. Where an edge has shrunk to a point, the minimum is the tip of a cone, which
Newton's method does not find: there a robot fails.

At phi = pi a hinge would store infinite energy, but a Newton step may jump over that pole, and the robot then stays
folded over itself. Such steps are refused, too, while they are not very short: an edge that collapses turns its hinges
over at no such cost.

Momentum: no internal force changes the linear one, whatever the rounding of a linear solution. Summed over all nodes,
internal forces and contact cancel, so a full Newton step balances the momentum exactly, however rough its other parts
are. Its rounding does not: elimination subtracts stiffnesses EA/l from each other until the inertia m/gamma^2 is left,
and loses as many digits as EA/l over m/gamma^2, times the edges of a limb squared, has. The move of the whole robot is
then off by that share of the last Newton step, which is as long as the tolerance lets it be.

So where that can be seen, at any step in vacuum and in a fluid at very long ones, the whole robot takes one Newton step
of its own after the others: from the residual summed over the nodes, and its slope. In vacuum it is exact.

A body whose centre of mass is not the hub has the momentum b = omega J_S because it turns, too (body.py). Stages take
its rate as d_theta J*_S - gamma omega*^2 A*_S from their first guess, which is off by the scheme's error. Here the rate
is B = (b - b_hat)/gamma, of the angle that the stage has found, with b_hat = b_0 + h sum_{j<i} a_ij B_j: b follows the
tableau as velocities do, and what nodes get is what b loses. The implicit midpoint rule, damped or not, ends with b of
the angle and velocity that it extrapolates to, so that its B is the difference of b over the whole step.

Rigid motion: the one that has a robot's momentum and angular momentum; velocities are cut down about it.
"""

from seastar_gym.lanes.compile import kernel, rare_kernel
from seastar_gym.lanes.registers import (
    absolute,
    add_product,
    any_lane,
    load,
    select,
    splat,
    sqrt,
    store,
    subtract_product,
)
from seastar_gym.rods.body import move_roots, place_roots, root_motion, tail_motion
from seastar_gym.rods.body_forces import (
    add_body,
    add_mass_moment,
    add_spin,
    add_turning_energy,
    add_turning_momentum,
    add_turning_rate,
    begin_turning,
    cut_spin,
    end_turning,
    spin_rate,
)
from seastar_gym.rods.contact.forces import add_contact_energy
from seastar_gym.rods.potential import elastic_energy, node_slopes
from seastar_gym.rods.star import (
    edge_of,
    edge_vector,
    half_angle,
    hinge_edges,
    is_clamped,
    larger,
    node_motion,
    root_place,
    tail_node,
)
from seastar_gym.rods.terms.added_mass import add_fluid_energy, fluid_momentum, subtract_edge_fluid_energy
from seastar_gym.rods.terms.along import add_moved_energy, bending_stiffness
from seastar_gym.rods.terms.clamp import moved_clamp_energy
from seastar_gym.rods.terms.drag import middle_slopes
from seastar_gym.rods.terms.fluid import fluid_velocity
from seastar_gym.rods.terms.hub import set_natural_hub_angles
from seastar_gym.rods.terms.inertia import kinetic_energy
from seastar_gym.rods.terms.load import load_power

LOST = 1e8  # of stiffness over inertia: rounding is some 1e-10 of a Newton step there, corrected in a fluid, too


@kernel
def correct_momentum(rods, work, scheme, k, stage, q_0, v_0, h, robots):
    """Move the robots in the mask whose momentum may be unbalanced to where it is balanced, after stage k of a step.

    q_0, v_0: State at the beginning of the step, of length h [s].
    """
    unsettled = robots & (load(rods.scales.stiffness_ratio, 0) * stage.gamma * stage.gamma > LOST)
    if any_lane(unsettled):
        begin_turning(rods, work, scheme, k, q_0, v_0, h)
        move_as_a_whole(rods, work, scheme, k, stage, unsettled)
        end_turning(rods, work, scheme, k, stage)


@kernel
def move_as_a_whole(rods, work, scheme, k, stage, robots):
    """Newton step of stage k in which all nodes of a robot move alike.

    Contact, which cancels but for its rounding, is left out: its forces are those of where Newton's last step began,
    or, as long as others in the lanes go on, of where it has ended.
    """
    zero = splat(0.0)
    fx, fy, xx, xy, yy = zero, zero, zero, zero, zero
    for node in range(rods.n_nodes):
        _, gradient, hessian = node_slopes(rods, work, stage, node, node_motion(work, stage, node), (zero, zero))
        fx, fy = fx + gradient[0], fy + gradient[1]
        xx, xy, yy = xx + hessian[0], xy + hessian[1], yy + hessian[2]
    fx, fy, xx, xy, yy = add_roots(rods, work, scheme, k, stage, fx, fy, xx, xy, yy)
    fx, fy, xx, xy, yy = add_middles(rods, work, stage, fx, fy, xx, xy, yy)
    determinant = xx * yy - xy * xy
    dx, dy = (yy * fx - xy * fy) / determinant, (xx * fy - xy * fx) / determinant
    for node in range(rods.n_nodes):
        x, y = load(work.q, 2 * node), load(work.q, 2 * node + 1)
        store(work.q, 2 * node, select(robots, x - dx, x))
        store(work.q, 2 * node + 1, select(robots, y - dy, y))
    place_roots(rods, work.q)


@kernel
def add_roots(rods, work, scheme, k, stage, fx, fy, xx, xy, yy):
    """Add a body, and the fluid at its limbs' roots, to the residual and slope of a move of the whole robot."""
    if rods.body is None:
        return fx, fy, xx, xy, yy
    of_hub, zero = node_motion(work, stage, 0), splat(0.0)
    _, (fx, fy), (xx, xy, yy) = add_body(rods, work, stage, None, of_hub, zero, (fx, fy), (xx, xy, yy))
    fx, fy = add_turning_rate(rods, work, scheme, k, stage, (fx, fy))
    for limb in range(rods.n_limbs):
        motion = root_motion(rods, work, stage, limb)
        _, g, h = node_slopes(rods, work, stage, root_place(rods, limb), motion, (zero, zero))
        fx, fy, xx, xy, yy = fx + g[0], fy + g[1], xx + h[0], xy + h[1], yy + h[2]
    return fx, fy, xx, xy, yy


@kernel
def add_middles(rods, work, stage, fx, fy, xx, xy, yy):
    """Add the drag in the middle of edges to the residual and slope of a move of the whole robot."""
    if rods.drag.middle is None:
        return fx, fy, xx, xy, yy
    for e in range(rods.n_edges):
        tail, head = tail_motion(rods, work, stage, e), node_motion(work, stage, e + 1)
        _, g, h = middle_slopes(rods, work, stage, e, tail, head)
        fx, fy = fx + 2.0 * g[0], fy + 2.0 * g[1]
        xx, xy, yy = xx + 4.0 * h[0], xy + 4.0 * h[1], yy + 4.0 * h[2]
    return fx, fy, xx, xy, yy


@kernel
def subtract_edge_turn(rods, q, v, spin, turn):
    """(angular momentum, moment of inertia) less those of edges' differences; unchanged for lumped masses (None)."""
    if rods.inertia.edge is None:
        return spin, turn
    for e in range(rods.n_edges):
        tail, mu = tail_node(rods, e), load(rods.inertia.edge, e)
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
    if rods.added_mass is None or rods.added_mass.edge is None:
        return spin, turn
    for e in range(rods.n_edges):
        tail, mu = tail_node(rods, e), load(rods.added_mass.edge, e)
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
    m = load(rods.inertia.node, node)
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
        m = load(rods.inertia.node, node)
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


RIGID = 1.0 + 1e-6  # times the kinetic energy: a rigid motion with the same momenta has no more of it


@rare_kernel
def come_to_rest(rods, work, q, v, robots):
    """Leave the robots in the mask the rigid motion that has their momenta alone.

    Returns the mask of those that have one: not where all nodes lie in one point, nor where masses are so unlike that
    rounding alone drives it. These keep their velocities.
    """
    rows = 2 * rods.n_free
    frame = frame_velocity(rods, q, v)
    before = moving_energy(rods, work, q, v, frame)
    motion = rigid_motion(rods, work, q, v, frame)
    for row in range(rows):
        store(work.step, row, load(v, row))
    cut_velocities(rods, q, v, frame, motion, splat(0.0), robots)
    resting = robots & (moving_energy(rods, work, q, v, frame) <= RIGID * before)
    for row in range(rows):
        store(v, row, select(robots & ~resting, load(work.step, row), load(v, row)))
    move_roots(rods, q, v)
    return resting


ROUNDING = 1e-12  # of the kinetic energy, some 10,000 units in the last place: growth below it is rounding
UNITS = 1e-15  # positions are exact to this share of their size: some five to ten times half a unit in the last place
LARGEST_CUT = 0.01  # of the kinetic energy about the rigid motion, a choice; where more is too much, a step is refused


@kernel
def frame_velocity(rods, q, v):
    """(c_x, c_y): velocity of the frame that a step from (q, v) is judged in [m/s].

    That of the fluid at the hub; in vacuum that of the centre of mass; zero where nodes are held in the laboratory.
    """
    mass, v_x, v_y = splat(0.0), splat(0.0), splat(0.0)
    if rods.scales.held:
        return v_x, v_y
    for node in range(rods.n_nodes):
        m = load(rods.inertia.node, node)
        mass += m
        v_x, v_y = add_product(v_x, m, load(v, 2 * node)), add_product(v_y, m, load(v, 2 * node + 1))
    v_x, v_y = add_turning_momentum(rods, q, v, (v_x, v_y))
    dragged = load(rods.scales.damped, 0) > 0.0
    u_x, u_y = fluid_velocity(rods, load(q, 0), load(q, 1))
    return select(dragged, u_x, v_x / mass), select(dragged, u_y, v_y / mass)


@kernel
def moving_energy(rods, work, q, v, frame):
    """Kinetic energy of the robot, and of fluid that moves along at the normals of the last stage [J]."""
    energy = add_turning_energy(rods, q, v, frame, kinetic_energy(rods, v, frame))
    energy = add_fluid_energy(rods, work, v, frame, energy)
    return subtract_edge_fluid_energy(rods, work, v, energy)


@kernel
def add_work_of_loads(rods, work, q, h, frame, energy):
    """Add the work of dead loads in a step of length h from the state put aside to q [J], as seen from the frame."""
    if rods.load is None:
        return energy
    for node in range(rods.n_nodes):
        dx = subtract_product(load(q, 2 * node) - load(work.step, 2 * node), h, frame[0])
        dy = subtract_product(load(q, 2 * node + 1) - load(work.step, 2 * node + 1), h, frame[1])
        energy += load_power(rods, node, dx, dy)
    return energy


@kernel
def save(rods, work, scheme, q, v):
    """Copy the state into memory that a step's last stage leaves unused."""
    rows = 2 * rods.n_free
    unused = rows * (scheme.n_stages - 1)
    for row in range(rows):
        store(work.step, row, load(q, row))
        store(work.stage_v, unused + row, load(v, row))
    place_roots(rods, work.step)


@kernel
def restore(rods, work, scheme, q, v, robots):
    """Undo a step of the robots in the mask."""
    rows = 2 * rods.n_free
    unused = rows * (scheme.n_stages - 1)
    for row in range(rows):
        store(q, row, select(robots, load(work.step, row), load(q, row)))
        store(v, row, select(robots, load(work.stage_v, unused + row), load(v, row)))
    move_roots(rods, q, v)


@kernel
def moved_hub_energy(rods, work, actuation, start, end):
    """Energy of hub hinges at their natural angles, once those have moved from `start` to `end` of the interval [J]."""
    if rods.clamp is not None:
        moved = moved_clamp_energy(rods, work, actuation, start, end)
        return add_moved_energy(rods, work, actuation, start, end, moved)
    set_natural_hub_angles(rods, work, actuation, start)
    for limb in range(rods.n_limbs):
        store(work.hub.moment, limb, load(work.hub.EI_kappa_bar, limb))
    set_natural_hub_angles(rods, work, actuation, end)
    energy = splat(0.0)
    for limb in range(rods.n_limbs):
        moved = load(work.hub.EI_kappa_bar, limb) - load(work.hub.moment, limb)
        dl_over_EI = load(rods.bending.dl_over_EI, limb * rods.edges_per_limb)
        energy = add_product(energy, 0.5 * dl_over_EI * moved, moved)
    return energy


@kernel
def allowed_energy(rods, work, scheme, actuation, start, end, q, v, frame):
    """Largest energy that a step from (q, v) may end with [J], at the natural hub angles of its end, left in `work`.

    The work of currents and loads is added when the step is known.
    """
    allowed = splat(0.0)
    if not scheme.dissipative:
        set_natural_hub_angles(rods, work, actuation, start)
        allowed = elastic_energy(rods, work, q)
        moved = moved_hub_energy(rods, work, actuation, start, end)
        at_end = elastic_energy(rods, work, q)
        allowed = select(at_end > allowed, at_end, allowed) + moved
    else:
        set_natural_hub_angles(rods, work, actuation, end)
        allowed = elastic_energy(rods, work, q)
    return add_contact_energy(rods, work, q, allowed + moving_energy(rods, work, q, v, frame))


@kernel
def may_gain(rods, work, stage, phi, robots):
    """Mask of those among `robots` whose step of implicit Euler might create energy, as far as Newton's method knows.

    phi: Phi before Newton's last step [J], which is not less than at its end. There Phi is |v_1 - v_0|^2_M / 2 + U(q_1)
        and what dissipation adds, less h F (v_1 - v_0) of loads F, so the energy ends at most
        Phi + v_0 M (v_1 - v_0) - h F v_0 - U(q_0) above the one allowed.

    It is the whole of `robots` in scenes whose fluid gives energy or takes it up, or with a body.
    """
    if rods.current is not None or rods.added_mass is not None or rods.body is not None:
        return robots
    gain = phi - elastic_energy(rods, work, stage.q_hat)
    for node in range(rods.n_nodes):
        m = load(rods.inertia.node, node)
        for row in range(2 * node, 2 * node + 2):
            v_0 = load(stage.v_hat, row)
            change = (load(work.q, row) - load(stage.q_hat, row)) * stage.inverse_gamma - v_0
            gain = add_product(gain, m * v_0, change)
        power = load_power(rods, node, load(stage.v_hat, 2 * node), load(stage.v_hat, 2 * node + 1))
        gain = subtract_product(gain, stage.gamma, power)
    gain = subtract_edge_gain(rods, work, stage, gain)
    return robots & ~(gain <= 0.0)


@kernel
def subtract_edge_gain(rods, work, stage, gain):
    """Gain less v_0 mu (v_1 - v_0) of the differences along the edges [J]; unchanged for lumped masses (None)."""
    if rods.inertia.edge is None:
        return gain
    for e in range(rods.n_edges):
        tail, mu = tail_node(rods, e), load(rods.inertia.edge, e)
        of_tail, of_head = node_motion(work, stage, tail), node_motion(work, stage, e + 1)
        v_x, v_y = edge_vector(stage.v_hat, tail, e + 1)
        gain = subtract_product(gain, mu * v_x, of_head.dx - of_tail.dx)
        gain = subtract_product(gain, mu * v_y, of_head.dy - of_tail.dy)
    return gain


@kernel
def through_poles(rods, work, q, robots):
    """Mask of those among `robots` with a hinge that turned through its pole since the state put aside.

    Edges a and b that turned by alpha and beta (less than pi) take a hinge from phi to phi + beta - alpha. That is
    beyond the pole where cos((phi + beta - alpha)/2) < 0; written in half-angle tangents, without their cosines.
    """
    through = robots & ~robots
    for e in range(rods.n_edges):
        if is_clamped(rods, e):
            continue
        a, b, side = hinge_edges(rods, e)
        a_0, b_0 = edge_of(rods, work.step, a), edge_of(rods, work.step, b)
        t = half_angle(a_0, b_0, side)
        alpha, beta = half_angle(a_0, edge_of(rods, q, a), 1.0), half_angle(b_0, edge_of(rods, q, b), 1.0)
        through = through | (1.0 + alpha * beta + t * (alpha - beta) < 0.0)
    return robots & through


@kernel
def energy_noise(rods, work, q, h, potential, kinetic):
    """Change of an energy that rounding of positions may make [J]: slope sqrt(2 m K) and curvature m, times a move.

    Velocities are differences of positions over h; stretching and bending are as stiff as `stiffness` [N/m] at most.
    Held nodes have a huge mass and no velocity.
    """
    mass = load(rods.scales.free_mass, 0)
    edges = rods.n_edges
    length = load(rods.scales.shortest_edge, 0)
    stretching, bending = load(rods.stretching.EA_over_l, 0), bending_stiffness(rods, work, 0)
    for e in range(1, edges):
        stretching = larger(load(rods.stretching.EA_over_l, e), stretching)
        bending = larger(bending_stiffness(rods, work, e), bending)
    stiffness = edges * (stretching + 4.0 * bending / (length * length))
    limb = rods.edges_per_limb * length
    move = UNITS * (absolute(load(q, 0)) + absolute(load(q, 1)) + limb)
    speed = move / h
    of_positions = move * sqrt(2.0 * stiffness * absolute(potential))
    of_velocities = speed * sqrt(2.0 * mass * kinetic) + 0.5 * mass * speed * speed
    noise = of_velocities + of_positions + 0.5 * stiffness * move * move
    if rods.load is not None:
        for row in range(2 * rods.n_nodes):
            noise = add_product(noise, move, absolute(load(rods.load, row)))
    return noise


@kernel
def add_held_energy(rods, work, scheme, q, energy):
    """Add what limbs that press each other store at the end of a step, where the scheme gives it back."""
    if rods.contact is None or not scheme.dissipative:
        return energy
    return add_contact_energy(rods, work, q, energy)


@kernel
def hold_to_energy(rods, work, scheme, q, v, h, frame, robots, allowed, largest_cut):
    """Hold the robots in the mask to the energy allowed after a step of length h.

    largest_cut: Share of the kinetic energy about the rigid motion that may be cut.

    Returns (refused, cut): masks of the robots whose step has to be undone, and of those whose velocities were cut.
    """
    potential, kinetic = elastic_energy(rods, work, q), moving_energy(rods, work, q, v, frame)
    potential = add_held_energy(rods, work, scheme, q, potential)
    grown = robots & (potential + kinetic > add_product(allowed, ROUNDING, kinetic))
    cut = grown & ~grown
    if any_lane(grown):
        motion = rigid_motion(rods, work, q, v, frame)
        noise = energy_noise(rods, work, q, h, potential, kinetic)
        grown = grown & (potential + kinetic > allowed + noise)
        rigid = motion[5]
        about = kinetic - rigid
        left = allowed + noise - potential - rigid
        cut = grown & (left >= 0.0) & (left >= (1.0 - largest_cut) * about)
        if any_lane(cut):
            cut_velocities(rods, q, v, frame, motion, sqrt(left / about), cut)
    return grown & ~cut, cut
