"""What mechanics keeps: momentum, angular momentum and energy, moderately moved and wildly, whatever a step needs."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from hubs import HUBS, TEN, robot_with
from momenta import bodied_momenta, momenta
from seastar_gym import (
    Attachment,
    Body,
    Contact,
    Limb,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    SolverStatus,
    State,
    UniformCurrent,
    Water,
)
from seastar_gym.model import make_rods
from seastar_gym.rods.step import SCHEMES
from strokes import ternary

LOPSIDED = Seastar(3, 5, body=Body(
    outline=((0.03, -0.01), (0.02, 0.02), (-0.02, 0.015), (-0.025, -0.02)), mass=4e-3, centre_of_mass=(4e-3, -3e-3),
    attachments=(Attachment(0.03, 0.005, 0.3), Attachment(-0.01, 0.018, 1.4), Attachment(-0.02, -0.01, 3.6)),
))  # fmt: skip
"""Neither its body's centre of mass nor that of its limbs is the hub."""
CURLED = Seastar(2, 7, 0.06, limbs=(Limb(natural_curvature=50.0),) * 2, body=Body.rectangle(
    0.06, 0.03, attachments=(Attachment(0.03, 0.0, 0.6), Attachment(-0.03, 0.0, 0.6 + math.pi))
))  # fmt: skip
"""Limbs around a plate, at some distance; + turns them onto it."""


def rattled(simulator: Simulator, speed: float, shift: float = 0.0, bend: float = 0.0, seed: int = 0) -> Simulator:
    """Random velocities of about `speed` [m/s]; nodes moved by up to `shift` edges, or edges turned by `bend` [rad]."""
    rng, state, robot = np.random.default_rng(seed), simulator.get_state(), simulator.scene.robot
    shape = (simulator.n_robots, robot.n_limbs, robot.nodes_per_limb - 1)
    if bend:
        angles = np.arange(robot.n_limbs)[:, None] * robot.opening_angle + bend * rng.standard_normal(shape)
        edges = robot.edge_length * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        state.positions[:, 1:] = np.cumsum(edges, axis=2).reshape(simulator.n_robots, -1, 2)
    shifts = shift * robot.edge_length * rng.uniform(-1.0, 1.0, state.positions.shape)
    velocities = speed * rng.standard_normal(state.velocities.shape)
    simulator.set_state(State(state.positions + shifts, velocities, state.time))
    return simulator


def thrown(simulator: Simulator) -> Simulator:
    """A robot that moves and turns as a rigid one."""
    q = simulator.positions
    v = np.array([0.05, -0.02]) + 3.0 * np.stack([-q[..., 1], q[..., 0]], axis=-1)
    simulator.set_state(simulator.get_state()._replace(velocities=v, spin=np.full(len(q), 3.0)))
    return simulator


def kept(simulator: Simulator) -> tuple[np.ndarray, np.ndarray]:
    """Linear [kg m/s] and angular momentum about the origin [kg m^2/s] of every robot."""
    if simulator.scene.robot.has_body:
        linear, spin = bodied_momenta(simulator)
        return linear[None], np.array([spin])
    return momenta(make_rods(simulator.scene), simulator.positions, simulator.velocities)


# Momentum


def swims() -> Iterator[Any]:
    """Scene, number of robots, how they begin, and intervals [s] with the commands given in each."""

    def case(name, scene, n_robots, begin, *intervals, slow=False):
        return pytest.param(scene, n_robots, begin, intervals, id=name, marks=[pytest.mark.slow] * slow)

    strokes = [(1.0, np.tile([0.0, 1.0, 0.0, 0.0, -0.5], (8, 1)))] * 3
    bending, closing = np.array([[1.0, -0.5, 0.3]]), np.array([[1.0, -1.0, 0.0, 0.0, 0.0]])
    for scheme in SCHEMES:
        loose = Numerics(scheme, 0.01, newton_tolerance=1e-5)
        for hub in HUBS:
            scene = Scene(robot_with(hub), None, numerics=loose)
            yield case(f"{scheme}, {hub}", scene, 8, lambda simulator: rattled(simulator, 0.05), *strokes)
        # Where edges are 1e16 times as stiff as inertia, elimination leaves nothing of that, see rods/guard.py.
        for nodes in (2, 10, 58):
            for n_limbs, modulus, tolerance in ((3, 1e11, 1e-8), (5, 1e11, 5e-4), (12, 1e9, 5e-4)):
                robot = Seastar(n_limbs, nodes, limb_length=3e-3, rod_radius=1e-4, youngs_modulus=modulus)
                scene = Scene(robot, None, SmaPulse(0.2, 0.54, 0.54), Numerics(scheme, 0.27, tolerance))
                yield case(
                    f"{scheme}, stiff, {nodes} nodes, {n_limbs} limbs", scene, 4,
                    lambda simulator: rattled(simulator, 0.1, 0.1), (1.08, ternary(1, 4, n_limbs=n_limbs)[0]),
                )  # fmt: skip
        scene = Scene(TEN, fluid=None, numerics=Numerics(scheme, 2e-3, newton_tolerance=1e-10), contact=Contact())
        yield case(f"{scheme}, touching", scene, 1, lambda simulator: simulator, (0.05, closing), *[(0.05, None)] * 19)
    for scheme, damping in [*product(SCHEMES, [0.0]), ("implicit-midpoint", 0.003), ("implicit-midpoint", 0.5)]:
        for h, tolerance in product((0.05, 8e-3, 1e-3), (1e-4, 1e-10)):
            scene = Scene(LOPSIDED, None, SmaPulse(0.5), Numerics(scheme, h, tolerance, damping=damping))
            name = f"{scheme}, {damping}, body, {h} s, {tolerance}"
            yield case(name, scene, 1, thrown, (0.1, bending), (0.033, None), (0.4, None))
        scene = replace(scene, numerics=Numerics(scheme, 4e-3, 1e-10, damping=damping), gravity=(0.3, -0.5))
        yield case(f"{scheme}, {damping}, body, weight", scene, 1, thrown, (0.3, bending))
    scene = Scene(CURLED, None, SmaPulse(0.8), Numerics("implicit-midpoint", 4e-3, 1e-9), contact=Contact())
    pressed = (0.02, np.ones((1, 2))), *[(0.02, None)] * 49
    yield case("touching a body", scene, 1, lambda simulator: simulator, *pressed, slow=True)


@pytest.mark.parametrize("scene, n_robots, begin, intervals", [*swims()])
def test_linear_momentum_is_what_weight_makes_of_it_to_rounding(scene, n_robots, begin, intervals):
    """In vacuum, even at a loose tolerance: every Newton step solves a linear equation to the last bit."""
    simulator = begin(Simulator(scene, n_robots))
    (before, _), fastest = kept(simulator), np.abs(simulator.velocities).max()
    weight = simulator.coefficients.rods(0).inertia.node.sum() * np.array(scene.gravity or (0.0, 0.0))
    for duration, commands in intervals:
        report = simulator.advance(duration, commands)
        arrived, fastest = report.status == SolverStatus.CONVERGED, max(fastest, np.abs(simulator.velocities).max())
        share = 1e-10 if weight.any() or (scene.contact and scene.robot.has_body) else 1e-11 * fastest
        rounding = share * simulator.coefficients.rods(0).inertia.node.sum()
        expected = before + weight * simulator.time[0]
        np.testing.assert_allclose(kept(simulator)[0][arrived], expected[arrived], rtol=0.0, atol=rounding)


@pytest.mark.parametrize("hub", HUBS[:2])
def test_implicit_midpoint_keeps_angular_momentum_and_no_other_scheme_does(hub):
    """Its stages are symplectic, so they keep quadratic invariants; actuators turn limbs against each other only."""
    change = {}
    for scheme in SCHEMES:
        scene = Scene(robot_with(hub), None, numerics=Numerics(scheme, 5e-3, newton_tolerance=1e-12))
        simulator = rattled(Simulator(scene, 8), 0.05)
        _, before = kept(simulator)
        assert not simulator.stroke(np.tile([0.0, 1.0, 0.0, 0.0, -0.5], (8, 1))).status.any()
        change[scheme] = np.abs(kept(simulator)[1] - before).max() / np.abs(before).max()
    assert change.pop("implicit-midpoint") < 1e-8
    assert min(change.values()) > 1e-3


def test_implicit_midpoint_keeps_angular_momentum_where_steps_are_halved_and_velocities_cut():
    """But not where steps were halved so often that implicit Euler made them."""
    numerics = Numerics("implicit-midpoint", 1e-3, newton_tolerance=1e-12)
    simulator = rattled(Simulator(Scene(TEN, fluid=None, numerics=numerics), 8), 1.0)
    _, before = kept(simulator)
    report = simulator.stroke(np.zeros((8, 5)))
    assert report.halvings.sum() > 10 and report.energy_cuts.sum() > 10
    np.testing.assert_allclose(kept(simulator)[1], before, rtol=1e-10)


@pytest.mark.parametrize("scheme, order", [("implicit-midpoint", 2), ("implicit-euler", 1), ("sdirk2", 2)])
def test_a_robot_with_a_lopsided_body_keeps_the_order_of_its_scheme(scheme, order):
    """Angles and angular momentum, too, as steps get shorter; stiff edges ring, so limbs are soft."""
    ends = []
    for h in (2e-3, 1e-3, 2.5e-4):
        simulator = thrown(Simulator(Scene(LOPSIDED, None, SmaPulse(0.5), Numerics(scheme, h, 1e-10))))
        _, spin = kept(simulator)
        simulator.advance(0.1, [[0.5, -0.3, 0.2]])
        ends.append(np.array([*simulator.hub_position()[0], simulator.orientation()[0], *kept(simulator)[1] / spin]))
    far, near = (np.abs(end[:3] - ends[-1][:3]) for end in ends[:-1])
    assert np.linalg.norm(far) > 0.8 * 2**order * np.linalg.norm(near)
    assert abs(ends[-1][3] - 1.0) < {1: 2e-2}.get(order, 1e-4)


# Energy without commands

WILD_STEPS = (1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)
WILD_SPEEDS = (0.1, 1.0, 10.0, 100.0)
DAMPED = Seastar(relaxation_time=1e-4)
NO_WATER = Water(0.0, 1.0, 1.0, UniformCurrent(), 1.0)
WILD, MILD = [*product(WILD_STEPS, WILD_SPEEDS)], [(0.01, 0.05)]
FALLING = {
    **{f"{scheme}, {fluid}": (scheme, TEN, fluid, WILD) for scheme, fluid in (
        ("implicit-euler", None), ("implicit-euler", Water()), ("sdirk2", Water())
    )},
    **{f"{hub}, {fluid}": ("implicit-euler", robot_with(hub), fluid, MILD)
       for hub, fluid in product(HUBS[1:], (None, Water()))},
    "damped": ("implicit-euler", DAMPED, NO_WATER, [(2e-3, 0.2)]),
    "implicit-midpoint, water": ("implicit-midpoint", TEN, Water(), [(1e-3, 0.05)]),
}  # fmt: skip


def energies(numerics: Numerics, fluid: Water | None, robot: Seastar = TEN, n_steps: int = 60, **rattle) -> np.ndarray:
    """Energies of eight rattled robots after every step, over the first, shape (n_steps + 1, 8)."""
    half = 0.5 * n_steps * numerics.step
    simulator = rattled(Simulator(Scene(robot, fluid, SmaPulse(0.0, half, half), numerics), 8), **rattle)
    found = [simulator.elastic_energy() + simulator.kinetic_energy()]
    for _ in simulator.stroke_in_parts(np.zeros((8, 5)), n_steps):
        found.append(simulator.elastic_energy() + simulator.kinetic_energy())
    assert not simulator.failed.any()
    return np.array(found) / found[0]


@pytest.mark.parametrize("scheme, robot, fluid, runs", FALLING.values(), ids=FALLING)
def test_energy_grows_in_no_step(scheme, robot, fluid, runs):
    for step, speed in runs:
        energy = energies(Numerics(scheme, step), fluid, robot, speed=speed, bend=0.05 if len(runs) == 1 else 0.0)
        assert np.all(np.diff(energy, axis=0) <= 1e-11 * energy[:-1]), (step, speed)
        assert np.all(energy[-1] < (0.9 if len(runs) == 1 else 1.0)), (step, speed)


def test_sdirk_in_vacuum_and_implicit_midpoint_in_water_have_a_bound_of_energy():
    """The midpoint rule at the steps of its fidelities only: a far longer one may store more than there was."""
    for step, speed in WILD:
        assert energies(Numerics("sdirk2", step), None, speed=speed).max() <= 1.25, (step, speed)
    for fidelity, speed in product(("balanced", "accurate", "reference"), WILD_SPEEDS):
        assert energies(Numerics.preset(fidelity), Water(), speed=speed).max() <= 1.001, (fidelity, speed)
    assert energies(Numerics("implicit-midpoint", 1.0), None, speed=0.1).max() > 10.0
