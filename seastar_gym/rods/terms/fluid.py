"""The frozen part of a fluid: normals of edges and the current at the nodes, taken from the first guess of a stage.

The first guess is off by the square of the step, so schemes keep their order up to 2 (a uniform current is exact), and
the potential stays one that is minimised, with an exact Hessian.
"""

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import add_product, load, splat, sqrt, store, subtract_product
from seastar_gym.rods.body_forces import add_power_on_strips, freeze_turning_mass
from seastar_gym.rods.star import edge_vector, relative, tail_node
from seastar_gym.rods.terms.added_mass import freeze_added_mass
from seastar_gym.rods.terms.current import current_velocity
from seastar_gym.rods.terms.drag import add_cross_flow, drag_slopes, middle_drag_slopes
from seastar_gym.rods.terms.own import own_drag


@kernel
def freeze_fluid(rods, work):
    """Fill work.normals, work.added_mass and work.current at the iterate, in scenes that have them."""
    freeze_normals(rods, work, work.q)
    freeze_added_mass(rods, work)
    freeze_current(rods, work)
    freeze_turning_mass(rods, work)


@kernel
def freeze_normals(rods, work, q):
    """Fill work.normals with the unit normals of the edges at q, in scenes that have them."""
    if work.normals is None:
        return
    for e in range(rods.n_edges):
        ex, ey = edge_vector(q, tail_node(rods, e), e + 1)
        inverse = 1.0 / sqrt(add_product(ex * ex, ey, ey))
        store(work.normals, 2 * e, -ey * inverse)
        store(work.normals, 2 * e + 1, ex * inverse)


@kernel
def freeze_current(rods, work):
    """Fill work.current with the velocity of the fluid at the nodes [m/s], in scenes with a current."""
    if rods.current is None:
        return
    for node in range(rods.n_places):
        u_x, u_y = current_velocity(rods.current, load(work.q, 2 * node), load(work.q, 2 * node + 1))
        store(work.current, 2 * node, u_x)
        store(work.current, 2 * node + 1, u_y)


@kernel
def fluid_velocity(rods, x, y):
    """(u_x, u_y) [m/s] of the fluid, in motion or at rest, at (x, y) [m]."""
    if rods.current is None:
        return splat(0.0), splat(0.0)
    return current_velocity(rods.current, x, y)


@kernel
def add_work_of_current(rods, work, v, h, frame, energy):
    """Add what drag takes from the fluid's motion in a step that ends with velocities v [J].

    Its power, as seen from a frame that moves with the velocity c, is (drag on the robot at w = v - u) (u - c).
    """
    if rods.current is None:
        return energy
    power, zero = splat(0.0), splat(0.0)
    for node in range(rods.n_places):
        if rods.body is not None and node == rods.n_nodes:  # a body's angle
            continue
        wx, wy = relative(work, node, load(v, 2 * node), load(v, 2 * node + 1))
        c_speed = drag_slopes(load(rods.drag.node, node), wx, wy)[1]
        slopes = (zero, (c_speed * wx, c_speed * wy), (zero, zero, zero))
        fx, fy = add_cross_flow(rods, work.normals, node, wx, wy, 1.0, 1.0, slopes)[1]
        if rods.own is not None:
            fx, fy = own_drag(rods, node, wx, wy, fx, fy)
        power = subtract_product(power, fx, load(work.current, 2 * node) - frame[0])
        power = subtract_product(power, fy, load(work.current, 2 * node + 1) - frame[1])
    power = add_power_on_strips(rods, work, v, frame, power)
    power = add_power_in_middle(rods, work, v, frame, power)
    return add_product(energy, h, power)


@kernel
def add_power_in_middle(rods, work, v, frame, power):
    """Add the power that drag in the middle of edges takes from the fluid's motion [W]."""
    if rods.drag.middle is None:
        return power
    for e in range(rods.n_edges):
        a, b = tail_node(rods, e), e + 1
        ax, ay = relative(work, a, load(v, 2 * a), load(v, 2 * a + 1))
        bx, by = relative(work, b, load(v, 2 * b), load(v, 2 * b + 1))
        fx, fy = middle_drag_slopes(rods, work.normals, e, ax + bx, ay + by, 1.0, 1.0)[1]
        u_x = load(work.current, 2 * a) - frame[0] + (load(work.current, 2 * b) - frame[0])
        u_y = load(work.current, 2 * a + 1) - frame[1] + (load(work.current, 2 * b + 1) - frame[1])
        power = subtract_product(subtract_product(power, fx, u_x), fy, u_y)
    return power
