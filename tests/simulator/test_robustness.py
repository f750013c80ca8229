"""Whatever scene is accepted, its strokes end in finite, converged states, or say which robot failed, and why.

What a single module promises stands with it: failing robots in test_simulator.py, refused scenes in scene/,
failing episodes in envs/, moderate conservation and symmetry in test_swim.py. Here is what is wild.
"""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import oracle
from continuum_oracle import Continuum
from fuzz.promises import assert_told
from hubs import HUBS, TEN, robot_with
from momenta import momenta
from oracle import Star
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, SolverStatus, State, Water
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simulator.report import MEASURED_IF_ASKED
from strokes import finished, ternary

SCHEMES = ["implicit-euler", "sdirk2", "sdirk3", "implicit-midpoint"]
EPSILON = np.finfo(float).eps
EIGHT = 8
"""Robots of a test whose numbers were looked at, however many lanes a processor has."""


def rattled(simulator: Simulator, speed: float, shift: float = 0.0, seed: int = 0) -> Simulator:
    """Give every node a random velocity of about `speed` [m/s], and move it by up to `shift` edge lengths."""
    rng, state = np.random.default_rng(seed), simulator.get_state()
    shifts = shift * simulator.scene.robot.edge_length * rng.uniform(-1.0, 1.0, state.positions.shape)
    velocities = speed * rng.standard_normal(state.velocities.shape)
    simulator.set_state(State(state.positions + shifts, velocities, state.time))
    return simulator


# Any scene


def powers(smallest: float, largest: float) -> st.SearchStrategy[float]:
    """Powers of ten from 10^smallest to 10^largest."""
    return st.floats(smallest, largest).map(lambda exponent: 10.0**exponent)


@st.composite
def scenes(draw: st.DrawFn, schemes: list[str] = SCHEMES, most_limbs: int = 12, most_steps: int = 40) -> Scene:
    """Scenes far beyond those that anybody swims with, at steps from 10 microseconds to a second."""
    n_limbs, step = draw(st.integers(3, most_limbs)), draw(powers(-5.0, 0.0))
    robot = robot_with(
        draw(st.sampled_from(HUBS)),
        n_limbs=n_limbs,
        nodes_per_limb=draw(st.integers(2, most_limbs)),
        limb_length=draw(powers(-2.0, 0.0)),
        rod_radius=draw(powers(-5.0, -2.0)),
        youngs_modulus=draw(powers(2.0, 11.0)),
        density=draw(powers(2.0, 5.0)),
    )
    limit = 0.5 * (math.pi - robot.opening_angle)
    if robot.hub_hinge == "turning":
        limit = min(limit, 0.499 * robot.opening_angle)
    fluid = draw(st.none() | powers(-2.0, 4.0).map(lambda c: Water(drag_coefficient=c)))
    heating, cooling = (step * draw(st.integers(1, most_steps // 2)) for _ in range(2))
    pulse = SmaPulse(draw(st.floats(0.0, 0.999)) * limit, heating, cooling)
    most = draw(st.sampled_from([2, 5, 60]))
    return Scene(robot, fluid, pulse, Numerics(draw(st.sampled_from(schemes)), step, max_iterations=most))


@settings(derandomize=True, max_examples=150)
@given(scenes(), st.sampled_from([0.0, 0.01, 0.1, 1.0, 10.0, 100.0]), st.floats(0.0, 0.3), st.integers(0, 1000))
def test_any_scene_from_any_state_arrives_or_says_that_it_did_not(scene, speed, shift, seed):
    simulator = rattled(Simulator(scene, 4, threads=1), speed, shift, seed)
    for commands in ternary(2, 4, seed, scene.robot.n_limbs):
        report = simulator.stroke(commands)
        assert_told(simulator, report)
        assert np.isin(report.status, (SolverStatus.CONVERGED, SolverStatus.NOT_CONVERGED)).all()


HAIRS = Scene(
    Seastar(n_limbs=3, nodes_per_limb=2, limb_length=1.0, rod_radius=1e-5, density=100.0),
    Water(), SmaPulse(0.0, 1e-5, 1e-5), Numerics(step=1e-5, max_iterations=2),
)  # fmt: skip
"""Limbs of 100,000 radii, whose drag curves the potential so much that no Newton step foretells the next."""


@settings(derandomize=True, max_examples=200)
@example(HAIRS, 1.0, 24)
@given(scenes(["implicit-euler"], most_limbs=5, most_steps=4), st.sampled_from([0.01, 1.0, 30.0]), st.integers(0, 1000))
def test_no_step_that_has_not_converged_is_accepted(scene, speed, seed):
    """The oracle's Newton step from where a time step ended is about the tolerance long, see test_simulator.py."""
    simulator, robot, fluid = rattled(Simulator(scene, 2), speed, 0.1, seed), scene.robot, scene.fluid
    kind = Continuum if robot.discretisation == "continuum" else Star
    star = kind(
        robot.n_limbs, robot.nodes_per_limb, robot.limb_length, robot.rod_radius, robot.youngs_modulus, robot.density,
        drag_coefficient=0.0 if fluid is None else fluid.drag_coefficient, hub_hinge=robot.hub_hinge,
    )  # fmt: skip
    commands, before = ternary(1, 2, seed, robot.n_limbs)[0], simulator.get_state()
    stroke = simulator.stroke_in_parts(commands, 4)
    time, after = next(stroke), simulator.get_state()
    _, report = finished(stroke)
    for k in np.flatnonzero((report.halvings == 0) & (report.energy_cuts == 0) & (after.time > 0.0)):
        h, delta_psi = scene.numerics.step, commands[k] * scene.actuator.delta_psi(time)
        assert time == pytest.approx(h)
        stage = (before.positions[k], before.velocities[k], h, delta_psi)
        gradient = oracle.incremental_gradient(star, after.positions[k], *stage)
        hessian = oracle.incremental_hessian(star, after.positions[k], before.positions[k], h, delta_psi)
        move = np.linalg.norm(oracle.descent(hessian, gradient), axis=1).max()
        assert move < 100.0 * scene.numerics.newton_tolerance * robot.limb_length


# The cases that end in NaN, or are known to be hard


def opposed(n_limbs: int = 5) -> np.ndarray:
    return np.resize([1.0, -1.0], (1, n_limbs))


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(
    "robot, step, speed",
    [
        (TEN, 0.01, 0.1),
        (TEN, 0.05, 100.0),
        (Seastar(nodes_per_limb=40), 0.05, 0.0),
        (Seastar(nodes_per_limb=80), 0.05, 0.0),
        (TEN, 0.01, 0.0),
        (TEN, 0.2, 0.0),
        *((Seastar(nodes_per_limb=10, youngs_modulus=10.0**k), 0.02, 0.0) for k in range(2, 12)),
    ],
    ids=lambda value: f"{value.nodes_per_limb} nodes, {value.youngs_modulus:g} Pa" if type(value) is Seastar else None,
)
def test_hard_cases_arrive(robot, step, speed, scheme):
    simulator = rattled(Simulator(Scene(robot, numerics=Numerics(scheme, step)), 4), speed)
    for commands in ternary(3, 4):
        commands[0] = opposed()
        report = simulator.stroke(commands)
        assert not report.status.any()
        assert_told(simulator, report)


# One robot's trouble is nobody else's


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("row", [0, 91], ids=["hub", "tip"])
@pytest.mark.parametrize("where", ["q", "v"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_none_ends_its_own_robots_stroke_and_touches_no_other(scheme, row, where, value):
    """The robot is laid out at rest where its hub was, and waits for a reset."""
    n_robots, ill = N_LANES + 2, 1
    scene, others = Scene(TEN, numerics=Numerics(scheme, 0.02)), np.arange(N_LANES + 2) != 1
    well, sick = Simulator(scene, n_robots), Simulator(scene, n_robots)
    commands = ternary(3, n_robots)
    for simulator in (well, sick):
        simulator.stroke(commands[0])
    hub = sick.hub_position()[ill]
    getattr(sick, where)[0, row, ill] = value
    for command in commands[1:]:
        expected, report = well.stroke(command), sick.stroke(command)
        assert report.status[ill] == SolverStatus.NOT_FINITE
        assert np.isfinite(sick.positions).all() and np.isfinite(sick.velocities).all()
        assert sick.failed.tolist() == (~others).tolist()
        np.testing.assert_array_equal(sick.positions[ill], scene.robot.nodes() + hub)
        assert not sick.velocities[ill].any()
        np.testing.assert_array_equal(sick.positions[others], well.positions[others])
        np.testing.assert_array_equal(sick.velocities[others], well.velocities[others])
        for name, found, wanted in zip(report._fields, report, expected, strict=True):
            assert np.isfinite(found).all() or name in MEASURED_IF_ASKED
            np.testing.assert_array_equal(found[others], wanted[others])
    sick.reset(sick.failed)
    assert not sick.stroke(commands[0]).status.any()


# What stays, stays in trouble too


def kept(simulator: Simulator) -> tuple[np.ndarray, np.ndarray]:
    """Linear [kg m/s] and angular momentum about the origin [kg m^2/s] of every robot."""
    return momenta(make_rods(simulator.scene), simulator.positions, simulator.velocities)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_linear_momentum_stays_to_rounding_whatever_a_step_needs(scheme):
    """Velocities are differences of positions over h, so rounding is that of positions, over h."""
    needed, cuts = 0, 0
    for step in (1e-3, 1e-2, 5e-2):
        for speed in (1.0, 10.0, 100.0):
            simulator = rattled(Simulator(Scene(TEN, fluid=None, numerics=Numerics(scheme, step)), 8), speed)
            before, _ = kept(simulator)
            report = simulator.stroke(np.zeros((8, 5)))
            after, _ = kept(simulator)
            needed, cuts = needed + report.halvings.sum(), cuts + report.energy_cuts.sum()
            size = make_rods(simulator.scene).mass.sum() * speed
            np.testing.assert_allclose(after, before, rtol=0.0, atol=1e-11 * size)
    assert needed > 100 and cuts > 3


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("nodes_per_limb", [2, 10, 58])
def test_linear_momentum_stays_to_rounding_at_any_tolerance_and_stiffness(scheme, nodes_per_limb):
    """Where edges are 1e16 times as stiff as inertia, elimination leaves nothing of that, see der/momentum.py."""
    for n_limbs, modulus, tolerance in ((3, 1e11, 1e-8), (5, 1e11, 5e-4), (12, 1e9, 5e-4)):
        robot = Seastar(n_limbs, nodes_per_limb, limb_length=3e-3, rod_radius=1e-4, youngs_modulus=modulus)
        numerics = Numerics(scheme, 0.27, newton_tolerance=tolerance)
        simulator = rattled(Simulator(Scene(robot, None, SmaPulse(0.2, 0.54, 0.54), numerics), 4), 0.1, 0.1)
        before, _ = kept(simulator)
        report = simulator.stroke(ternary(1, 4, n_limbs=n_limbs)[0])
        arrived = report.status == SolverStatus.CONVERGED
        after, _ = kept(simulator)
        size = 0.1 * make_rods(simulator.scene).mass.sum()
        np.testing.assert_allclose(after[arrived], before[arrived], rtol=0.0, atol=1e-11 * size)


def test_implicit_midpoint_keeps_angular_momentum_where_steps_are_halved_and_velocities_cut():
    """No other scheme does, see test_swim.py, nor do steps that were halved so often that implicit Euler made them."""
    numerics = Numerics("implicit-midpoint", 1e-3, newton_tolerance=1e-12)
    simulator = rattled(Simulator(Scene(TEN, fluid=None, numerics=numerics), 8), 1.0)
    _, before = kept(simulator)
    report = simulator.stroke(np.zeros((8, 5)))
    _, after = kept(simulator)
    assert report.halvings.sum() > 10 and report.energy_cuts.sum() > 10
    np.testing.assert_allclose(after, before, rtol=1e-10)


SYMMETRY_ROUNDING = 1e4 * EPSILON * 0.1
"""Positions [m] after 50 strokes, at steps of 5 ms and more: 10,000 units in the last place of a limb's length."""


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("step", [0.005, 0.05])
def test_50_strokes_turn_and_mirror_with_their_commands_to_a_multiple_of_rounding(scheme, step):
    """Robots whose limbs buckle either way by rounding, at far too long steps, part from nudged twins, too.

    Not from every one: a nudge may be to the side they take anyway, so there are four. At 50 ms they find two robots.
    """
    scene, mirror = Scene(TEN, numerics=Numerics(scheme, step)), [0, 4, 3, 2, 1]
    robots = [Simulator(scene, EIGHT) for _ in range(7)]
    at_rest, rng = robots[0].get_state(), np.random.default_rng(0)
    for twin in robots[3:]:
        nudge = 1e-16 * rng.standard_normal(at_rest.positions.shape)
        twin.set_state(at_rest._replace(positions=at_rest.positions + nudge))
    for commands in ternary(50, EIGHT):
        carried = commands, np.roll(commands, 1, axis=1), -commands[:, mirror], *[commands] * 4
        for simulator, command in zip(robots, carried, strict=True):
            assert not simulator.stroke(command).status.any()
    parted = [np.abs(twin.positions - robots[0].positions).max(axis=(1, 2)) for twin in robots[3:]]
    steady = np.max(parted, axis=0) < SYMMETRY_ROUNDING
    assert steady.sum() >= EIGHT - 2
    hub, limbs = robots[0].positions[:, :1], robots[0].positions[:, 1:].reshape(EIGHT, 5, 9, 2)
    c, s = math.cos(0.4 * math.pi), math.sin(0.4 * math.pi)
    turned = np.concatenate([hub, np.roll(limbs, 1, axis=1).reshape(EIGHT, -1, 2)], axis=1) @ [[c, s], [-s, c]]
    mirrored = np.concatenate([hub, limbs[:, mirror].reshape(EIGHT, -1, 2)], axis=1) * [1.0, -1.0]
    assert np.abs(hub).max() > 0.01
    for found, expected in ((robots[1].positions, turned), (robots[2].positions, mirrored)):
        np.testing.assert_allclose(found[steady], expected[steady], rtol=0.0, atol=SYMMETRY_ROUNDING)


# Energy without commands


def energies(numerics: Numerics, fluid: Water | None, speed: float, n_steps: int = 60) -> np.ndarray:
    """Energies of eight rattled robots after every step, over the first, shape (n_steps + 1, 8)."""
    half = 0.5 * n_steps * numerics.step
    simulator = rattled(Simulator(Scene(TEN, fluid, SmaPulse(0.0, half, half), numerics), 8), speed)
    found = [simulator.elastic_energy() + simulator.kinetic_energy()]
    for _ in simulator.stroke_in_parts(np.zeros((8, 5)), n_steps):
        found.append(simulator.elastic_energy() + simulator.kinetic_energy())
    assert not simulator.failed.any()
    return np.array(found) / found[0]


def test_random_strokes_keep_strains_and_speeds_small():
    """What is left of the motion at the ends of strokes does not grow."""
    scene = Scene(Seastar(nodes_per_limb=10), numerics=Numerics.preset("fast"))
    simulator = Simulator(scene, 16, threads=1)
    for commands in ternary(20, 16):
        simulator.stroke(commands)
        limbs = simulator.positions[:, 1:].reshape(16, 5, -1, 2)
        strains = np.linalg.norm(np.diff(limbs, axis=2), axis=-1) / scene.robot.edge_length - 1.0
        assert np.abs(strains).max() < 0.05 and 0.0 < np.abs(simulator.velocities).max() < 1.0
    assert not simulator.failed.any()


FLUIDS = pytest.mark.parametrize("fluid", [None, Water()], ids=["vacuum", "water"])
WILD_STEPS = (1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)
WILD_SPEEDS = (0.1, 1.0, 10.0, 100.0)


@FLUIDS
def test_energy_of_implicit_euler_grows_in_no_step(fluid):
    for step in WILD_STEPS:
        for speed in WILD_SPEEDS:
            energy = energies(Numerics("implicit-euler", step), fluid, speed)
            assert np.all(np.diff(energy, axis=0) <= 1e-11 * energy[:-1]), (step, speed)


@FLUIDS
@pytest.mark.parametrize("scheme", ["sdirk2", "sdirk3"])
def test_energy_of_sdirk_grows_in_no_step_in_water_and_by_a_quarter_at_most_in_vacuum(scheme, fluid):
    for step in WILD_STEPS:
        for speed in WILD_SPEEDS:
            energy = energies(Numerics(scheme, step), fluid, speed)
            if fluid is not None:
                assert np.all(np.diff(energy, axis=0) <= 1e-11 * energy[:-1]), (step, speed)
            assert energy.max() <= 1.25, (step, speed)


def test_energy_of_implicit_midpoint_has_a_bound_in_water_at_the_steps_of_its_fidelities_only():
    """It keeps the energy of small oscillations; a step far longer than those may store more than there was."""
    for fidelity in ("balanced", "accurate", "reference"):
        for speed in WILD_SPEEDS:
            assert energies(Numerics.preset(fidelity), Water(), speed).max() <= 1.001, (fidelity, speed)
    assert energies(Numerics("implicit-midpoint", 1.0), None, 0.1).max() > 10.0
