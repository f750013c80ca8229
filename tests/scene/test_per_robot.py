"""Robots of a batch with numbers of their own swim, to the last bit, as each would alone."""

import pickle

import numpy as np
import pytest

from seastar_gym import (
    AlongLimb,
    Body,
    Contact,
    Limb,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    Stiffening,
    ThermalSma,
    Water,
)
from seastar_gym.lanes.registers import N_LANES
from strokes import assert_same_bits

N_ROBOTS = N_LANES + 3
FAST = Numerics("sdirk2", 20e-3)


def varied() -> Scene:
    """Every number that the default terms have differs from robot to robot."""
    spread = np.linspace(0.7, 1.4, N_ROBOTS)
    moduli = np.geomspace(3e5, 3e6, N_ROBOTS)
    robot = Seastar(rod_radius=1.6e-3 * spread, youngs_modulus=moduli, density=1000.0 * spread[::-1])
    return Scene(robot, Water(1000.0 * spread, spread**2), numerics=FAST)


def strokes(simulator: Simulator, commands: np.ndarray) -> np.ndarray:
    for command in commands:
        simulator.stroke(command)
    return simulator.positions


COMMANDS = np.random.default_rng(0).uniform(-1.0, 1.0, (2, N_ROBOTS, 5))


SPREAD = np.linspace(0.7, 1.2, N_ROBOTS)
LENGTHS = Seastar(limb_length=0.1 * SPREAD)
THERMAL = ThermalSma(0.6 * SPREAD, 0.1, 0.9, 0.4 * SPREAD, 220.0 / SPREAD, 15.0 * SPREAD, 24.0 * SPREAD, 70.0 * SPREAD,
                     56.0 * SPREAD, 21.0 * SPREAD)  # fmt: skip
UNEVEN = Seastar(3, 10, 0.1 * SPREAD, limbs=(
    Limb(length=0.12 * SPREAD[::-1], radius=1.6e-3 * SPREAD), Limb(natural_curvature=3.0 * (SPREAD - 1.0)),
    Limb(radius=(2e-3, 1e-3), youngs_modulus=1e6 * SPREAD**2),
))  # fmt: skip


ALONG = Seastar(3, 5, along=AlongLimb(np.linspace(0.2, 1.0, N_ROBOTS)), stiffening=Stiffening(1.0 + SPREAD))
ON_BODY = Seastar(4, 5, body=Body.rectangle(0.06, 0.03, mass=0.03 * SPREAD))
SCENES = {
    "numbers": varied(),
    "pulse": Scene(LENGTHS, actuator=SmaPulse(0.5 * SPREAD), numerics=FAST),
    "thermal": Scene(LENGTHS, actuator=THERMAL, numerics=FAST),
    "limbs": Scene(UNEVEN, actuator=SmaPulse(0.3), numerics=FAST),
    "contact": Scene(contact=Contact(np.geomspace(1e4, 1e6, N_ROBOTS)), numerics=Numerics.preset("fast")),
    "bodies": Scene(ON_BODY, actuator=SmaPulse(0.5 * SPREAD), numerics=FAST),
    "along": Scene(ALONG, actuator=SmaPulse(0.6)),
    "tolerances of their own size": Scene(LENGTHS, numerics=Numerics("implicit-midpoint", 10e-3, 1e-4)),
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
OTHER_SIZES = Scene(Seastar(limb_length=0.1 * SPREAD[::-1]), actuator=SmaPulse(0.5 * SPREAD), numerics=FAST)
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
