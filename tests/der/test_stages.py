"""Time steps: first guesses, results, errors, and intervals that every robot covers in its own steps."""

import functools

import numpy as np
import pytest
from scipy.linalg import eigh

import oracle
from continuum_oracle import Continuum
from hubs import TEN
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, State
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.interval import cover_interval
from seastar_gym.der.stepping.report import COVERED, HALVINGS, REPORT_ROWS, STEPS
from seastar_gym.der.stepping.schemes import SCHEMES, scheme_of
from seastar_gym.der.stepping.stages import (
    Stage,
    begin_stage,
    end_stage,
    end_step,
    forget_accelerations,
    step_error,
    store_share,
)
from seastar_gym.der.terms.hub import Actuation
from seastar_gym.model.rods import make_limits, make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import plain, rows

ROBOT = Seastar(5, 3)
SCENE = Scene(ROBOT, actuator=SmaPulse(0.3))
RODS, SIZE = make_rods(SCENE), 2 * ROBOT.n_nodes
RNG = np.random.default_rng(0)
H = 0.01
EVERYONE = Mask(np.ones(N_LANES, bool))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_scheme_is_exact_for_nodes_that_fall(scheme):
    """With constant accelerations in memory the first guess is the parabola, and so is the step's result."""
    tableau, work = SCHEMES[scheme], make_work(RODS, SCHEMES[scheme].n_stages)
    q_0, v_0, a_0 = RNG.standard_normal((3, SIZE, N_LANES))
    q, v, n = q_0.copy(), v_0.copy(), tableau.n_stages
    a = np.concatenate([np.tile(a_0, (n, 1)), np.ones((n + 2, N_LANES))])
    for k in range(n):
        stage = begin_stage.plain(RODS, work, tableau, k, q, v, a, Lanes(H))
        if k < n - 1:
            end_stage.plain(RODS, work, tableau, k, stage, a, EVERYONE)
    end_step.plain(RODS, work, tableau, stage, q, v, a, Lanes(H), EVERYONE)
    np.testing.assert_allclose(v, v_0 + H * a_0, rtol=1e-12, atol=1e-12)
    exact = q_0 + H * v_0 + H**2 * a_0 * (1.0 if scheme == "implicit-euler" else 0.5)
    np.testing.assert_allclose(q, exact, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(a[n * SIZE : n * SIZE + n], 1.0, rtol=1e-8)


def test_elastic_energy_within_a_stroke_is_that_of_the_present_actuation():
    simulator, star = Simulator(Scene(TEN, numerics=Numerics(step=0.01)), n_robots=2), Continuum()
    commands = np.array([[0.0, 1.0, 0.0, 0.0, -1.0], [0.3, 0.0, 0.0, -0.7, 0.0]])
    for time in simulator.stroke_in_parts(commands, 10):
        delta_psi = commands * oracle.pulse(round(time, 9))
        expected = [oracle.elastic_energy(star, q, d) for q, d in zip(simulator.positions, delta_psi, strict=True)]
        np.testing.assert_allclose(simulator.elastic_energy(), expected, rtol=1e-9, atol=1e-16)


def test_a_step_that_is_not_accepted_changes_no_bit():
    tableau, work = SCHEMES["sdirk2"], make_work(RODS, 2)
    (q, v), a = RNG.standard_normal((2, SIZE, N_LANES)), np.zeros((2 * SIZE + 4, N_LANES))
    before, chosen = (q.copy(), v.copy()), np.arange(N_LANES) % 2 == 0
    stage = begin_stage.plain(RODS, work, tableau, 1, q, v, a, Lanes(H))
    work.q[:] += 1.0
    end_step.plain(RODS, work, tableau, stage, q, v, a, Lanes(H), Mask(chosen))
    for now, then in zip((q, v), before, strict=True):
        np.testing.assert_array_equal(now[:, ~chosen], then[:, ~chosen])
        assert np.all(now[:, chosen] != then[:, chosen])
    accelerations = a[SIZE : 2 * SIZE]  # of the last stage, kept for the next step's first guess
    assert accelerations[:, chosen].all() and not accelerations[:, ~chosen].any()


def test_the_share_of_an_acceleration_is_kept_from_zero_to_one():
    a, along = np.full((1, 4), 9.0), np.array([0.5, -0.5, 3.0, 0.5])
    store_share.plain(a, 0, Lanes(along), Lanes(np.ones(4)), Mask([True, True, True, False]))
    np.testing.assert_array_equal(a[0], [0.5, 0.0, 1.0, 9.0])


def test_robots_that_had_to_halve_forget_their_accelerations():
    a = np.ones((SIZE + 3, N_LANES))
    forget_accelerations.plain(RODS, SCHEMES["implicit-euler"], a, Mask(np.arange(N_LANES) == 1))
    assert not a[: SIZE + 1, 1].any() and a[: SIZE + 1, 0].all() and a[SIZE + 1 :].all()


def test_the_error_of_a_step_is_that_of_the_midpoint_rule_on_a_cubic():
    """Accelerations that change by h j from one step of length h to the next give the error h^3 j/12."""
    jerk, work = RNG.standard_normal((SIZE, N_LANES)), make_work(RODS, 1)
    last, gamma = 0.3 * jerk, 0.5 * H
    work.q[:] = gamma**2 * (last + H * jerk)
    stage = Stage(0.0 * work.q, 0.0 * work.q, Lanes(gamma), Lanes(1.0 / gamma), True)
    error = plain(step_error.plain(RODS, work, stage, last, Lanes(H), Lanes(H)))
    largest = np.linalg.norm(jerk.reshape(-1, 2, N_LANES), axis=1).max(axis=0)
    np.testing.assert_allclose(error, H**3 * largest / 12.0, rtol=1e-9)


@pytest.mark.parametrize("scheme", ["implicit-euler", "implicit-midpoint"])
def test_a_robot_in_trouble_halves_alone_and_covers_the_interval_to_the_last_bit(scheme):
    """The last robot begins with edges that fly apart; the others are at rest, and stay there in one step."""
    tableau, limits = SCHEMES[scheme], make_limits(Scene(ROBOT, numerics=Numerics(scheme, H, max_iterations=6)))
    work, still = make_work(RODS, tableau.n_stages), Actuation(*np.zeros((2, 5, N_LANES)))
    q, v = rows(ROBOT.nodes()), np.zeros((SIZE, N_LANES))
    v[:, -1] = 2.0 * RNG.standard_normal(SIZE)
    a, report = np.zeros(((SIZE + 1) * tableau.n_stages + 2, N_LANES)), np.zeros((len(REPORT_ROWS), N_LANES))
    args = RODS, work, tableau, SCHEMES["implicit-euler"], still, q, v, a, H, EVERYONE, limits, report
    arrived = plain(cover_interval.plain(*args))
    assert arrived.all()
    assert report[HALVINGS, -1] > 0 and not report[HALVINGS, :-1].any()
    np.testing.assert_array_equal(report[STEPS, :-1], 1.0)
    np.testing.assert_array_equal(report[COVERED], H)
    np.testing.assert_allclose(q[:, :-1], rows(ROBOT.nodes())[:, :-1], rtol=0.0, atol=1e-12)


# The schemes are what their tableaux say: order, damping of oscillations, and steps that respect the ramp's corners.


ORDERS = {"implicit-euler": 1, "sdirk2": 2, "sdirk3": 3, "implicit-midpoint": 2}
TEN_NODES = Seastar(nodes_per_limb=4)


def matrix(scheme: str, damping: float = 0.0) -> np.ndarray:
    """The tableau's A."""
    tableau = scheme_of(scheme, damping)
    return tableau.a.reshape(tableau.n_stages, tableau.n_stages)


def stability(scheme: str, z: complex, damping: float = 0.0) -> complex:
    """R(z) = 1 + z b (1 - z A)^-1 1: what a step does to y' = (z/h) y."""
    tableau = scheme_of(scheme, damping)
    ones = np.ones(tableau.n_stages)
    return complex(1.0 + z * tableau.b @ np.linalg.solve(np.diag(ones) - z * matrix(scheme, damping), ones))


# Tableaux


@pytest.mark.parametrize("scheme", SCHEMES)
def test_tableau_fulfils_the_conditions_of_its_order_and_not_of_the_next(scheme):
    b, c, a = SCHEMES[scheme].b, SCHEMES[scheme].c, matrix(scheme)
    np.testing.assert_allclose(c, a.sum(axis=1), atol=1e-15)
    conditions = {1: [(b.sum(), 1.0)], 2: [(b @ c, 1 / 2)], 3: [(b @ c**2, 1 / 3), (b @ a @ c, 1 / 6)]}
    kept = [all(abs(value - wanted) < 1e-14 for value, wanted in conditions[order]) for order in conditions]
    assert kept.index(False) if False in kept else len(kept) == ORDERS[scheme]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_no_scheme_lets_an_oscillation_grow_and_each_keeps_or_drops_the_fast_ones_as_documented(scheme):
    factors = [abs(stability(scheme, 1j * y)) for y in np.logspace(-3, 6, 200)]
    assert max(factors) <= 1.0 + 1e-12
    assert (min(factors) > 1.0 - 1e-12) == (scheme == "implicit-midpoint")
    assert abs(stability(scheme, 1e12j)) == pytest.approx(1.0 if scheme == "implicit-midpoint" else 0.0, abs=1e-9)


@pytest.mark.parametrize("damping", [0.002, 0.1, 0.5])
def test_numerical_damping_is_that_of_the_theta_method(damping):
    """Slow oscillations lose d x^2/2 of their amplitude per step, fast ones 2 d, and all as the docstring says; without
    damping they keep it."""
    assert all(scheme_of(name, 0.0) is scheme for name, scheme in SCHEMES.items())
    theta = 0.5 * (1.0 + damping)
    for x in np.logspace(-4, 6, 40):
        squared = (1.0 + (1.0 - theta) ** 2 * x**2) / (1.0 + theta**2 * x**2)
        assert abs(stability("implicit-midpoint", 1j * x, damping)) ** 2 == pytest.approx(squared, rel=1e-12)
    slow, fast = (abs(stability("implicit-midpoint", 1j * x, damping)) for x in (1e-2, 1e6))
    assert 1.0 - slow == pytest.approx(damping * 1e-4 / 2.0, rel=1e-3)
    assert fast == pytest.approx((1.0 - damping) / (1.0 + damping), rel=1e-9)


# Oscillations


@pytest.fixture(scope="module")
def modes():
    """Frequencies [1/s] and shapes of the robot's normal modes in vacuum, stiffest last, and its mass matrix."""
    star = Continuum(nodes_per_limb=TEN_NODES.nodes_per_limb)
    mass = oracle.mass_matrix(star, star.rest)
    squared, shapes = eigh(oracle.elastic_hessian(star, star.rest, np.zeros(5)), mass)
    return np.sqrt(np.maximum(squared, 0.0)), shapes, mass


def oscillate(
    scheme: str, modes, mode: int, h: float, n_steps: int, amplitude: float = 1e-7, damping: float = 0.0
) -> complex:
    """Factor of v + i omega q after n_steps, for a mode started at its largest swing; amplitude of the swing [m]."""
    omega, shapes, mass = modes
    shape = shapes[:, mode] * amplitude / np.abs(shapes[:, mode]).max()
    actuator = SmaPulse(0.0, heating_time=h * (n_steps // 2), cooling_time=h * (n_steps - n_steps // 2))
    numerics = Numerics(scheme, h, newton_tolerance=1e-14, damping=damping)
    simulator = Simulator(Scene(TEN_NODES, None, actuator, numerics))
    rest = TEN_NODES.nodes()
    simulator.set_state(State((rest + shape.reshape(-1, 2))[None], np.zeros((1, *rest.shape)), np.zeros(1)))
    report = simulator.stroke(np.zeros((1, 5)))
    assert report.status[0] == 0 and report.halvings[0] == 0 and report.steps[0] == n_steps
    weights = mass @ shape / (shape @ mass @ shape)
    q = weights @ (simulator.positions[0] - rest).ravel()
    v = weights @ simulator.velocities[0].ravel()
    return complex(v + 1j * omega[mode] * q) / (1j * omega[mode])


@pytest.mark.parametrize("scheme, damping", [*((scheme, 0.0) for scheme in SCHEMES), ("implicit-midpoint", 0.1)])
@pytest.mark.parametrize("cycles_per_step", [0.02, 0.2, 2.0, 20.0])
@pytest.mark.parametrize("mode", [-1, 20, 5], ids=["stiffest", "middle", "softest-bending"])
def test_a_step_does_to_a_vibration_what_the_stability_function_says(scheme, damping, modes, mode, cycles_per_step):
    """Amplitude and phase, from steps that resolve it to steps of many periods."""
    y, n_steps = 2.0 * np.pi * cycles_per_step, 4
    factor = oscillate(scheme, modes, mode, y / modes[0][mode], n_steps, damping=damping)
    assert abs(factor - stability(scheme, 1j * y, damping) ** n_steps) < 2e-4


@pytest.mark.parametrize("scheme", SCHEMES)
def test_error_of_a_vibration_falls_with_the_order_of_the_scheme(scheme, modes):
    """Slope of log error over log h, after one period of a bending vibration whose exact motion is known."""
    mode, counts = 8, np.array([16, 32, 64]) * (8 if ORDERS[scheme] == 1 else 1)
    period = 2.0 * np.pi / modes[0][mode]
    errors = [abs(oscillate(scheme, modes, mode, period / n, int(n), 1e-6) - 1.0) for n in counts]
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(ORDERS[scheme], abs=0.15)


# Corners of the ramp


@functools.cache
def end_of_a_stroke(scheme: str, step: float) -> np.ndarray:
    """Node positions of a soft robot after a whole stroke."""
    robot = Seastar(n_limbs=3, nodes_per_limb=3, youngs_modulus=1e3)
    actuator = SmaPulse(0.3, heating_time=0.03, cooling_time=0.07)
    simulator = Simulator(Scene(robot, None, actuator, Numerics(scheme, step, newton_tolerance=1e-13)))
    report = simulator.stroke([[1.0, -1.0, 0.5]])
    assert report.status[0] == 0 and report.halvings[0] == 0
    return simulator.positions


@pytest.mark.parametrize("scheme", SCHEMES)
def test_corners_of_the_ramp_cost_no_order(scheme):
    """A whole actuated stroke, with steps that do not divide the ramps: none straddles a corner."""
    exact = end_of_a_stroke("sdirk3", 0.1 / 512)
    steps = 0.1 / np.array([23.0, 43.0, 97.0])
    errors = [np.linalg.norm(end_of_a_stroke(scheme, step) - exact) for step in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(ORDERS[scheme], abs=0.15)
