"""The simulator beside what is known: `python -m seastar_gym.studies.validation` writes `docs/validation.md`.

Exact solutions (the elastica, the vibrating beam, quadratic drag, bending waves) and two published codes' figures, each
computed by the `Simulator` that everything else uses.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar
from tqdm import tqdm

from seastar_gym.scene import Numerics, Scene, Seastar, SmaPulse, Water
from seastar_gym.simulator import Simulator, State

Floats = NDArray[np.float64]

CHECKOUT = Path(__file__).resolve().parents[2]
PUBLISHED_SWIM = CHECKOUT / "tests" / "data" / "straight_turning_hub_10ms.csv"
STRAIGHT = np.array([[0.0, 1.0, 0.0, 0.0, -1.0]])
MM = 1e3


@dataclass(frozen=True)
class Row:
    """One line of the page. allowed: The largest |ours - reference| that a test accepts, in the same unit."""

    quantity: str
    reference: float
    ours: float
    unit: str
    allowed: float

    @property
    def difference(self) -> float:
        """ours - reference, in the row's unit."""
        return self.ours - self.reference

    @property
    def holds(self) -> bool:
        """Whether the difference is allowed."""
        return abs(self.difference) <= self.allowed


@dataclass(frozen=True)
class Section:
    """Rows with one reference. method: What was computed and how, for the reader."""

    title: str
    method: str
    rows: list[Row]


def order_of_convergence(sizes: ArrayLike, errors: ArrayLike) -> float:
    """Slope of log error over log size."""
    slope: float = np.polyfit(np.log(np.asarray(sizes)), np.log(np.abs(np.asarray(errors))), 1)[0]
    return slope


def bending_stiffness(robot: Seastar) -> float:
    """EI [N m^2], with I = pi r_0^4 / 4."""
    return robot.youngs_modulus * np.pi * robot.rod_radius**4 / 4.0


def beam_constant(robot: Seastar) -> float:
    """sqrt(EI / (rho_m A)) [m^2/s]: a bending wave of wavenumber k has omega = k^2 times this."""
    return float(np.sqrt(robot.youngs_modulus * robot.rod_radius**2 / (4.0 * robot.density)))


def held_limb(robot: Seastar, **scene: object) -> Scene:
    """A scene whose limb 1 is clamped: hub and root node held, no actuation.

    The root hinge measures the turn from the middle of the held edge to the middle of the next one, so the clamp
    sits at the middle of the held edge: the free length is L - l/2.
    """
    return replace(Scene(robot, None, SmaPulse(0.0)), held_nodes=(0, 1), **scene)  # type: ignore[arg-type]


def free_length(robot: Seastar) -> float:
    """L - l/2 [m], see `held_limb`."""
    return robot.limb_length - 0.5 * robot.edge_length


# --- the elastica ----------------------------------------------------------------------------------------------------


def elastica_tip(load: float, EI: float, length: float, EA: float = np.inf) -> Floats:
    """Tip (x, y) [m] of a rod clamped along +x at the origin under a dead tip load in +y [N].

    EI theta'' = -(1 + epsilon) P cos(theta) with the strain epsilon = P sin(theta) / EA; EA infinite is the classical,
    inextensible elastica. Integrated from the tip, whose angle is found by bisection, to the clamp, where theta = 0.
    """
    k, strain = load * length**2 / EI, load / EA

    def slope(_: float, state: Floats) -> list[float]:
        theta, kappa = state[:2]
        stretch = 1.0 + strain * np.sin(theta)
        return [kappa, -k * stretch * np.cos(theta), stretch * np.cos(theta), stretch * np.sin(theta)]

    def from_tip(angle: float) -> Floats:
        end: Floats = solve_ivp(slope, (1.0, 0.0), [angle, 0, 0, 0], method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        return end

    tip_angle = brentq(lambda angle: from_tip(angle)[0], 0.0, 0.5 * np.pi, xtol=1e-14)
    return -length * from_tip(tip_angle)[2:]


def loaded_tip(robot: Seastar, load: float) -> Floats:
    """Tip (x, y) [m] of the clamped limb at rest under a tip load in +y [N], from the middle of the held edge."""
    scene = held_limb(
        robot,
        fluid=Water(),
        actuator=SmaPulse(0.0, heating_time=20.0, cooling_time=20.0),
        numerics=Numerics("implicit-euler", step=1.0, newton_tolerance=1e-12),
        loads=((robot.nodes_per_limb - 1, 0.0, load),),
    )
    simulator = Simulator(scene)
    report = simulator.stroke(np.zeros((1, robot.n_limbs)))
    assert not report.status.any()
    return simulator.positions[0, robot.nodes_per_limb - 1] - [0.5 * robot.edge_length, 0.0]


ELASTICA_LOADS = (1.0, 3.0, 10.0)
"""P L^2 / EI."""
ELASTICA_NODES = (10, 20, 40, 80)


def elastica_errors(k: float) -> list[tuple[Seastar, Floats, Floats]]:
    """(robot, exact tip, our tip) [m] for every N, under the load k EI / L^2."""
    rows = []
    for n in ELASTICA_NODES:
        robot = Seastar(nodes_per_limb=n)
        EI, EA = bending_stiffness(robot), robot.youngs_modulus * np.pi * robot.rod_radius**2
        load = k * EI / robot.limb_length**2
        rows.append((robot, elastica_tip(load, EI, free_length(robot), EA), loaded_tip(robot, load)))
    return rows


def elastica() -> Section:
    """Large deflection of a clamped limb."""
    rows = []
    for k in ELASTICA_LOADS:
        results = elastica_errors(k)
        for robot, exact, ours in (results[0], results[-1]):
            allowed = 1.2 * MM * robot.edge_length**2 / robot.limb_length * min(1.0, 0.1 + 0.1 * k)
            for name, axis in (("x", 0), ("y", 1)):
                what = f"tip {name}, P = {k:g} EI/L², N = {robot.nodes_per_limb}"
                rows.append(Row(what, MM * exact[axis], MM * ours[axis], "mm", allowed))
        errors = [np.hypot(*(ours - exact)) for _, exact, ours in results]
        lengths = [robot.edge_length for robot, _, _ in results]
        rows.append(Row(f"order in l, P = {k:g} EI/L²", 2.0, order_of_convergence(lengths, errors), "", 0.1))
    return Section(
        "Clamped limb under a tip load",
        "Limb 1 is clamped by holding the hub and its root node, and carries a dead load P across its tip; implicit "
        "Euler in water with steps of 1 s comes to rest. Reference: the extensible elastica (shooting, 12 digits). The "
        "root hinge turns from the middle of the held edge to the middle of the next, so the clamp is at l/2 and the "
        "free length is L - l/2; coordinates count from there.",
        rows,
    )


# --- natural frequencies ---------------------------------------------------------------------------------------------

CANTILEVER_ROOTS = np.array([1.8751040687119611, 4.6940911329741745, 7.8547574382376126])
"""beta_n L of a clamped-free beam: roots of cos(x) cosh(x) = -1."""


def cantilever_shape(root: float, s: ArrayLike) -> Floats:
    """Mode shape of a clamped-free beam at s in [0, 1] from clamp to tip, 1 at the tip; root: its beta L."""
    x, tip = root * np.asarray(s, float), root
    ratio = (np.cosh(tip) + np.cos(tip)) / (np.sinh(tip) + np.sin(tip))

    def shape(x: Floats | float) -> Floats:
        return np.asarray(np.cosh(x) - np.cos(x) - ratio * (np.sinh(x) - np.sin(x)))

    return shape(x) / shape(tip)


def cantilever_frequencies(robot: Seastar) -> Floats:
    """First three natural frequencies [Hz] of a clamped beam of the limb's free length (Euler-Bernoulli)."""
    frequencies: Floats = (CANTILEVER_ROOTS / free_length(robot)) ** 2 * beam_constant(robot) / (2.0 * np.pi)
    return frequencies


def fitted_frequency(time: Floats, signal: Floats, guess: float) -> float:
    """Frequency [Hz] near a guess whose sine and cosine fit a signal best, shape (n_times,)."""

    def misfit(frequency: float) -> float:
        phase = 2.0 * np.pi * frequency * time
        waves = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        rest: Floats = signal - waves @ np.linalg.lstsq(waves, signal)[0]
        return float(rest @ rest)

    # The misfit has its other minima one over the duration apart: find the valley, then its bottom.
    width = 0.25 / (time[-1] - time[0])
    coarse = np.arange(0.7 * guess, 1.3 * guess, width)
    valley = coarse[np.argmin([misfit(frequency) for frequency in coarse])]
    found = minimize_scalar(misfit, bounds=(valley - width, valley + width), method="bounded", options={"xatol": 1e-10})
    return float(found.x)


def ringing_frequencies(robot: Seastar, step: float = 0.2e-3, n_periods: float = 12.0) -> Floats:
    """Natural frequencies [Hz] of the clamped limb, from its free vibration in vacuum.

    Limb 1 is let go from the shape of each of the beam's modes, with a tip amplitude of 1e-4 L. The implicit midpoint
    rule rings slower than the rods by a known amount, which is undone: tan(omega h / 2) = omega_rods h / 2.
    """
    guesses = cantilever_frequencies(robot)
    own = np.arange(1, robot.nodes_per_limb)
    s = np.maximum(own * robot.edge_length - 0.5 * robot.edge_length, 0.0) / free_length(robot)
    weights = np.where(own == own[-1], 0.5, 1.0)
    frequencies = []
    for root, guess in zip(CANTILEVER_ROOTS, guesses, strict=True):
        duration = n_periods / guess
        h = min(step, 0.01 / guess)
        actuator = SmaPulse(0.0, heating_time=0.5 * duration, cooling_time=0.5 * duration)
        numerics = Numerics("implicit-midpoint", h, newton_tolerance=1e-12)
        simulator = Simulator(held_limb(robot, actuator=actuator, numerics=numerics))
        shape = np.where(own > 1, cantilever_shape(root, s), 0.0)
        state = simulator.get_state()
        state.positions[0, own, 1] += 1e-4 * robot.limb_length * shape
        simulator.set_state(state)
        samples = [(0.0, state.positions[0, own, 1])]
        for time in simulator.stroke_in_parts(np.zeros((1, robot.n_limbs)), round(25 * n_periods)):
            samples.append((time, simulator.positions[0, own, 1]))
        times, heights = map(np.array, zip(*samples, strict=True))
        measured = fitted_frequency(times, heights @ (weights * shape), guess)
        frequencies.append(np.tan(np.pi * measured * h) / (np.pi * h))
    return np.array(frequencies)


FREQUENCY_NODES = (10, 20, 40)


def natural_frequencies() -> Section:
    """Free vibration of a clamped limb."""
    rows, errors = [], []
    for n in FREQUENCY_NODES:
        robot = Seastar(nodes_per_limb=n)
        exact, ours = cantilever_frequencies(robot), ringing_frequencies(robot)
        errors.append(ours / exact - 1.0)
        for mode in range(3):
            allowed = exact[mode] * 0.15 * (CANTILEVER_ROOTS[mode] / (n - 1)) ** 2
            rows.append(Row(f"frequency {mode + 1}, N = {n}", exact[mode], ours[mode], "Hz", allowed))
    lengths = [Seastar(nodes_per_limb=n).edge_length for n in FREQUENCY_NODES]
    for mode in range(3):
        order = order_of_convergence(lengths, np.array(errors)[:, mode])
        rows.append(Row(f"order in l, frequency {mode + 1}", 2.0, order, "", 0.15))
    return Section(
        "Natural frequencies of a clamped limb",
        "The clamped limb is let go from the shape of a beam's mode with a tip amplitude of 1e-4 L, in vacuum, and "
        "followed over twelve periods by the implicit midpoint rule, whose known slowing of an oscillation is undone. "
        "Reference: Euler-Bernoulli, length L - l/2.",
        rows,
    )


# --- quadratic drag --------------------------------------------------------------------------------------------------


def drag_over_mass(robot: Seastar, fluid: Water) -> float:
    """k [1/m] of dv/dt = -k |v| v for a robot that only translates: the same for every node (13.8)."""
    return fluid.density * fluid.drag_coefficient / (np.pi * robot.rod_radius * robot.density)


def falling_speed(acceleration: float, time: float, scheme: Numerics) -> tuple[float, float]:
    """(exact, ours) speed [m/s] after `time` [s] from rest, under loads of mass times `acceleration` [m/s^2]."""
    robot, fluid = Seastar(), Water()
    mass = Scene(robot, fluid).rods().mass
    loads = tuple((node, acceleration * m, 0.0) for node, m in enumerate(mass))
    actuator = SmaPulse(0.0, heating_time=0.5 * time, cooling_time=0.5 * time)
    simulator = Simulator(Scene(robot, fluid, actuator, scheme, loads=loads))
    assert not simulator.stroke(np.zeros((1, robot.n_limbs))).status.any()
    terminal = np.sqrt(acceleration / drag_over_mass(robot, fluid))
    return float(terminal * np.tanh(acceleration * time / terminal)), float(simulator.hub_velocity()[0, 0])


def coasting(speed: float, time: float, scheme: Numerics) -> tuple[Floats, Floats]:
    """(exact, ours): (speed [m/s], way [m]) of a robot that coasts for `time` [s] from a speed [m/s], limbs at rest."""
    robot, fluid = Seastar(), Water()
    actuator = SmaPulse(0.0, heating_time=0.5 * time, cooling_time=0.5 * time)
    simulator = Simulator(Scene(robot, fluid, actuator, scheme))
    simulator.set_state(State(robot.nodes()[None], np.tile([speed, 0.0], (1, robot.n_nodes, 1)), np.zeros(1)))
    assert not simulator.stroke(np.zeros((1, robot.n_limbs))).status.any()
    k = drag_over_mass(robot, fluid)
    exact = np.array([speed / (1.0 + k * speed * time), np.log1p(k * speed * time) / k])
    return exact, np.array([simulator.hub_velocity()[0, 0], simulator.hub_position()[0, 0]])


def quadratic_drag() -> Section:
    """Terminal speed and decay of a robot that translates without bending."""
    tight = Numerics("sdirk3", 2e-3, newton_tolerance=1e-12)
    rows = []
    for time in (0.05, 0.2, 5.0):
        exact, ours = falling_speed(1.0, time, tight)
        what = "terminal speed" if time == 5.0 else f"speed after {time:g} s from rest"
        rows.append(Row(f"{what}, loads of 1 m/s² times the mass", MM * exact, MM * ours, "mm/s", 1e-5 * MM * exact))
    for time in (0.1, 1.0, 10.0):
        exact_pair, our_pair = coasting(0.1, time, tight)
        names = ("speed", "mm/s"), ("way", "mm")
        for (name, unit), exact, ours in zip(names, MM * exact_pair, MM * our_pair, strict=True):
            rows.append(Row(f"{name} after coasting {time:g} s from 0.1 m/s", exact, ours, unit, 1e-5 * exact))
    return Section(
        "Quadratic drag",
        "Drag and mass of a node are both proportional to its Voronoi length, so a straight robot translates without "
        "bending and dv/dt = a - k v², k = rho_f C_d / (pi r_0 rho_m) = 199 1/m. Reference: v = sqrt(a/k) "
        "tanh(sqrt(a k) t) from rest, v = v_0 / (1 + k v_0 t) and x = log(1 + k v_0 t) / k when coasting. SDIRK3, "
        "h = 2 ms.",
        rows,
    )


# --- bending waves ---------------------------------------------------------------------------------------------------

WAVE_NODES = (201, 401, 801)
WAVE_LENGTH, WAVE_WIDTH, WAVE_START, WAVE_TIME = 0.08, 0.05, 0.35, 0.06
"""Wavelength, width and first place [m] of the pulse, and how long it is followed [s]: no part of it meets an end."""


def bending_pulse(robot: Seastar, step: float = 0.1e-3) -> tuple[Floats, Floats, Floats]:
    """Displacements across limb 1 [m] before and after a pulse has run along it for WAVE_TIME, and its nodes' x [m].

    The pulse is a Gaussian of WAVE_WIDTH over waves of WAVE_LENGTH, and begins with the velocity of the wave that
    runs to the tip: each of its wavenumbers turns at omega = k^2 sqrt(EI / (rho_m A)).
    """
    x = robot.edge_length * np.arange(robot.nodes_per_limb)
    k = 2.0 * np.pi * np.fft.fftfreq(4 * len(x), robot.edge_length)
    wide = robot.edge_length * np.arange(4 * len(x)) - WAVE_START
    envelope = np.exp(-0.5 * (wide / WAVE_WIDTH) ** 2)
    waves = np.fft.fft(envelope * np.exp(2j * np.pi / WAVE_LENGTH * wide))
    amplitude = 1e-6 * WAVE_LENGTH
    height = amplitude * np.fft.ifft(waves).real[: len(x)]
    speed = amplitude * np.fft.ifft(-1j * k**2 * beam_constant(robot) * waves).real[: len(x)]
    actuator = SmaPulse(0.0, heating_time=0.5 * WAVE_TIME, cooling_time=0.5 * WAVE_TIME)
    numerics = Numerics("implicit-midpoint", step, newton_tolerance=1e-13)
    simulator = Simulator(Scene(robot, None, actuator, numerics))
    state = simulator.get_state()
    state.positions[0, : len(x), 1] = height
    state.velocities[0, : len(x), 1] = speed
    simulator.set_state(state)
    assert not simulator.stroke(np.zeros((1, robot.n_limbs))).status.any()
    return height, simulator.positions[0, : len(x), 1], x


def pulse_frequency(robot: Seastar, before: Floats, after: Floats, x: Floats) -> tuple[float, float]:
    """(omega [rad/s] at the wavenumber of WAVE_LENGTH, d omega / d k [m/s]) from the phases that a pulse gained."""

    def omega(k: float) -> float:
        gained = -np.angle((after @ np.exp(-1j * k * x)) / (before @ np.exp(-1j * k * x)))
        turns = np.round((k**2 * beam_constant(robot) * WAVE_TIME - gained) / (2.0 * np.pi))
        return float((gained + 2.0 * np.pi * turns) / WAVE_TIME)

    k, dk = 2.0 * np.pi / WAVE_LENGTH, 1.0
    return omega(k), (omega(k + dk) - omega(k - dk)) / (2.0 * dk)


def bending_waves() -> Section:
    """A pulse that runs along a limb of 1 m."""
    k = 2.0 * np.pi / WAVE_LENGTH
    rows, errors, lengths = [], [], []
    for n in WAVE_NODES:
        robot = Seastar(n_limbs=3, nodes_per_limb=n, limb_length=1.0)
        omega, group = pulse_frequency(robot, *bending_pulse(robot))
        exact = k * beam_constant(robot)
        allowed = 0.15 * (k * robot.edge_length) ** 2 * exact
        nodes = f"{round(WAVE_LENGTH / robot.edge_length)} nodes a wave"
        rows.append(Row(f"phase speed, {nodes}", exact, omega / k, "m/s", allowed))
        rows.append(Row(f"group speed, {nodes}", 2.0 * exact, group, "m/s", 4.0 * allowed))
        errors.append(omega / k - exact)
        lengths.append(robot.edge_length)
    rows.append(Row("order in l, phase speed", 2.0, order_of_convergence(lengths, errors), "", 0.15))
    return Section(
        "Bending waves",
        "A pulse of waves of 80 mm runs along a limb of 1 m in vacuum (implicit midpoint, h = 0.1 ms); its speeds come "
        "from the phases that its Fourier components gained. Reference: omega = k² sqrt(EI / (rho_m A)), phase speed "
        "omega / k, group speed twice that.",
        rows,
    )


# --- published codes -------------------------------------------------------------------------------------------------

PUBLISHED_FINALS = {10e-3: 36.2827089, 1e-3: 38.2752941}
"""h [s]: hub x [mm] after ten strokes in both C++ codes with Newton converged tightly."""


def straight_swim(step: float, parts: int = 10) -> tuple[Floats, Floats]:
    """Times [s] and hub x [m] of ten strokes of {2+,5-} with a turning-angle hub, implicit Euler, Newton tight."""
    numerics = Numerics("implicit-euler", step, newton_tolerance=1e-12)
    simulator = Simulator(Scene(Seastar(hub_hinge="turning"), numerics=numerics))
    samples = []
    for stroke in range(10):
        for time in simulator.stroke_in_parts(STRAIGHT, parts):
            samples.append((stroke + time, simulator.hub_position()[0, 0]))
    times, x = map(np.array, zip(*samples, strict=True))
    return times, x


def published_swim(file: Path = PUBLISHED_SWIM) -> tuple[Floats, Floats, Floats]:
    """Times [s] and hub x [m] of two published codes, every 0.1 s of ten strokes, h = 10 ms, stock tolerances."""
    time, x_a, x_b = np.loadtxt(file, delimiter=",", comments="#", skiprows=5).T
    return time, x_a, x_b


def published_codes(file: Path = PUBLISHED_SWIM) -> Section:
    """The straight swim in codes of the chapter's authors' groups."""
    rows = []
    for step, final in PUBLISHED_FINALS.items():
        _, x = straight_swim(step, 1)
        rows.append(Row(f"hub x after ten strokes, h = {MM * step:g} ms, tight", final, MM * x[-1], "mm", 2e-7 * final))
    time, x_a, x_b = published_swim(file)
    our_time, x = straight_swim(10e-3)
    np.testing.assert_allclose(our_time, time, atol=1e-9)
    spread = MM * np.abs(x_a - x_b).max()
    for name, theirs in (("A", x_a), ("B", x_b)):
        worst = int(np.argmax(np.abs(x - theirs)))
        what = f"hub x at {time[worst]:.1f} s, the worst of 100 times, code {name}"
        rows.append(Row(what, MM * theirs[worst], MM * x[worst], "mm", 2.0 * spread))
    return Section(
        "Published codes",
        "The straight swim {2+,5-}, implicit Euler, hub hinges by their turning angle, the ramp taken at the end of "
        "each step. Code A is dismech-rods in its planar mode, code B DDG_Tutorial_Fast (2d_curve), both given this "
        "scene. First with Newton converged tightly in all codes; then A's and B's trajectories at their stock "
        f"tolerances, which differ from each other by up to {spread:.1e} mm.",
        rows,
    )


# --- the page --------------------------------------------------------------------------------------------------------

SECTIONS: tuple[Callable[[], Section], ...] = (
    elastica, natural_frequencies, quadratic_drag, bending_waves, published_codes,
)  # fmt: skip


def as_number(value: float) -> str:
    """Eight significant digits, trailing zeros kept out."""
    return f"{value:.8g}"


def as_cells(row: Row) -> tuple[str, str, str, str]:
    """Quantity with unit, reference, ours, and the difference: absolute, and relative to the reference."""
    unit = f" [{row.unit}]" if row.unit else ""
    relative = f" ({row.difference / row.reference:+.1e})" if row.unit else ""
    return row.quantity + unit, as_number(row.reference), as_number(row.ours), f"{row.difference:+.1e}{relative}"


def as_page(sections: Sequence[Section]) -> str:
    """The page of results in Markdown."""
    lines = [
        "# Validation against what is known",
        "",
        "Written by `python -m seastar_gym.studies.validation`; `tests/test_validation.py` holds every line to a bound.",
        "Robot and fluid are the chapter's unless a section says otherwise. The difference is ours minus the reference,",
        "in brackets relative to the reference.",
    ]
    for section in sections:
        lines += ["", f"## {section.title}", "", section.method, ""]
        lines += ["| quantity | reference | ours | difference |", "|---|---:|---:|---:|"]
        lines += [f"| {' | '.join(as_cells(row))} |" for row in section.rows]
    return "\n".join(lines) + "\n"


def as_table(section: Section) -> Table:
    """For the terminal."""
    table = Table("quantity", title=section.title, title_justify="left")
    for column in ("reference", "ours", "difference"):
        table.add_column(column, justify="right")
    for row in section.rows:
        table.add_row(*as_cells(row), style="" if row.holds else "red")
    return table


def main() -> None:
    """Compute, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("docs/validation.md"), help="the page to write")
    options = parser.parse_args()
    sections = [section() for section in tqdm(SECTIONS, unit="section")]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(as_page(sections), encoding="utf-8")
    console = Console()
    for section in sections:
        console.print(as_table(section))
    console.print(f"Written: {options.out}")


if __name__ == "__main__":
    main()
