"""Robots of a batch with numbers of their own swim, to the last bit, as each would alone."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import (
    AlongLimb,
    Body,
    Contact,
    Limb,
    Limited,
    MeasuredCurve,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    Stiffening,
    ThermalSma,
    Water,
)
from seastar_gym.simd.lanes import N_LANES
from strokes import assert_same_bits

N_ROBOTS = N_LANES + 3
FAST = Numerics("sdirk2", 20e-3)
MODULI = tuple(np.geomspace(3e5, 3e6, N_ROBOTS).tolist())


def varied() -> Scene:
    """Every number that the default terms have differs from robot to robot."""
    spread = np.linspace(0.7, 1.4, N_ROBOTS)
    return Scene(Seastar(rod_radius=1.6e-3 * spread, youngs_modulus=np.array(MODULI), density=1000.0 * spread[::-1]),
                 Water(1000.0 * spread, spread**2), numerics=FAST)  # fmt: skip


def strokes(simulator: Simulator, commands: np.ndarray) -> np.ndarray:
    for command in commands:
        simulator.stroke(command)
    return simulator.positions


COMMANDS = np.random.default_rng(0).uniform(-1.0, 1.0, (2, N_ROBOTS, 5))


SPREAD = np.linspace(0.7, 1.2, N_ROBOTS)
LENGTHS = Seastar(limb_length=0.1 * SPREAD)
THERMAL = ThermalSma(0.6 * SPREAD, 0.1, 0.9, 0.4 * SPREAD, 220.0 / SPREAD, 15.0 * SPREAD, 24.0 * SPREAD, 70.0 * SPREAD,
                     56.0 * SPREAD, 21.0 * SPREAD)  # fmt: skip
ACTUATORS = {
    "pulse": SmaPulse(0.5 * SPREAD),
    "measured": MeasuredCurve((0.0, 0.1, 0.3, 1.0), (0.0, 0.5, 0.4, 0.0), 1.2 * SPREAD),
    "limited": Limited(SmaPulse(0.5 * SPREAD), 0.5 * SPREAD[::-1], 3.0 * SPREAD**2),
    "thermal": THERMAL,
}


UNEVEN = Seastar(3, 10, 0.1 * SPREAD, limbs=(
    Limb(length=0.12 * SPREAD[::-1], radius=1.6e-3 * SPREAD), Limb(natural_curvature=3.0 * (SPREAD - 1.0)),
    Limb(radius=(2e-3, 1e-3), youngs_modulus=1e6 * SPREAD**2),
))  # fmt: skip


ALONG = Seastar(3, 5, along=AlongLimb(np.linspace(0.2, 1.0, N_ROBOTS)), stiffening=Stiffening(1.0 + SPREAD))
SCENES = {
    "numbers": varied(),
    **{name: Scene(LENGTHS, actuator=actuator, numerics=FAST) for name, actuator in ACTUATORS.items()},
    "limbs": Scene(UNEVEN, actuator=SmaPulse(0.3), numerics=FAST),
    "contact": Scene(contact=Contact(np.geomspace(1e4, 1e6, N_ROBOTS)), numerics=Numerics.preset("fast")),
    "bodies": Scene(Seastar(4, 5, body=Body.rectangle(0.06, 0.03, mass=0.03 * SPREAD)), numerics=FAST),
    "along": Scene(ALONG, actuator=SmaPulse(0.6)),
    "tolerances of their own size": Scene(LENGTHS, numerics=Numerics("implicit-midpoint", 10e-3, path_tolerance=0.02)),
}


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name == "along")) for name in SCENES])
def test_every_robot_swims_as_it_would_alone(name):
    scene = SCENES[name]
    batch, commands = Simulator(scene, N_ROBOTS, threads=2), COMMANDS[..., : scene.robot.n_limbs].copy()
    if name == "contact":
        commands[:] = [1.0, -1.0, 0.0, 1.0, -1.0]  # neighbours meet
    positions = strokes(batch, commands)
    assert len({tuple(hub) for hub in positions[:, 0]}) == N_ROBOTS
    for robot in range(0, N_ROBOTS, 1 if name == "numbers" else 3):
        alone = Simulator(scene.of_robot(robot))
        np.testing.assert_array_equal(strokes(alone, commands[:, robot : robot + 1])[0], positions[robot])
        assert_same_bits(alone.get_state(), batch.get_state().of_robots(slice(robot, robot + 1)))
        np.testing.assert_array_equal(alone.observe_actuators()[0], batch.observe_actuators()[robot])
        assert alone.elastic_energy()[0] == batch.elastic_energy()[robot]


def test_robots_rest_in_shapes_and_at_temperatures_of_their_own():
    simulator = Simulator(Scene(LENGTHS, actuator=THERMAL, numerics=FAST), N_ROBOTS)
    np.testing.assert_allclose(simulator.positions, SPREAD[:, None, None] * Seastar().nodes(), rtol=0.0, atol=1e-16)
    np.testing.assert_allclose(LENGTHS.edge_length, SPREAD * Seastar().edge_length)
    strokes(simulator, COMMANDS[:1])
    simulator.reset(SPREAD > 1.0)
    np.testing.assert_array_equal(simulator.positions[SPREAD > 1.0][0], LENGTHS.nodes(int(np.argmax(SPREAD > 1.0))))
    simulator.reset()
    np.testing.assert_array_equal(simulator.actuators[:, 0, 0], 15.0 * SPREAD)
    assert not simulator.observe_actuators().any()
    uneven = Simulator(Scene(UNEVEN, actuator=SmaPulse(0.3), numerics=FAST), N_ROBOTS).positions
    np.testing.assert_allclose(uneven[:, 9, 0], 0.12 * SPREAD[::-1], rtol=1e-12)
    for robot in (0, N_ROBOTS - 1):
        np.testing.assert_array_equal(uneven[robot], UNEVEN.nodes(robot))


def test_only_equal_limbs_are_symmetric():
    assert LENGTHS.is_symmetric and not replace(LENGTHS, limbs=(Limb(length=0.07), *[Limb()] * 4)).is_symmetric
    swapped = (Limb(length=0.1 * SPREAD), Limb(length=0.1 * SPREAD[::-1]), Limb(length=0.1 * SPREAD))
    assert not Seastar(3, limbs=swapped).is_symmetric and Seastar(3, limbs=swapped[:1] * 3).is_symmetric


def of_moduli(moduli) -> Scene:
    return Scene(Seastar(youngs_modulus=moduli), numerics=FAST)


def changed(before: Scene, after: Scene) -> Simulator:
    """A simulator that swam before it was given another scene."""
    simulator = Simulator(before, N_ROBOTS)
    strokes(simulator, COMMANDS[:1])
    simulator.set_scene(after)
    simulator.reset()
    return simulator


def changed_by_masks() -> Simulator:
    simulator, mask = Simulator(varied(), N_ROBOTS), np.arange(N_ROBOTS) % 3 == 1
    for some in (mask, ~mask):
        simulator.set_scene(of_moduli(np.where(some, 5e5, 9.0e9) if some is mask else np.full(N_ROBOTS, 7e5)), some)
    return simulator


MASKED = of_moduli(np.where(np.arange(N_ROBOTS) % 3 == 1, 5e5, 7e5))
OTHER_SIZES = Scene(Seastar(limb_length=0.1 * SPREAD[::-1]), actuator=ACTUATORS["pulse"], numerics=FAST)
SAME = {
    "other sizes and actuators": (lambda: changed(SCENES["pulse"], OTHER_SIZES), OTHER_SIZES),
    "one scene for all": (lambda: changed(SCENES["pulse"], Scene(numerics=FAST)), Scene(numerics=FAST)),
    "robots in a mask": (changed_by_masks, MASKED),
    "equal robots": (lambda: Simulator(of_moduli(np.full(N_ROBOTS, 1e6)), N_ROBOTS), Scene(numerics=FAST)),
    "a copy": (lambda: pickle.loads(pickle.dumps(Simulator(varied(), N_ROBOTS))), varied()),
}


@pytest.mark.parametrize("make, scene", SAME.values(), ids=SAME)
def test_a_simulator_has_the_bits_of_its_scene_however_it_came_to_it(make, scene):
    np.testing.assert_array_equal(strokes(make(), COMMANDS), strokes(Simulator(scene, N_ROBOTS), COMMANDS))


def test_a_scene_knows_its_robots():
    scene, tapered = varied(), Scene(Seastar(limbs=(Limb(radius=(2e-3, 1e-3)),) * 5))
    assert scene.n_robots == N_ROBOTS and Scene().n_robots is tapered.n_robots is None
    assert scene.of_robot(2).robot.youngs_modulus == MODULI[2] and scene.of_robot(2).n_robots is None
    assert scene.robot.youngs_modulus == MODULI and len(tapered.robot.limbs[0].radius) == 2
