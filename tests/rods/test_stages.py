"""Time steps: first guesses, results, errors, and intervals that every robot covers in its own steps."""

import numpy as np
import pytest
from scipy.linalg import eigh

import oracle
from continuum_oracle import Continuum
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, State
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.bundles import make_work
from seastar_gym.rods.step import SCHEMES, begin_stage, end_stage, end_step, scheme_of

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
        stage = begin_stage(RODS, work, tableau, k, q, v, a, Lanes(H))
        if k < n - 1:
            end_stage(RODS, work, tableau, k, stage, a, EVERYONE)
    end_step(RODS, work, tableau, stage, q, v, a, Lanes(H), EVERYONE)
    np.testing.assert_allclose(v, v_0 + H * a_0, rtol=1e-12, atol=1e-12)
    exact = q_0 + H * v_0 + H**2 * a_0 * (1.0 if scheme == "implicit-euler" else 0.5)
    np.testing.assert_allclose(q, exact, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(a[n * SIZE : n * SIZE + n], 1.0, rtol=1e-8)


# The schemes are what their tableaux say: order, damping of oscillations, and steps that respect the ramp's corners.


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


# Corners of the ramp
