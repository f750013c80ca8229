"""Motion of a translating robot against exact solutions for quadratic drag."""

import numpy as np

from seastar_gym.model.rods import make_rods
from seastar_gym.scene import Numerics, Scene, Seastar, Water
from seastar_gym.scene.robot import Discretisation
from seastar_gym.simulator import Simulator, State
from studies.frame import Floats
from studies.style import MM
from studies.verification import exact
from studies.verification.page import Row, Section
from studies.verification.unactuated import let_pass, pause

DRAG_NUMERICS = Numerics("sdirk3", 2e-3, newton_tolerance=1e-12)


def driven_speed(acceleration: float, time: float) -> float:
    """Speed [m/s] after a time [s] from rest; each node carries a load of its mass times an acceleration [m/s^2]."""
    robot = Seastar(nodes_per_limb=10)
    mass = make_rods(Scene(robot)).mass
    loads = tuple((node, acceleration * m, 0.0) for node, m in enumerate(mass))
    simulator = Simulator(Scene(robot, Water(), pause(time), DRAG_NUMERICS, loads=loads))
    let_pass(simulator)
    return float(simulator.hub_velocity()[0, 0])


def coasted(speed: float, time: float, discretisation: Discretisation = "continuum") -> Floats:
    """(speed [m/s], distance [m]) of a straight robot that coasts for a time [s] from an initial speed [m/s]."""
    robot = Seastar(nodes_per_limb=10, discretisation=discretisation)
    simulator = Simulator(Scene(robot, Water(), pause(time), DRAG_NUMERICS))
    velocities = np.tile([speed, 0.0], (1, robot.n_nodes, 1))
    simulator.set_state(State(simulator.positions, velocities, simulator.time))
    let_pass(simulator)
    return np.array([simulator.hub_velocity()[0, 0], simulator.hub_position()[0, 0]])


def quadratic_drag() -> Section:
    """Section on the terminal speed and the decay of speed of a robot that translates without bending."""
    k = exact.drag_over_mass(Seastar(), Water())
    rows = []
    for time, name in ((0.05, "speed after 0.05 s"), (0.2, "speed after 0.2 s"), (5.0, "terminal speed, after 5 s")):
        reference, ours = MM * exact.falling_speed(k, 1.0, time), MM * driven_speed(1.0, time)
        rows.append(Row(f"{name}, a = 1 m/s²", reference, ours, "mm/s", 1e-6 * reference, shown=time == 5.0))
    for time in (0.1, 1.0, 10.0):
        pairs = zip(MM * exact.coasting(k, 0.1, time), MM * coasted(0.1, time), strict=True)
        for (name, unit), (reference, ours) in zip((("speed", "mm/s"), ("distance", "mm")), pairs, strict=True):
            what = f"{name} after coasting {time:g} s"
            rows.append(Row(what, reference, ours, unit, 5e-6 * reference, shown=time == 1.0))
    return Section(
        "Quadratic drag",
        "A straight robot does not bend when it translates: dv/dt = a - k v² with k = rho_f C_d / (pi r_0 rho_m) = "
        "199/m. It is driven from rest by a, or coasts from v_0 = 0.1 m/s (SDIRK3, h = 2 ms). Reference: v = "
        "sqrt(a/k) tanh(sqrt(a k) t); v = v_0 / (1 + k v_0 t), x = log(1 + k v_0 t) / k.",
        rows,
    )
