"""Large deflection of a clamped limb against the extensible elastica."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Numerics, Scene, Seastar, Water
from seastar_gym.simulator import Simulator
from studies.validation import exact
from studies.validation.page import Row, Section, order_row
from studies.validation.unactuated import CLAMP, MM, free_length, let_pass, pause

Floats = NDArray[np.float64]

ELASTICA_LOADS = {1.0: 0.15, 3.0: 0.6, 10.0: 1.2}
"""Loads P L^2 / EI, and for each the largest error of the tip in units of l^2 / L. It grows with the hinges' angles."""
ELASTICA_NODES = (10, 20, 40, 80)
"""Nodes per limb of the loaded limbs."""


def loaded_tip(robot: Seastar, load: float) -> Floats:
    """Tip (x, y) [m] of the clamped limb at rest under a tip load in +y [N], from the clamp at l/2.

    Implicit Euler with steps comparable to the limb's slowest period (0.6 s) damps it to rest. Held nodes are heavy,
    not fixed: minutes under this load would move them visibly.
    """
    tip = robot.nodes_per_limb - 1
    numerics = Numerics("implicit-euler", step=0.5, newton_tolerance=1e-12)
    scene = Scene(robot, Water(), pause(8.0), numerics, held_nodes=CLAMP, loads=((tip, 0.0, load),))
    simulator = Simulator(scene)
    let_pass(simulator)
    return simulator.positions[0, tip] - [0.5 * robot.edge_length, 0.0]


def tips(k: float, robot: Seastar) -> tuple[Floats, Floats]:
    """Exact and simulated tip (x, y) [m] of the clamped limb under the load k EI / L^2."""
    EI = exact.bending_stiffness(robot)
    load = k * EI / robot.limb_length**2
    elastica_tip = exact.elastica_tip(load, EI, free_length(robot), exact.stretching_stiffness(robot))
    return elastica_tip, loaded_tip(robot, load)


def elastica() -> Section:
    """Section on the large deflection of a clamped limb under a tip load."""
    robots = [Seastar(nodes_per_limb=n) for n in ELASTICA_NODES]
    rows = []
    for k, bound in ELASTICA_LOADS.items():
        results = [tips(k, robot) for robot in robots]
        for robot, (reference, ours) in zip(robots, results, strict=True):
            allowed = bound * MM * robot.edge_length**2 / robot.limb_length
            for name, axis in (("x", 0), ("y", 1)):
                what = f"tip {name}, P = {k:g} EI/L², N = {robot.nodes_per_limb}"
                rows.append(Row(what, MM * reference[axis], MM * ours[axis], "mm", allowed))
        errors = [np.hypot(*(ours - reference)) for reference, ours in results]
        rows.append(order_row(f"tip, P = {k:g} EI/L²", [robot.edge_length for robot in robots], errors, 0.1))
    return Section(
        "Clamped limb under a tip load",
        "Limb 1 is clamped by holding the hub and its root node, and carries a dead load P across its tip. Implicit "
        "Euler brings it to rest in water with 16 steps of 0.5 s. The root hinge bends from the middle of the held "
        "edge to the middle of the next. The clamp is therefore at l/2, where coordinates begin, and the free length "
        "is L - l/2. Reference: the extensible elastica of that length, by shooting.",
        rows,
    )
