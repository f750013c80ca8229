"""Time steps: first guesses, results, errors, and intervals that every robot covers in its own steps."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh

import oracle
from continuum_oracle import Continuum
from oracle import Star
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, State
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.bundles import Rods, make_work
from seastar_gym.rods.newton import minimise
from seastar_gym.rods.step import SCHEMES, begin_stage, end_stage, end_step, scheme_of
from slopes import nodes, plain
from stages import EVERYONE, RandomStages, robot_and_star, rods_of

ROBOT = Seastar(5, 3)
SCENE = Scene(ROBOT, actuator=SmaPulse(0.3))
RODS, SIZE = make_rods(SCENE), 2 * ROBOT.n_nodes
RNG = np.random.default_rng(0)
H = 0.01


@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_scheme_is_exact_for_nodes_that_fall(scheme):
    """With constant accelerations in memory the first guess is the parabola, and so is the step's result."""
    tableau, work = SCHEMES[scheme], make_work(RODS, SCHEMES[scheme].n_stages)
    q_0, v_0, a_0 = RNG.standard_normal((3, SIZE, N_LANES))
    q, v, n = q_0.copy(), v_0.copy(), tableau.n_stages
    a = np.concatenate([np.tile(a_0, (n, 1)), np.ones((n, N_LANES))])
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


# Newton's method: it ends where the potential is least, and leaves alone whom it was not asked for


OF_FIVE, STAR = robot_and_star(5, 4)
FOUR_NODES = rods_of(OF_FIVE)
MILD, WILD = {"gamma": 5e-3, "bend": 0.05, "speed": 0.05}, {"gamma": 0.05, "bend": 0.5, "speed": 1.0}


def minimised(active=EVERYONE, tolerance=1e-13, limit=500.0, rods: Rods = FOUR_NODES, star: Star = STAR, **size):
    stages = RandomStages(star, **size)
    stages.frozen = stages.q
    work, stage = stages.begin(rods)
    found = minimise(rods, work, stage, active, Lanes(tolerance), Lanes(limit))
    converged, phi, iterations, regularised, backtracks = plain(found)
    return SimpleNamespace(
        stages=stages, q=nodes(work.q), converged=converged, phi=phi, iterations=iterations,
        helped=regularised + backtracks,
    )  # fmt: skip


@pytest.mark.parametrize("size", [MILD, WILD], ids=["mild", "wild"])
def test_it_ends_at_a_minimum_of_the_oracles_potential(size):
    """Wild robots are helped by convex matrices or shorter steps."""
    found = minimised(**size)
    assert found.converged.all() and np.all((found.helped > 0.0) == (size is WILD))
    for lane in range(N_LANES):
        q_hat, v_hat, gamma, delta_psi, _ = found.stages.data(lane)
        residual, before = (
            oracle.incremental_gradient(STAR, q, q_hat, v_hat, gamma, delta_psi)
            for q in (found.q[lane], found.stages.q[lane])
        )
        assert np.abs(residual).max() < 1e-9 * np.abs(before).max()
        assert np.linalg.eigvalsh(oracle.incremental_hessian(STAR, found.q[lane], q_hat, gamma, delta_psi))[0] > 0.0


def test_robots_that_are_not_active_keep_their_bits_and_cost_no_iteration():
    active = np.arange(N_LANES) % 2 == 0
    found, all_of_them = minimised(Mask(active), **MILD), minimised(**MILD)
    np.testing.assert_array_equal(found.q[active], all_of_them.q[active])
    np.testing.assert_array_equal(found.q[~active], found.stages.q[~active])
    assert not found.iterations[~active].any() and not found.converged[~active].any()


@pytest.mark.parametrize("lane", [0, N_LANES - 1])
def test_a_robot_whose_state_is_not_a_number_does_not_converge_and_stops_nobody(lane):
    stages = RandomStages(STAR, **MILD)
    work, stage = stages.begin(FOUR_NODES)
    work.q[5, lane] = np.nan
    converged = plain(minimise(FOUR_NODES, work, stage, EVERYONE, Lanes(1e-10), Lanes(60.0))[0])
    np.testing.assert_array_equal(converged, np.arange(N_LANES) != lane)


# The last step is left out where it can be foreseen to be small enough


@pytest.mark.parametrize("tolerance", [1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("radius", [1e-4, 1.6e-3, 8e-3], ids=["slender", "ordinary", "thick"])
@pytest.mark.parametrize("gamma", [1e-4, 5e-3])
def test_robots_end_as_near_to_the_minimum_as_asked_though_a_step_is_left_out(radius, gamma, tolerance):
    star = Continuum(5, 4, rod_radius=radius)
    rods, size = make_rods(Scene(Seastar(5, 4, rod_radius=radius))), {"gamma": gamma, "bend": 0.01, "stretch": 1e-4}
    loose, tight = (minimised(tolerance=x, rods=rods, star=star, speed=0.01, **size) for x in (tolerance, 1e-14))
    assert np.all(loose.iterations < tight.iterations + (tolerance < 1e-6))
    assert np.linalg.norm(loose.q - tight.q, axis=2).max() < tolerance
