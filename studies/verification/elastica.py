"""Large deflection of a clamped limb against the extensible elastica."""

from dataclasses import replace

import numpy as np

from seastar_gym.scene import Numerics, Scene, Seastar, Water
from seastar_gym.simulator import Simulator
from studies.frame import Floats
from studies.style import MM
from studies.verification import exact
from studies.verification.page import Row, Section, order_row
from studies.verification.unactuated import HUB, IN_LINE, let_pass, pause

ELASTICA_LOADS = {
    1.0: {"continuum": 0.06, "chapter": 0.11},
    3.0: {"continuum": 0.42, "chapter": 0.14},
    10.0: {"continuum": 1.05, "chapter": 0.6},
}
"""Loads P L^2 / EI, and for each the largest errors of the tip in units of l^2 / L."""
SHOWN_LOAD = 3.0
"""Load P L^2 / EI of the page."""
ELASTICA_NODES = (10, 40, 80)
"""Nodes per limb of the loaded limbs."""


def loaded_tip(robot: Seastar, load: float) -> Floats:
    """Tip (x, y) [m] of limb 1 at rest, where each limb of a robot IN_LINE has a tip load in +y [N].

    Implicit Euler with steps comparable to the limb's slowest period (0.6 s) damps it to rest. Held nodes are heavy,
    not fixed: minutes under these loads would move them visibly.
    """
    tip, other = robot.nodes_per_limb - 1, robot.n_nodes - 1
    numerics = Numerics("implicit-euler", step=0.5, newton_tolerance=1e-12)
    scene = Scene(robot, Water(), pause(8.0), numerics, held_nodes=HUB, loads=((tip, 0.0, load), (other, 0.0, load)))
    simulator = Simulator(scene)
    let_pass(simulator)
    position: Floats = simulator.positions[0, tip]
    return position


def tips(k: float, robot: Seastar) -> tuple[Floats, Floats]:
    """Exact and simulated tip (x, y) [m] of the clamped limb under the load k EI / L^2."""
    EI = exact.bending_stiffness(robot)
    load = k * EI / robot.limb_length**2
    elastica_tip = exact.elastica_tip(load, EI, robot.limb_length, exact.stretching_stiffness(robot))
    return elastica_tip, loaded_tip(robot, load)


def elastica() -> Section:
    """Section on the large deflection of a clamped limb under a tip load."""
    rows = []
    for k, bounds in ELASTICA_LOADS.items():
        for name, in_line in IN_LINE.items():
            robots = [replace(in_line, nodes_per_limb=n) for n in ELASTICA_NODES]
            results = [tips(k, robot) for robot in robots]
            for robot, (reference, ours) in zip(robots, results, strict=True):
                allowed = bounds[name] * MM * robot.edge_length**2 / robot.limb_length
                for across, axis in (("x", 0), ("y", 1)):
                    what = f"tip {across}, P = {k:g} EI/L², {name}, N = {robot.nodes_per_limb}"
                    shown = k == SHOWN_LOAD and robot is robots[0] and name == "continuum"
                    rows.append(Row(what, MM * reference[axis], MM * ours[axis], "mm", allowed, shown=shown))
            errors = [np.hypot(*(ours - reference)) for reference, ours in results]
            finest = [robot.edge_length for robot in robots[-2:]]
            order = order_row(f"tip, P = {k:g} EI/L², {name}, N = 40 to 80", finest, errors[-2:], 0.1)
            rows.append(replace(order, shown=k == SHOWN_LOAD))
    return Section(
        "Clamped limbs under tip loads",
        "Two limbs in a line, whose hub is held, carry dead loads P across their tips. Implicit Euler brings them "
        "to rest with 16 steps of 0.5 s. Reference: the extensible elastica of length L, by shooting.",
        rows,
    )
