"""A simulator has the bits of its robots' numbers however it came to them; that each swims as alone: tests/fuzz."""

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, Water
from seastar_gym.lanes.registers import N_LANES

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
PULSES = Scene(LENGTHS, actuator=SmaPulse(0.5 * SPREAD), numerics=FAST)


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
    "other sizes and actuators": (lambda: changed(PULSES, OTHER_SIZES), OTHER_SIZES),
    "one scene for all": (lambda: changed(PULSES, Scene(numerics=FAST)), Scene(numerics=FAST)),
    "robots in a mask": (changed_by_masks, MASKED),
    "equal robots": (lambda: Simulator(of_moduli(np.full(N_ROBOTS, 1e6)), N_ROBOTS), Scene(numerics=FAST)),
}


@pytest.mark.parametrize("make, scene", SAME.values(), ids=SAME)
def test_a_simulator_has_the_bits_of_its_scene_however_it_came_to_it(make, scene):
    np.testing.assert_array_equal(strokes(make(), COMMANDS), strokes(Simulator(scene, N_ROBOTS), COMMANDS))
