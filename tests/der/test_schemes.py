"""The schemes are what their tableaux say: order, damping of oscillations, and steps that respect the ramp's corners.

The oscillations are those of the robot's own normal modes, from the oracle's dense stiffness matrix: for small
amplitudes v + i omega q has the rate i omega, so a step multiplies it by the scheme's stability function R(i omega h).
"""

import functools

import numpy as np
import pytest
from scipy.linalg import eigh

import oracle
from continuum_oracle import Continuum
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, State
from seastar_gym.der.stepping.schemes import SCHEMES, scheme_of

ORDERS = {"implicit-euler": 1, "sdirk2": 2, "sdirk3": 3, "implicit-midpoint": 2}
ROBOT = Seastar(nodes_per_limb=4)


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
    assert abs(stability(scheme, 1e12j)) == pytest.approx(1.0 if scheme == "implicit-midpoint" else 0.0, abs=1e-9)


def test_implicit_midpoint_alone_keeps_the_amplitude_of_every_oscillation():
    for y in np.logspace(-2, 4, 30):
        assert abs(stability("implicit-midpoint", 1j * y)) == pytest.approx(1.0, abs=1e-12)
        assert max(abs(stability(scheme, 1j * y)) for scheme in set(SCHEMES) - {"implicit-midpoint"}) < 1.0


@pytest.mark.parametrize("damping", [0.002, 0.1, 0.5])
def test_numerical_damping_is_that_of_the_theta_method(damping):
    """Slow oscillations lose d x^2/2 of their amplitude per step, fast ones 2 d, and all as the docstring says."""
    theta = 0.5 * (1.0 + damping)
    for x in np.logspace(-4, 6, 40):
        squared = (1.0 + (1.0 - theta) ** 2 * x**2) / (1.0 + theta**2 * x**2)
        assert abs(stability("implicit-midpoint", 1j * x, damping)) ** 2 == pytest.approx(squared, rel=1e-12)
    slow, fast = (abs(stability("implicit-midpoint", 1j * x, damping)) for x in (1e-2, 1e6))
    assert 1.0 - slow == pytest.approx(damping * 1e-4 / 2.0, rel=1e-3)
    assert fast == pytest.approx((1.0 - damping) / (1.0 + damping), rel=1e-9)


def test_damping_that_is_none_is_the_scheme_itself():
    for name, scheme in SCHEMES.items():
        assert scheme_of(name, 0.0) is scheme


# Oscillations


@pytest.fixture(scope="module")
def modes():
    """Frequencies [1/s] and shapes of the robot's normal modes in vacuum, stiffest last, and its mass matrix."""
    star = Continuum(nodes_per_limb=ROBOT.nodes_per_limb)
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
    simulator = Simulator(Scene(ROBOT, None, actuator, numerics))
    rest = ROBOT.nodes()
    simulator.set_state(State((rest + shape.reshape(-1, 2))[None], np.zeros((1, *rest.shape)), np.zeros(1)))
    report = simulator.stroke(np.zeros((1, 5)))
    assert report.status[0] == 0 and report.halvings[0] == 0 and report.steps[0] == n_steps
    weights = mass @ shape / (shape @ mass @ shape)
    q = weights @ (simulator.positions[0] - rest).ravel()
    v = weights @ simulator.velocities[0].ravel()
    return complex(v + 1j * omega[mode] * q) / (1j * omega[mode])


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("cycles_per_step", [0.02, 0.2, 2.0, 20.0])
@pytest.mark.parametrize("mode", [-1, 20, 5], ids=["stiffest", "middle", "softest-bending"])
def test_a_step_does_to_a_vibration_what_the_stability_function_says(scheme, modes, mode, cycles_per_step):
    """Amplitude and phase, from steps that resolve it to steps of many periods."""
    y = 2.0 * np.pi * cycles_per_step
    n_steps = 4
    factor = oscillate(scheme, modes, mode, y / modes[0][mode], n_steps)
    assert abs(factor - stability(scheme, 1j * y) ** n_steps) < 2e-4


@pytest.mark.parametrize("cycles_per_step", [0.02, 0.2, 2.0, 20.0])
@pytest.mark.parametrize("mode", [-1, 20, 5], ids=["stiffest", "middle", "softest-bending"])
def test_a_damped_step_does_to_a_vibration_what_the_stability_function_says(modes, mode, cycles_per_step):
    y, damping, n_steps = 2.0 * np.pi * cycles_per_step, 0.1, 4
    factor = oscillate("implicit-midpoint", modes, mode, y / modes[0][mode], n_steps, damping=damping)
    assert abs(factor - stability("implicit-midpoint", 1j * y, damping) ** n_steps) < 2e-4


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
