"""Phase and group speed of bending waves against beam theory."""

import numpy as np

from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.scene.robot import Discretisation
from seastar_gym.simulator import Simulator
from studies.frame import Floats
from studies.verification import exact
from studies.verification.page import Row, Section, order_row
from studies.verification.unactuated import let_pass, pause

WAVE_NODES = (201, 401, 801)
"""Nodes per limb of the limbs that waves run along."""
STEP = 0.1e-3
"""Time step [s] of the implicit midpoint rule."""
SLOWER: dict[Discretisation, tuple[float, ...]] = {"continuum": (4.0, 9e-4, 3e-3), "chapter": (2.0, 0.1, 0.4)}
"""Order p of the errors in l, and bounds of those of phase and group speed in units of (k l)^p, relative."""
WAVE_LENGTH, WAVE_WIDTH, WAVE_START, WAVE_TIME = 0.08, 0.05, 0.35, 0.06
"""Wavelength, width and initial centre of the pulse [m], and simulated time [s]: no part of the pulse meets an end."""


def bending_pulse(robot: Seastar) -> tuple[Floats, Floats, Floats]:
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
    numerics = Numerics("implicit-midpoint", STEP, newton_tolerance=1e-13)
    simulator = Simulator(Scene(robot, None, pause(WAVE_TIME), numerics))
    state = simulator.get_state()
    state.positions[0, :n, 1], state.velocities[0, :n, 1] = before.T
    simulator.set_state(state)
    let_pass(simulator)
    after = np.stack([simulator.positions[0, :n, 1], simulator.velocities[0, :n, 1]], axis=1)
    return before, after, np.linspace(0.0, robot.limb_length, n, dtype=np.float64)


def pulse_frequency(robot: Seastar, k: float, before: Floats, after: Floats, x: Floats) -> float:
    """Angular frequency [rad/s] of the wavenumber k [1/m], from the phase that this component gained in WAVE_TIME.

    The known amount by which the implicit midpoint rule lowers it is corrected.
    """
    omega = k**2 * exact.beam_constant(robot)

    def outward(heights_and_speeds: Floats) -> complex:
        """Component that runs to the tip; one that runs back has the opposite velocity and cancels."""
        height, speed = np.exp(-1j * k * x) @ heights_and_speeds
        return complex(height + 1j * speed / omega)

    gained = -np.angle(outward(after) / outward(before))
    turns = np.round((omega * WAVE_TIME - gained) / (2.0 * np.pi))
    lowered = (gained + 2.0 * np.pi * turns) / WAVE_TIME
    return float(2.0 / STEP * np.tan(0.5 * STEP * lowered))


def bending_waves() -> Section:
    """Section on the phase and group speed of a pulse along a limb of 1 m."""
    k = 2.0 * np.pi / WAVE_LENGTH
    phase = k * exact.beam_constant(Seastar())
    rows = []
    for name, (order, *bounds) in SLOWER.items():
        robots = [Seastar(3, n, 1.0, discretisation=name) for n in WAVE_NODES]
        errors = []
        for robot in robots:
            pulse = bending_pulse(robot)
            omega, below, above = (pulse_frequency(robot, wavenumber, *pulse) for wavenumber in (k, k - 1.0, k + 1.0))
            nodes = f"{name}, {round(WAVE_LENGTH / robot.edge_length)} nodes a wave"
            speeds = (("phase", phase, omega / k), ("group", 2.0 * phase, 0.5 * (above - below)))
            for (kind, reference, ours), bound in zip(speeds, bounds, strict=True):
                allowed = bound * (k * robot.edge_length) ** order * reference
                shown = robot is robots[0] and kind == "phase" and name == "continuum"
                rows.append(Row(f"{kind} speed, {nodes}", reference, ours, "m/s", allowed, shown=shown))
            errors.append(omega / k - phase)
        lengths = [robot.edge_length for robot in robots]
        rows.append(order_row(f"phase speed, {name}", lengths, errors, 0.15, order))
    return Section(
        "Bending waves",
        "A pulse of waves of 80 mm runs along a limb of 1 m in vacuum (implicit midpoint, h = 0.1 ms); the known "
        "amount by which the midpoint rule slows it is corrected. Reference: omega = k² sqrt(EI / (rho_m A)).",
        rows,
    )
