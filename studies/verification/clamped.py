"""Clamped limbs against beam theory: large deflection against the extensible elastica, and natural frequencies."""

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from seastar_gym.model.rods import make_rods
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


FREQUENCY_NODES = (10, 20, 40)
"""Nodes per limb of the vibrating limbs."""
FREQUENCY_ORDERS = {"continuum": (3.0, 0.06), "chapter": (2.0, 0.3)}
"""Order p of the error in l, and its largest coefficient: |error| is below this times (beta l)^p, relative."""
RINGING_PERIODS, SAMPLES_PER_PERIOD, STEPS_PER_PERIOD = 12, 25, 400


def fitted_frequency(time: Floats, signal: Floats, guess: float) -> float:
    """Frequency [Hz], within 30 % of a guess, of the sinusoid that fits a signal best.

    time, signal: Times [s] and samples of the signal, shape (n_times,).
    """

    def misfit(frequency: float) -> float:
        phase = 2.0 * np.pi * frequency * time
        waves = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        rest: Floats = signal - waves @ np.linalg.lstsq(waves, signal)[0]
        return float(rest @ rest)

    # Local minima lie about 1 / duration apart: a grid finds the deepest one, then a bounded search its bottom.
    width = 0.25 / (time[-1] - time[0])
    coarse = np.arange(0.7 * guess, 1.3 * guess, width)
    valley = coarse[np.argmin([misfit(frequency) for frequency in coarse])]
    found = minimize_scalar(misfit, bounds=(valley - width, valley + width), method="bounded", options={"xatol": 1e-10})
    return float(found.x)


def ringing_frequency(robot: Seastar, mode: int) -> float:
    """Natural frequency [Hz] of the clamped limbs of a robot IN_LINE in vacuum, from their vibration; mode: 0, 1 or 2.

    Both are released from the shape of the beam's mode with a tip amplitude of 1e-4 L. The implicit midpoint rule
    lowers the frequency by a known amount, which is corrected: omega h / 2 = tan(omega_measured h / 2).
    """
    guess = exact.cantilever_frequencies(robot, robot.limb_length)[mode]
    h = 1.0 / (STEPS_PER_PERIOD * guess)
    numerics = Numerics("implicit-midpoint", h, newton_tolerance=1e-12)
    simulator = Simulator(Scene(robot, None, pause(RINGING_PERIODS / guess), numerics, held_nodes=HUB))
    own = np.arange(1, robot.nodes_per_limb)
    shape = exact.cantilever_shape(exact.CANTILEVER_ROOTS[mode], own / (robot.nodes_per_limb - 1))
    state = simulator.get_state()
    for limb in (own, own + robot.nodes_per_limb - 1):
        state.positions[0, limb, 1] += 1e-4 * robot.limb_length * shape
    simulator.set_state(state)
    projection = shape * make_rods(simulator.scene).mass[own]
    times, signal = [0.0], [state.positions[0, own, 1] @ projection]
    for time in simulator.stroke_in_parts(np.zeros((1, robot.n_limbs)), RINGING_PERIODS * SAMPLES_PER_PERIOD):
        times.append(time)
        signal.append(simulator.positions[0, own, 1] @ projection)
    measured = fitted_frequency(np.array(times), np.array(signal), guess)
    return float(np.tan(np.pi * measured * h) / (np.pi * h))


def natural_frequencies() -> Section:
    """Section on the free vibration of a clamped limb."""
    rows = []
    for mode in range(3):
        for name, in_line in IN_LINE.items():
            robots = [replace(in_line, nodes_per_limb=n) for n in FREQUENCY_NODES]
            (order, bound), errors = FREQUENCY_ORDERS[name], []
            for robot in robots:
                reference = exact.cantilever_frequencies(robot, robot.limb_length)[mode]
                ours = ringing_frequency(robot, mode)
                errors.append(ours / reference - 1.0)
                what = f"frequency {mode + 1}, {name}, N = {robot.nodes_per_limb}"
                allowed = bound * reference * (exact.CANTILEVER_ROOTS[mode] / (robot.nodes_per_limb - 1)) ** order
                rows.append(Row(what, reference, ours, "Hz", allowed, shown=robot is robots[0] and name == "continuum"))
            finest = [robot.edge_length for robot in robots[-2:]]
            rows.append(order_row(f"frequency {mode + 1}, {name}, N = 20 to 40", finest, errors[-2:], 0.15, order))
    return Section(
        "Natural frequencies of clamped limbs",
        "The same limbs are released in vacuum from a beam's mode. The implicit midpoint rule simulates twelve "
        "periods; the known amount by which it lowers the frequency is corrected. Reference: Euler-Bernoulli beam.",
        rows,
    )
