"""Phase and group speed of bending waves against beam theory."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.simulator import Simulator
from studies.validation import exact
from studies.validation.page import Row, Section, order_row
from studies.validation.unactuated import let_pass, pause

Floats = NDArray[np.float64]

WAVE_NODES = (201, 401, 801)
"""Nodes per limb of the limbs that waves run along."""
WAVE_LENGTH, WAVE_WIDTH, WAVE_START, WAVE_TIME = 0.08, 0.05, 0.35, 0.06
"""Wavelength, width and initial centre of the pulse [m], and simulated time [s]: no part of the pulse meets an end."""


def bending_pulse(robot: Seastar, step: float = 0.1e-3) -> tuple[Floats, Floats, Floats]:
    """Simulate a pulse along limb 1 for WAVE_TIME: (before, after, x).

    before, after: Displacements across the limb [m] and their velocities [m/s], shape (N, 2).
    x: Positions of the nodes along the limb [m], shape (N,).
    The pulse has waves of WAVE_LENGTH under a Gaussian of WAVE_WIDTH. Its initial velocity is that of the wave that
    runs to the tip: the phase of each wavenumber k turns at omega = k^2 sqrt(EI / (rho_m A)).
    """
    n, amplitude = robot.nodes_per_limb, 1e-6 * WAVE_LENGTH
    k = 2.0 * np.pi * np.fft.fftfreq(4 * n, robot.edge_length)
    from_start = robot.edge_length * np.arange(4 * n) - WAVE_START
    pulse = amplitude * np.exp(-0.5 * (from_start / WAVE_WIDTH) ** 2 + 2j * np.pi / WAVE_LENGTH * from_start)
    speed = np.fft.ifft(-1j * k**2 * exact.beam_constant(robot) * np.fft.fft(pulse))
    before = np.stack([pulse.real[:n], speed.real[:n]], axis=1)
    numerics = Numerics("implicit-midpoint", step, newton_tolerance=1e-13)
    simulator = Simulator(Scene(robot, None, pause(WAVE_TIME), numerics))
    state = simulator.get_state()
    state.positions[0, :n, 1], state.velocities[0, :n, 1] = before.T
    simulator.set_state(state)
    let_pass(simulator)
    after = np.stack([simulator.positions[0, :n, 1], simulator.velocities[0, :n, 1]], axis=1)
    return before, after, np.linspace(0.0, robot.limb_length, n, dtype=np.float64)


def pulse_frequency(robot: Seastar, k: float, before: Floats, after: Floats, x: Floats) -> float:
    """Angular frequency [rad/s] of the wavenumber k [1/m], from the phase that this component gained in WAVE_TIME."""
    omega = k**2 * exact.beam_constant(robot)

    def outward(heights_and_speeds: Floats) -> complex:
        """Component that runs to the tip; one that runs back has the opposite velocity and cancels."""
        height, speed = np.exp(-1j * k * x) @ heights_and_speeds
        return complex(height + 1j * speed / omega)

    gained = -np.angle(outward(after) / outward(before))
    turns = np.round((omega * WAVE_TIME - gained) / (2.0 * np.pi))
    return float((gained + 2.0 * np.pi * turns) / WAVE_TIME)


def bending_waves() -> Section:
    """Section on the phase and group speed of a pulse along a limb of 1 m."""
    k = 2.0 * np.pi / WAVE_LENGTH
    robots = [Seastar(n_limbs=3, nodes_per_limb=n, limb_length=1.0) for n in WAVE_NODES]
    phase = k * exact.beam_constant(robots[0])
    rows, errors = [], []
    for robot in robots:
        pulse = bending_pulse(robot)
        omega, below, above = (pulse_frequency(robot, wavenumber, *pulse) for wavenumber in (k, k - 1.0, k + 1.0))
        nodes = f"{round(WAVE_LENGTH / robot.edge_length)} nodes a wave"
        # The discrete rod is slower than the beam by 1/12 of this in phase speed and by 1/6 in group speed.
        coarseness = (k * robot.edge_length) ** 2
        rows.append(Row(f"phase speed, {nodes}", phase, omega / k, "m/s", 0.1 * coarseness * phase))
        rows.append(Row(f"group speed, {nodes}", 2.0 * phase, 0.5 * (above - below), "m/s", 0.4 * coarseness * phase))
        errors.append(omega / k - phase)
    rows.append(order_row("phase speed", [robot.edge_length for robot in robots], errors, 0.1))
    return Section(
        "Bending waves",
        "A pulse of waves of 80 mm runs along a limb of 1 m in vacuum (implicit midpoint, h = 0.1 ms). Its speeds are "
        "computed from the phases that its Fourier components gain. Reference: omega = k² sqrt(EI / (rho_m A)), phase "
        "speed omega / k, group speed 2 omega / k.",
        rows,
    )
