"""Robots of a batch with numbers of their own swim, to the last bit, as each would alone."""

import copy
import pickle

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Seastar, ShearCurrent, Simulator, UniformCurrent, Vortex, Water
from seastar_gym.der.lanes import N_LANES

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


def test_every_robot_swims_as_it_would_alone():
    scene = varied()
    batch = Simulator(scene, N_ROBOTS, threads=2)
    positions = strokes(batch, COMMANDS)
    energies = batch.elastic_energy()
    for robot in range(N_ROBOTS):
        alone = Simulator(scene.of_robot(robot))
        np.testing.assert_array_equal(strokes(alone, COMMANDS[:, robot : robot + 1])[0], positions[robot])
        assert alone.elastic_energy()[0] == energies[robot]
    assert len({tuple(hub) for hub in positions[:, 0]}) == N_ROBOTS


def test_a_scene_of_equal_robots_is_the_scene_of_one():
    scene = Scene(Seastar(youngs_modulus=np.full(N_ROBOTS, 1e6)), numerics=FAST)
    plain = Simulator(Scene(numerics=FAST), N_ROBOTS)
    np.testing.assert_array_equal(strokes(Simulator(scene, N_ROBOTS), COMMANDS), strokes(plain, COMMANDS))


def test_set_scene_changes_the_robots_in_the_mask_alone():
    scene = varied()
    simulator = Simulator(scene, N_ROBOTS)
    mask = np.arange(N_ROBOTS) % 3 == 1
    moduli = np.where(mask, 5e5, MODULI)
    simulator.set_scene(Scene(Seastar(youngs_modulus=moduli), Water(), numerics=FAST), mask)
    simulator.set_scene(Scene(Seastar(youngs_modulus=moduli), Water(), numerics=FAST), ~mask)
    expected = Simulator(Scene(Seastar(youngs_modulus=moduli), Water(), numerics=FAST), N_ROBOTS)
    np.testing.assert_array_equal(strokes(simulator, COMMANDS), strokes(expected, COMMANDS))


def test_a_batch_of_different_robots_travels():
    simulator = Simulator(varied(), N_ROBOTS)
    strokes(simulator, COMMANDS[:1])
    twin = pickle.loads(pickle.dumps(simulator))
    np.testing.assert_array_equal(strokes(twin, COMMANDS[1:]), strokes(simulator, COMMANDS[1:]))


@pytest.mark.parametrize(
    "part", [varied(), varied().robot, UniformCurrent(np.zeros(3)), ShearCurrent(np.ones(2)), Vortex(0.1, np.ones(2))]
)
def test_parts_with_arrays_are_equal_by_value_hashable_and_travel(part):
    for twin in (copy.deepcopy(part), pickle.loads(pickle.dumps(part))):
        assert twin == part and hash(twin) == hash(part)


def test_a_scene_knows_its_robots():
    scene = varied()
    assert scene.n_robots == N_ROBOTS and Scene().n_robots is None
    assert scene.of_robot(2).robot.youngs_modulus == MODULI[2] and scene.of_robot(2).n_robots is None
    assert scene.robot.youngs_modulus == MODULI


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: Seastar(youngs_modulus=np.ones((2, 2))), ("youngs_modulus", "(n_robots,)")),
        (lambda: Seastar(youngs_modulus=np.zeros(0)), ("youngs_modulus", "(n_robots,)")),
        (lambda: Seastar(density=np.array([1.0, np.nan])), ("density", "positive", "nan")),
        (lambda: Seastar(rod_radius=("1", 2.0)), ("rod_radius", "'1'")),
        (lambda: Seastar(limb_length=np.array([0.1, 0.2])), ("limb_length", "positive")),
        (lambda: Water(1000.0, np.array([1.0, 0.5]), 0.6), ("tangential", "exceed")),
        (lambda: Scene(Seastar(density=np.ones(2)), Water(density=np.ones(3))), ("equally many", "robot.density")),
        (lambda: Scene(Seastar(youngs_modulus=np.array([1e6, 1e308]))), ("overflow",)),
        (lambda: Simulator(varied(), 3), (f"{N_ROBOTS} robots", "3")),
        (lambda: Simulator(Scene(), 2).set_scene(Scene(Seastar(n_limbs=4))), ("same terms",)),
        (lambda: Simulator(Scene(), 2).set_scene(Scene(fluid=None)), ("same terms",)),
        (lambda: Simulator(Scene(), 2).set_scene(Scene(fluid=Water(1.0, 1.0, 0.1))), ("same terms",)),
        (lambda: Simulator(Scene(), 2).set_scene(Scene(Seastar(density=np.ones(3)))), ("3 robots", "2")),
    ],
)  # fmt: skip
def test_numbers_that_no_batch_can_have_are_refused_with_a_sentence(make, words):
    with pytest.raises(ValueError, match=r"\.$") as caught:
        make()
    for word in words:
        assert word in str(caught.value)
