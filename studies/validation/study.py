"""The simulator beside what is known: `python -m studies.validation` writes `docs/validation.md`.

Exact solutions (the elastica, the vibrating beam, quadratic drag, bending waves) and two published codes' figures, each
computed by the `Simulator` that everything else uses.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from scipy.optimize import minimize_scalar
from tqdm import tqdm

from seastar_gym.gaits import straight_gait
from seastar_gym.model.rods import make_rods
from seastar_gym.scene import Numerics, Scene, Seastar, SmaPulse, Water
from seastar_gym.simulator import Simulator, SolverStatus, State
from studies.validation import exact
from studies.validation.page import Row, Section, as_page, as_table, order_row

Floats = NDArray[np.float64]

PUBLISHED_SWIM = Path(__file__).resolve().parents[2] / "tests" / "data" / "straight_turning_hub_10ms.csv"
MM = 1e3


def pause(duration: float) -> SmaPulse:
    """An actuator that does nothing: a stroke is a time to let pass [s]."""
    return SmaPulse(0.0, heating_time=0.5 * duration, cooling_time=0.5 * duration)


def let_pass(simulator: Simulator) -> None:
    """One stroke without a command."""
    report = simulator.stroke(np.zeros((simulator.n_robots, simulator.scene.robot.n_limbs)))
    if report.status.any():
        raise RuntimeError(SolverStatus.NOT_CONVERGED.sentence)


CLAMP = (0, 1)
"""Hub and root node of limb 1, held. The root hinge turns from the middle of the held edge to the middle of the next
one, so the limb is clamped at l/2."""


def free_length(robot: Seastar) -> float:
    """L - l/2 [m] of a limb that is held by CLAMP."""
    return robot.limb_length - 0.5 * robot.edge_length


# --- the elastica ----------------------------------------------------------------------------------------------------

ELASTICA_LOADS = {1.0: 0.15, 3.0: 0.6, 10.0: 1.2}
"""P L^2 / EI: the largest error of the tip, in l^2 / L; the hinges' own error grows with their turn."""
ELASTICA_NODES = (10, 20, 40, 80)


def loaded_tip(robot: Seastar, load: float) -> Floats:
    """Tip (x, y) [m] of the clamped limb at rest under a tip load in +y [N], from the clamp at l/2.

    Steps far longer than its slowest period (0.6 s) bring the limb to rest. Held nodes are heavy, not fixed: minutes of
    this load would move them visibly.
    """
    tip = robot.nodes_per_limb - 1
    numerics = Numerics("implicit-euler", step=0.5, newton_tolerance=1e-12)
    scene = Scene(robot, Water(), pause(8.0), numerics, held_nodes=CLAMP, loads=((tip, 0.0, load),))
    simulator = Simulator(scene)
    let_pass(simulator)
    return simulator.positions[0, tip] - [0.5 * robot.edge_length, 0.0]


def tips(k: float, robot: Seastar) -> tuple[Floats, Floats]:
    """(exact, ours): tip (x, y) [m] under the load k EI / L^2."""
    EI = exact.bending_stiffness(robot)
    load = k * EI / robot.limb_length**2
    elastica_tip = exact.elastica_tip(load, EI, free_length(robot), exact.stretching_stiffness(robot))
    return elastica_tip, loaded_tip(robot, load)


def elastica() -> Section:
    """Large deflection of a clamped limb."""
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
        "Limb 1 is clamped by holding the hub and its root node, and carries a dead load P across its tip; implicit "
        "Euler in water with 16 steps of 0.5 s comes to rest. The root hinge turns from the middle of the held edge to "
        "the middle of the next, so the clamp is at l/2 and the free length is L - l/2; coordinates count from there. "
        "Reference: the extensible elastica of that length, by shooting.",
        rows,
    )


# --- natural frequencies ---------------------------------------------------------------------------------------------

FREQUENCY_NODES = (10, 20, 40)
RINGING_PERIODS, SAMPLES_PER_PERIOD, STEPS_PER_PERIOD = 12, 25, 400


def fitted_frequency(time: Floats, signal: Floats, guess: float) -> float:
    """Frequency [Hz] within 30 % of a guess whose sine and cosine fit a signal best, shape (n_times,)."""

    def misfit(frequency: float) -> float:
        phase = 2.0 * np.pi * frequency * time
        waves = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        rest: Floats = signal - waves @ np.linalg.lstsq(waves, signal)[0]
        return float(rest @ rest)

    # Side valleys lie about one over the duration apart: find the deepest, then its bottom.
    width = 0.25 / (time[-1] - time[0])
    coarse = np.arange(0.7 * guess, 1.3 * guess, width)
    valley = coarse[np.argmin([misfit(frequency) for frequency in coarse])]
    found = minimize_scalar(misfit, bounds=(valley - width, valley + width), method="bounded", options={"xatol": 1e-10})
    return float(found.x)


def ringing_frequency(robot: Seastar, mode: int) -> float:
    """A natural frequency [Hz] of the clamped limb in vacuum, from its free vibration; mode: 0, 1, 2.

    Limb 1 is let go from the shape of the beam's mode, with a tip amplitude of 1e-4 L. The implicit midpoint rule
    slows an oscillation by a known amount, which is undone: omega h / 2 = tan(omega_measured h / 2).
    """
    guess = exact.cantilever_frequencies(robot, free_length(robot))[mode]
    h = 1.0 / (STEPS_PER_PERIOD * guess)
    numerics = Numerics("implicit-midpoint", h, newton_tolerance=1e-12)
    simulator = Simulator(Scene(robot, None, pause(RINGING_PERIODS / guess), numerics, held_nodes=CLAMP))
    own = np.arange(2, robot.nodes_per_limb)
    s = (own - 0.5) * robot.edge_length / free_length(robot)
    shape = exact.cantilever_shape(exact.CANTILEVER_ROOTS[mode], s)
    state = simulator.get_state()
    state.positions[0, own, 1] += 1e-4 * robot.limb_length * shape
    simulator.set_state(state)
    projection = shape * make_rods(simulator.scene).mass[own]
    times, signal = [0.0], [state.positions[0, own, 1] @ projection]
    for time in simulator.stroke_in_parts(np.zeros((1, robot.n_limbs)), RINGING_PERIODS * SAMPLES_PER_PERIOD):
        times.append(time)
        signal.append(simulator.positions[0, own, 1] @ projection)
    measured = fitted_frequency(np.array(times), np.array(signal), guess)
    return float(np.tan(np.pi * measured * h) / (np.pi * h))


def natural_frequencies() -> Section:
    """Free vibration of a clamped limb."""
    robots = [Seastar(nodes_per_limb=n) for n in FREQUENCY_NODES]
    rows = []
    for mode in range(3):
        errors = []
        for robot in robots:
            reference = exact.cantilever_frequencies(robot, free_length(robot))[mode]
            ours = ringing_frequency(robot, mode)
            errors.append(ours / reference - 1.0)
            what = f"frequency {mode + 1}, N = {robot.nodes_per_limb}"
            allowed = 0.1 * reference * (exact.CANTILEVER_ROOTS[mode] / (robot.nodes_per_limb - 1)) ** 2
            rows.append(Row(what, reference, ours, "Hz", allowed))
        lengths = [robot.edge_length for robot in robots]
        rows.append(order_row(f"frequency {mode + 1}", lengths, errors, 0.15))
    return Section(
        "Natural frequencies of a clamped limb",
        "The clamped limb is let go from the shape of a beam's mode with a tip amplitude of 1e-4 L, in vacuum, and "
        "followed over twelve periods by the implicit midpoint rule, whose known slowing of an oscillation is undone. "
        "Reference: Euler-Bernoulli, length L - l/2.",
        rows,
    )


# --- quadratic drag --------------------------------------------------------------------------------------------------

DRAG_NUMERICS = Numerics("sdirk3", 2e-3, newton_tolerance=1e-12)


def driven_speed(acceleration: float, time: float) -> float:
    """Speed [m/s] after a time [s] from rest, under loads of a node's mass times an acceleration [m/s^2]."""
    mass = make_rods(Scene()).mass
    loads = tuple((node, acceleration * m, 0.0) for node, m in enumerate(mass))
    simulator = Simulator(Scene(Seastar(), Water(), pause(time), DRAG_NUMERICS, loads=loads))
    let_pass(simulator)
    return float(simulator.hub_velocity()[0, 0])


def coasted(speed: float, time: float) -> Floats:
    """(speed [m/s], way [m]) of a straight robot that coasts for a time [s] from a speed [m/s]."""
    simulator = Simulator(Scene(Seastar(), Water(), pause(time), DRAG_NUMERICS))
    velocities = np.tile([speed, 0.0], (1, Seastar().n_nodes, 1))
    simulator.set_state(State(simulator.positions, velocities, simulator.time))
    let_pass(simulator)
    return np.array([simulator.hub_velocity()[0, 0], simulator.hub_position()[0, 0]])


def quadratic_drag() -> Section:
    """Terminal speed and decay of a robot that translates without bending."""
    k = exact.drag_over_mass(Seastar(), Water())
    rows = []
    for time, name in ((0.05, "speed after 0.05 s"), (0.2, "speed after 0.2 s"), (5.0, "terminal speed, after 5 s")):
        reference, ours = MM * exact.falling_speed(k, 1.0, time), MM * driven_speed(1.0, time)
        rows.append(Row(f"{name}, a = 1 m/s²", reference, ours, "mm/s", 1e-6 * reference))
    for time in (0.1, 1.0, 10.0):
        pairs = zip(MM * exact.coasting(k, 0.1, time), MM * coasted(0.1, time), strict=True)
        for (name, unit), (reference, ours) in zip((("speed", "mm/s"), ("way", "mm")), pairs, strict=True):
            rows.append(Row(f"{name} after coasting {time:g} s", reference, ours, unit, 5e-6 * reference))
    return Section(
        "Quadratic drag",
        "Drag and mass of a node are both proportional to its Voronoi length, so a straight robot translates without "
        "bending and dv/dt = a - k v² with k = rho_f C_d / (pi r_0 rho_m) = 199/m. It is driven from rest by loads of "
        "a times each node's mass, or coasts from v_0 = 0.1 m/s (SDIRK3, h = 2 ms). Reference: v = sqrt(a/k) "
        "tanh(sqrt(a k) t); v = v_0 / (1 + k v_0 t), x = log(1 + k v_0 t) / k.",
        rows,
    )


# --- bending waves ---------------------------------------------------------------------------------------------------

WAVE_NODES = (201, 401, 801)
WAVE_LENGTH, WAVE_WIDTH, WAVE_START, WAVE_TIME = 0.08, 0.05, 0.35, 0.06
"""Wavelength, width and first place [m] of the pulse, and how long it is followed [s]: no part of it meets an end."""


def bending_pulse(robot: Seastar, step: float = 0.1e-3) -> tuple[Floats, Floats, Floats]:
    """A pulse runs along limb 1 for WAVE_TIME: (before, after, x).

    before, after: Displacements across the limb [m] and their velocities [m/s], shape (N, 2). x: Of the nodes [m].
    The pulse is a Gaussian of WAVE_WIDTH over waves of WAVE_LENGTH, and begins with the velocity of the wave that
    runs to the tip: each of its wavenumbers turns at omega = k^2 sqrt(EI / (rho_m A)).
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
    """omega [rad/s] of the wavenumber k [1/m], from the phase that this part of a pulse gained in WAVE_TIME."""
    omega = k**2 * exact.beam_constant(robot)

    def outward(heights_and_speeds: Floats) -> complex:
        """What runs to the tip alone: a wave that runs back has the other velocity, and drops out."""
        height, speed = np.exp(-1j * k * x) @ heights_and_speeds
        return complex(height + 1j * speed / omega)

    gained = -np.angle(outward(after) / outward(before))
    turns = np.round((omega * WAVE_TIME - gained) / (2.0 * np.pi))
    return float((gained + 2.0 * np.pi * turns) / WAVE_TIME)


def bending_waves() -> Section:
    """A pulse that runs along a limb of 1 m."""
    k = 2.0 * np.pi / WAVE_LENGTH
    robots = [Seastar(n_limbs=3, nodes_per_limb=n, limb_length=1.0) for n in WAVE_NODES]
    phase = k * exact.beam_constant(robots[0])
    rows, errors = [], []
    for robot in robots:
        pulse = bending_pulse(robot)
        omega, below, above = (pulse_frequency(robot, wavenumber, *pulse) for wavenumber in (k, k - 1.0, k + 1.0))
        nodes = f"{round(WAVE_LENGTH / robot.edge_length)} nodes a wave"
        coarseness = (k * robot.edge_length) ** 2  # the discrete rod: 1/12 of it for the phase, 1/6 for the group
        rows.append(Row(f"phase speed, {nodes}", phase, omega / k, "m/s", 0.1 * coarseness * phase))
        rows.append(Row(f"group speed, {nodes}", 2.0 * phase, 0.5 * (above - below), "m/s", 0.4 * coarseness * phase))
        errors.append(omega / k - phase)
    rows.append(order_row("phase speed", [robot.edge_length for robot in robots], errors, 0.1))
    return Section(
        "Bending waves",
        "A pulse of waves of 80 mm runs along a limb of 1 m in vacuum (implicit midpoint, h = 0.1 ms); its speeds come "
        "from the phases that its Fourier components gained. Reference: omega = k² sqrt(EI / (rho_m A)), phase speed "
        "omega / k, group speed twice that.",
        rows,
    )


# --- published codes -------------------------------------------------------------------------------------------------

PUBLISHED_FINALS = {10e-3: 36.2827089e-3, 1e-3: 38.2752941e-3}
"""h [s]: hub x [m] after ten strokes in both C++ codes with Newton converged tightly."""


def straight_swim(step: float, parts: int = 10) -> Floats:
    """Hub x [m] of ten strokes of {2+,5-} with a turning-angle hub, at `parts` equal times of each stroke [s].

    Implicit Euler with Newton converged tightly.
    """
    numerics = Numerics("implicit-euler", step, newton_tolerance=1e-12)
    simulator = Simulator(Scene(Seastar(hub_hinge="turning"), numerics=numerics))
    return np.array(
        [simulator.hub_position()[0, 0] for _ in range(10) for _ in simulator.stroke_in_parts(straight_gait(), parts)]
    )


def published_swim(file: Path = PUBLISHED_SWIM) -> tuple[Floats, Floats, Floats]:
    """Times [s] and hub x [m] of codes A and B, every 0.1 s of ten strokes, h = 10 ms, Newton to a residual of 1e-8."""
    if not file.exists():
        raise FileNotFoundError(f"{file} is missing: the published codes' figures are part of a checkout only.")
    time, x_a, x_b = np.genfromtxt(file, delimiter=",", names=True, skip_header=4, unpack=True)
    return time, x_a, x_b


def published_codes() -> Section:
    """The straight swim in codes of the chapter's authors' groups."""
    rows = []
    for step, final in PUBLISHED_FINALS.items():
        what = f"x after ten strokes, h = {MM * step:g} ms, codes A and B tight"
        rows.append(Row(what, MM * final, MM * straight_swim(step, 1)[-1], "mm", 2e-8 * MM * final, digits=9))
    time, *codes = published_swim()
    ours = straight_swim(10e-3)
    stopping_errors = [abs(x[-1] - PUBLISHED_FINALS[10e-3]) for x in codes]
    for name, x, stopping_error in zip("AB", codes, stopping_errors, strict=True):
        worst = int(np.argmax(np.abs(ours - x)))
        what = f"x at {time[worst]:.1f} s, the worst of 100 times, code {name}"
        rows.append(Row(what, MM * x[worst], MM * ours[worst], "mm", 2.0 * MM * stopping_error, digits=9))
    return Section(
        "Published codes",
        "The hub's x in the straight swim {2+,5-}, implicit Euler, hub hinges by their turning angle, the ramp taken "
        "at the end of each step. Code A is dismech-rods in its planar mode, code B DDG_Tutorial_Fast (2d_curve), both "
        "given this scene. First with Newton converged tightly in all codes; then every 0.1 s of A's and B's swims at "
        "h = 10 ms with Newton stopped at a force residual of 1e-8, which leaves them "
        f"{MM * max(stopping_errors):.1e} mm from their own tight figure. At h = 3 ms those codes step across the "
        "corners of the ramp and ours does not, so that figure is not comparable.",
        rows,
    )


# --- the study -------------------------------------------------------------------------------------------------------

SECTIONS: dict[str, Callable[[], Section]] = {
    "elastica": elastica,
    "frequencies": natural_frequencies,
    "drag": quadratic_drag,
    "waves": bending_waves,
    "published": published_codes,
}


def main() -> None:
    """Compute, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("docs/validation.md"), help="the page to write")
    options = parser.parse_args()
    sections = [section() for section in tqdm(SECTIONS.values(), unit="section")]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(as_page(sections), encoding="utf-8")
    console = Console()
    for section in sections:
        console.print(as_table(section))
    console.print(f"Written: {options.out}")
