"""The simulator against exact solutions and published codes.

Robot and fluid are the chapter's. `--update` writes the numbers, some of which docs/validation.md shows.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.linalg import eigh

import exact.solutions as known
from continuum_oracle import Continuum
from currents import NONE
from oracle import Star, elastic_hessian, inertia_matrix
from seastar_gym import Limb, Numerics, Scene, Seastar, Simulator, SmaPulse, Water
from seastar_gym.accuracy.measure import path_lengths
from seastar_gym.gaits import PAIRS, STRAIGHT, straight_gait
from seastar_gym.model import make_rods

KEPT = Path(__file__).parents[1] / "golden" / "exact"
IN_LINE = {"continuum": Seastar(2, 10), "chapter": Seastar(2, 10, hub_hinge="turning", discretisation="chapter")}
"""Two limbs in a line, in either discretisation. What mirrors itself in them does not turn them about the hub, so that
each is clamped there where the hub is held."""


class Row(NamedTuple):
    """A compared quantity, and the largest |ours - reference| that is allowed."""

    quantity: str
    reference: float
    ours: float
    allowed: float
    shown: bool = True
    digits: int = 6

    def cells(self):
        """Quantity with unit, reference, ours, and the absolute and relative difference, as the page has them."""
        off, numbers = self.ours - self.reference, (f"{n:#.{self.digits}g}" for n in (self.reference, self.ours))
        relative = f" ({off / self.reference:+.1e})" if self.quantity.endswith("]") else ""
        return [self.quantity, *numbers, f"{off:+.1e}{relative}"]


def order(errors, robots):
    """Slope of log error over log edge length."""
    return np.polyfit(np.log([robot.edge_length for robot in robots]), np.log(np.abs(errors)), 1)[0]


@pytest.fixture
def told(request):
    """Function that holds rows to their bounds, which are not generous, and to what the page has: (name, rows)."""

    def hold(name, rows):
        off = np.array([abs(row.ours - row.reference) for row in rows])
        allowed, more = (np.array([f(row) for row in rows]) for f in (lambda r: r.allowed, lambda r: abs(r.reference)))
        assert (off <= allowed).all() and np.mean(off + 1e-2 * more > allowed) >= 0.5
        shown, file = [row for row in rows if row.shown], KEPT / f"{name}.json"
        if request.config.getoption("--update"):
            file.write_text(json.dumps([row.cells() for row in shown], indent=1, ensure_ascii=False) + "\n", "utf-8")
        for row, (quantity, reference, ours, _) in zip(shown, json.loads(file.read_text("utf-8")), strict=True):
            assert [quantity, reference] == row.cells()[:2] and abs(float(ours) - row.ours) <= row.allowed

    return hold


# Clamped limbs under tip loads

LOADS = {1.0: (0.06, 0.11), 3.0: (0.42, 0.14), 10.0: (1.05, 0.6)}
"""Loads P L^2 / EI, and for each the largest errors of the tip, in either discretisation, in units of l^2 / L."""
TO_REST = Numerics("implicit-euler", step=0.5, newton_tolerance=1e-12)
"""Steps comparable to the limb's slowest period (0.6 s) damp it to rest."""


def loaded_tip(robot, k, held):
    """Tip (x, y) [m] of limb 1 at rest, where every limb has a tip load of k EI / L^2 in +y. Held nodes are heavy, not
    fixed: minutes under these loads would move them visibly."""
    ends = range(robot.nodes_per_limb - 1, robot.n_nodes, robot.nodes_per_limb - 1)
    loads = tuple((end, 0.0, k * known.stiffness(robot)[0] / robot.limb_length**2) for end in ends)
    simulator = Simulator(Scene(robot, Water(), known.pause(8.0), TO_REST, held_nodes=held, loads=loads))
    known.let_pass(simulator)
    return simulator.positions[0, robot.nodes_per_limb - 1]


def test_clamped_limbs_bend_as_the_extensible_elastica(told):
    rows, EI_EA = [], known.stiffness(Seastar())
    for k, bounds in LOADS.items():
        exact = known.elastica_tip(k * EI_EA[0] / 0.1**2, EI_EA[0], 0.1, EI_EA[1])
        for (name, in_line), bound in zip(IN_LINE.items(), bounds, strict=True):
            robots = [replace(in_line, nodes_per_limb=n) for n in (10, 40, 80)]
            found = [loaded_tip(robot, k, (0,)) for robot in robots]
            for robot, tip in zip(robots, found, strict=True):
                shown = k == 3.0 and robot is robots[0] and name == "continuum"
                for across, one, other in zip("xy", exact, tip, strict=True):
                    what = f"tip {across}, P = {k:g} EI/L², {name}, N = {robot.nodes_per_limb} [mm]"
                    allowed = 1e3 * bound * robot.edge_length**2 / 0.1
                    rows.append(Row(what, 1e3 * one, 1e3 * other, allowed, shown=shown))
            errors = [np.hypot(*(tip - exact)) for tip in found[1:]]
            of = f"order in l, tip, P = {k:g} EI/L², {name}, N = 40 to 80"
            rows.append(Row(of, 2.0, order(errors, robots[1:]), 0.1, k == 3.0, 3))
    told("elastica", rows)


@pytest.mark.parametrize(
    ("discretisation", "n_limbs", "clamp"), [("chapter", 5, 0.5), ("continuum", 5, 0.0), ("continuum", 1, 0.0)]
)
def test_a_limb_held_by_hub_and_root_node_is_clamped_at_the_hub_or_in_the_middle_of_the_edge(
    discretisation, n_limbs, clamp
):
    """Against an elastica from that place, the error is of order 2, or a little better."""
    robots, errors = [Seastar(n_limbs, n, discretisation=discretisation) for n in (20, 40, 80)], []
    EI, EA = known.stiffness(robots[0])
    for robot in robots:
        held = clamp * robot.edge_length
        expected = known.elastica_tip(EI / 0.1**2, EI, 0.1 - held, EA) + [held, 0.0]
        errors.append(np.hypot(*(loaded_tip(robot, 1.0, (0, 1)) - expected)))
    assert 1.9 < order(errors, robots) < 2.5
    assert clamp > 0.0 or errors[0] < 3e-3 * expected[1]


# Natural frequencies of clamped limbs

FREQUENCY_ORDERS = {"continuum": (3.0, 0.06), "chapter": (2.0, 0.3)}
"""Order p of the error in l, and its largest coefficient: |error| is below this times (beta l)^p, relative."""


def ringing_frequency(robot, mode):
    """Natural frequency [Hz] of the clamped limbs of a robot IN_LINE in vacuum; mode: 0, 1 or 2.

    Both are released from the shape of the beam's mode with a tip amplitude of 1e-4 L, for twelve periods. The implicit
    midpoint rule lowers the frequency by a known amount, which is corrected: omega h / 2 = tan(omega_measured h / 2).
    """
    guess, own = known.cantilever_frequencies(robot)[mode], np.arange(1, robot.nodes_per_limb)
    h = 1.0 / (400 * guess)
    numerics = Numerics("implicit-midpoint", h, newton_tolerance=1e-12)
    simulator = Simulator(Scene(robot, None, known.pause(12 / guess), numerics, held_nodes=(0,)))
    shape = known.cantilever_shape(known.CANTILEVER_ROOTS[mode], own / (robot.nodes_per_limb - 1))
    state = simulator.get_state()
    state.positions[0, 1:, 1] += 1e-4 * robot.limb_length * np.tile(shape, 2)
    simulator.set_state(state)
    projection = shape * make_rods(simulator.scene).inertia.node[own]
    samples = [(0.0, state.positions[0, own, 1] @ projection)]
    for time in simulator.stroke_in_parts(np.zeros((1, 2)), 12 * 25):
        samples.append((time, simulator.positions[0, own, 1] @ projection))
    return np.tan(np.pi * known.fitted_frequency(*np.transpose(samples), guess) * h) / (np.pi * h)


def test_clamped_limbs_ring_as_beams(told):
    rows = []
    for mode, reference in enumerate(known.cantilever_frequencies(Seastar())):
        for name, in_line in IN_LINE.items():
            robots = [replace(in_line, nodes_per_limb=n) for n in (10, 20, 40)]
            found, (p, bound) = [ringing_frequency(robot, mode) for robot in robots], FREQUENCY_ORDERS[name]
            for robot, ours in zip(robots, found, strict=True):
                allowed = bound * reference * (known.CANTILEVER_ROOTS[mode] / (robot.nodes_per_limb - 1)) ** p
                shown = robot is robots[0] and name == "continuum"
                what = f"frequency {mode + 1}, {name}, N = {robot.nodes_per_limb} [Hz]"
                rows.append(Row(what, reference, ours, allowed, shown=shown))
            errors = np.subtract(found[1:], reference)
            of = f"order in l, frequency {mode + 1}, {name}, N = 20 to 40"
            rows.append(Row(of, p, order(errors, robots[1:]), 0.15, digits=3))
    told("frequencies", rows)


@pytest.mark.parametrize("name", IN_LINE)
@pytest.mark.parametrize("n", [10, 20])
def test_the_limbs_ring_with_the_eigenvalues_of_their_stiffness(name, n):
    """The dense oracle's Hessian at rest and masses, where both limbs move alike and the hub is held."""
    star = {"continuum": Continuum(2, n), "chapter": Star(2, n, hub_hinge="turning")}[name]
    across = 2 * np.arange(1, n) + 1  # y of limb 1: along x the straight limb only stretches
    alike = np.zeros((2 * star.n_nodes, n - 1))
    for limb in (across, across + 2 * (n - 1)):
        alike[limb, np.arange(n - 1)] = 1.0
    hessian = alike.T @ elastic_hessian(star, star.rest, np.zeros(2)) @ alike
    eigenvalues = eigh(hessian, alike.T @ inertia_matrix(star) @ alike, eigvals_only=True)
    ours = [ringing_frequency(replace(IN_LINE[name], nodes_per_limb=n), mode) for mode in range(3)]
    np.testing.assert_allclose(ours, np.sqrt(eigenvalues[:3]) / (2.0 * np.pi), rtol=5e-5)


# Quadratic drag: a straight robot does not bend when it translates, so dv/dt = a - k |v| v (13.8).

IN_DRAG = Numerics("sdirk2", 0.25e-3, newton_tolerance=1e-12)
K = 1.0 / (np.pi * Seastar().rod_radius)
"""Drag over mass rho_f C_d / (pi r_0 rho_m) [1/m]; fluid and limbs have one density, and C_d is 1."""


def translated(time, speed, push):
    """(speed [m/s], distance [m]) after a time [s] of a robot whose nodes carry their mass times `push` [m/s^2]."""
    robot = Seastar(nodes_per_limb=10)
    loads = tuple((node, push * m, 0.0) for node, m in enumerate(make_rods(Scene(robot)).inertia.node))
    simulator = Simulator(Scene(robot, Water(), known.pause(time), IN_DRAG, loads=loads))
    state = simulator.get_state()
    state.velocities[..., 0] = speed
    simulator.set_state(state)
    known.let_pass(simulator)
    return np.array([simulator.hub_velocity()[0, 0], simulator.hub_position()[0, 0]])


def test_a_straight_robot_falls_and_coasts_by_quadratic_drag(told):
    rows = []
    for time, name in ((0.05, "speed after 0.05 s"), (0.2, "speed after 0.2 s"), (5.0, "terminal speed, after 5 s")):
        reference, what = 1e3 * known.falling_speed(K, 1.0, time), f"{name}, a = 1 m/s² [mm/s]"
        rows.append(Row(what, reference, 1e3 * translated(time, 0.0, 1.0)[0], 1e-6 * reference, shown=time == 5.0))
    for time in (0.1, 1.0, 10.0):
        both, names = (known.coasting(K, 0.1, time), translated(time, 0.1, 0.0)), ("speed [mm/s]", "distance [mm]")
        for what, exact, ours in zip(names, *both, strict=True):
            name = what.replace(" ", f" after coasting {time:g} s ")
            rows.append(Row(name, 1e3 * exact, 1e3 * ours, 5e-3 * exact, time == 1.0))
    told("drag", rows)


# Bending waves

WAVE, WIDTH, START, TIME, STEP = 0.08, 0.05, 0.35, 0.06, 0.1e-3
"""Wavelength, width and initial centre of the pulse [m], simulated time and step of the implicit midpoint rule [s]: no
part of the pulse meets an end of the limb."""
SLOWER = {"continuum": (4.0, 9e-4, 3e-3), "chapter": (2.0, 0.1, 0.4)}
"""Order p of the errors in l, and bounds of those of phase and group speed in units of (k l)^p, relative."""


def bending_pulse(robot):
    """State before and after a pulse ran along limb 1 for TIME: heights [m] and speeds [m/s] across, shape (N, 2). Of
    waves under a Gaussian, with the initial velocity of the wave that runs to the tip."""
    n, amplitude = robot.nodes_per_limb, 1e-6 * WAVE
    k = 2.0 * np.pi * np.fft.fftfreq(4 * n, robot.edge_length)
    from_start = robot.edge_length * np.arange(4 * n) - START
    pulse = amplitude * np.exp(-0.5 * (from_start / WIDTH) ** 2 + 2j * np.pi / WAVE * from_start)
    speed = np.fft.ifft(-1j * k**2 * known.beam_constant(robot) * np.fft.fft(pulse))
    before = np.stack([pulse.real[:n], speed.real[:n]], axis=1)
    numerics = Numerics("implicit-midpoint", STEP, newton_tolerance=1e-13)
    simulator = Simulator(Scene(robot, None, known.pause(TIME), numerics))
    state = simulator.get_state()
    state.positions[0, :n, 1], state.velocities[0, :n, 1] = before.T
    simulator.set_state(state)
    known.let_pass(simulator)
    return before, np.stack([simulator.positions[0, :n, 1], simulator.velocities[0, :n, 1]], axis=1)


def pulse_frequency(robot, k, before, after):
    """Angular frequency [rad/s] of the wavenumber k [1/m], from the phase that this component gained in TIME, corrected
    for the known amount by which the implicit midpoint rule lowers it."""
    omega = k**2 * known.beam_constant(robot)
    wave = np.exp(-1j * k * robot.edge_length * np.arange(robot.nodes_per_limb))
    # Of what runs to the tip; what runs back has the opposite velocity and cancels.
    start, end = (wave @ (heights + 1j * speeds / omega) for heights, speeds in (before.T, after.T))
    gained = -np.angle(end / start)
    lowered = (gained + 2.0 * np.pi * np.round((omega * TIME - gained) / (2.0 * np.pi))) / TIME
    return 2.0 / STEP * np.tan(0.5 * STEP * lowered)


def test_bending_waves_run_with_the_speeds_of_the_beam(told):
    k, rows = 2.0 * np.pi / WAVE, []
    phase = k * known.beam_constant(Seastar())
    for name, (p, *bounds) in SLOWER.items():
        robots, errors = [Seastar(3, n, 1.0, discretisation=name) for n in (201, 401, 801)], []
        for robot in robots:
            pulse = bending_pulse(robot)
            omega, below, above = (pulse_frequency(robot, wavenumber, *pulse) for wavenumber in (k, k - 1.0, k + 1.0))
            speeds = (("phase", phase, omega / k), ("group", 2.0 * phase, 0.5 * (above - below)))
            for (kind, reference, ours), bound in zip(speeds, bounds, strict=True):
                what = f"{kind} speed, {name}, {round(WAVE / robot.edge_length)} nodes a wave [m/s]"
                shown = robot is robots[0] and kind == "phase" and name == "continuum"
                allowed = bound * (k * robot.edge_length) ** p * reference
                rows.append(Row(what, reference, ours, allowed, shown=shown))
            errors.append(omega / k - phase)
        rows.append(Row(f"order in l, phase speed, {name}", p, order(errors, robots), 0.15, digits=3))
    told("waves", rows)


# Published codes

FINALS = {10e-3: 36.2827089, 1e-3: 38.2752941}
"""Hub x [mm] after ten strokes by time step [s], in both published codes with Newton converged tightly."""


def straight_swim(step, parts):
    """Hub x [mm] in ten strokes of the straight swim with the chapter's nodes and turning angles at the hub."""
    numerics = Numerics("implicit-euler", step, newton_tolerance=1e-12)
    simulator = Simulator(Scene(Seastar(hub_hinge="turning", discretisation="chapter"), numerics=numerics))
    times = (1 for _ in range(10) for _ in simulator.stroke_in_parts(straight_gait(), parts))
    return 1e3 * np.array([simulator.hub_position()[0, 0] for _ in times])


def test_the_straight_swim_is_that_of_two_published_codes(told):
    """They agree with ours where all converge tightly, and otherwise within the errors of their own stopping."""
    rows = []
    for step, final in FINALS.items():
        what = f"x after ten strokes, h = {1e3 * step:g} ms, codes A and B tight [mm]"
        rows.append(Row(what, final, straight_swim(step, 1)[-1], 2e-8 * final, digits=9))
    time, *codes = known.published_swim()
    np.testing.assert_allclose(time, 0.1 * np.arange(1, 101))
    ours = straight_swim(10e-3, 10)
    for name, x in zip("AB", 1e3 * np.array(codes), strict=True):
        worst, stopping = np.argmax(np.abs(ours - x)), abs(x[-1] - FINALS[10e-3])
        what = f"x at {time[worst]:.1f} s, the worst of 100 times, code {name} [mm]"
        rows.append(Row(what, x[worst], ours[worst], 2.0 * stopping, digits=9))
    told("published", rows)


# Nodes per limb: both discretisations tend to the same robot, the chapter's with order 1 and the continuum's with 2.

UNEQUAL = (Limb(radius=(2e-3, 1e-3)), Limb(length=0.08), Limb(), Limb(youngs_modulus=(2e6, 5e5)), Limb())
ROBOTS = {
    "damped": {},
    "three limbs": {"n_limbs": 3},
    "unequal, tapered limbs": {"limbs": UNEQUAL},
    "curved limbs": {"limbs": (Limb(natural_curvature=6.0),) * 5},
    "soft limbs": {"youngs_modulus": 2e5},
}
"""What robots have that differ from the chapter's. All are damped, or their limbs ring, which blurs orders."""


def paths(robot):
    """Hub at the ends of ten strokes [m] by each of several repeated commands, shape (10, n_commands, 2)."""
    actuator, commands = SmaPulse(), [STRAIGHT, *PAIRS.values(), [1, 0, -1, 0.5, 0], [-1, 1, 1, -1, 0]]
    if robot.n_limbs == 3:  # hub hinges of the chapter allow no more
        actuator, commands = SmaPulse(0.4), [[0, 1, -1], [-1, 1, 0]]
    simulator = Simulator(Scene(robot, NONE, actuator, Numerics("implicit-midpoint", 1e-3)), len(commands))
    hub = []
    for _ in range(10):
        assert not simulator.stroke(commands).status.any()
        hub.append(simulator.hub_position())
    return np.array(hub)


@pytest.mark.parametrize("name", ROBOTS)
def test_paths_tend_to_those_of_the_continuum_with_the_order_of_the_discretisation(name):
    """Errors over the length of the path with 73 nodes, of all commands the worst."""
    fine = Seastar(nodes_per_limb=73, relaxation_time=5e-3, **ROBOTS[name])
    exact = paths(fine)
    for kind, lowest, highest, second, last in (("chapter", 0.7, 1.3, 1.0, 0.12), ("continuum", 1.9, 9.0, 0.013, 1e-3)):
        robots = [replace(fine, nodes_per_limb=n, discretisation=kind) for n in (6, 10, 19, 37)]
        off = [np.linalg.norm(paths(robot) - exact, axis=-1).max(axis=0) for robot in robots]
        errors = (off / path_lengths(Scene(), exact)).max(axis=1)
        assert (np.diff(errors) < 0.0).all() and errors[1] < second and errors[-1] < last, errors
        assert lowest < order(errors[1:], robots[1:]) < highest
