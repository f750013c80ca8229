"""Robots of a batch with numbers of their own swim, to the last bit, as each would alone."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from refusals import assert_refused
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


def test_a_robot_keeps_the_tolerances_of_its_own_size():
    scene = Scene(LENGTHS, numerics=Numerics("implicit-midpoint", 10e-3, path_tolerance=0.02))
    batch = Simulator(scene, N_ROBOTS)
    steps = batch.stroke(COMMANDS[0]).steps
    for robot in (0, N_ROBOTS - 1):
        alone = Simulator(scene.of_robot(robot))
        assert alone.stroke(COMMANDS[0, robot : robot + 1]).steps[0] == steps[robot]
        np.testing.assert_array_equal(alone.positions[0], batch.positions[robot])


def test_robots_of_different_sizes_rest_in_shapes_of_their_own():
    simulator, nodes = Simulator(Scene(LENGTHS, numerics=FAST), N_ROBOTS), Seastar().nodes()
    np.testing.assert_allclose(simulator.positions, SPREAD[:, None, None] * nodes, rtol=0.0, atol=1e-16)
    strokes(simulator, COMMANDS[:1])
    simulator.reset(SPREAD > 1.0)
    np.testing.assert_array_equal(simulator.positions[SPREAD > 1.0][0], LENGTHS.nodes(int(np.argmax(SPREAD > 1.0))))
    np.testing.assert_allclose(LENGTHS.edge_length, SPREAD * Seastar().edge_length)
    assert LENGTHS.is_symmetric and not replace(LENGTHS, limbs=(Limb(length=0.07), *[Limb()] * 4)).is_symmetric


def test_robots_whose_limbs_differ_rest_in_shapes_of_their_own_and_only_equal_limbs_are_symmetric():
    simulator = Simulator(Scene(UNEVEN, actuator=SmaPulse(0.3), numerics=FAST), N_ROBOTS)
    np.testing.assert_allclose(simulator.positions[:, 9, 0], 0.12 * SPREAD[::-1], rtol=1e-12)
    for robot in (0, N_ROBOTS - 1):
        np.testing.assert_array_equal(simulator.positions[robot], UNEVEN.nodes(robot))
    swapped = (Limb(length=0.1 * SPREAD), Limb(length=0.1 * SPREAD[::-1]), Limb(length=0.1 * SPREAD))
    assert not Seastar(3, limbs=swapped).is_symmetric and Seastar(3, limbs=swapped[:1] * 3).is_symmetric


def test_a_taper_is_no_number_of_each_robot():
    tapered = Seastar(limbs=(Limb(radius=(2e-3, 1e-3)),) * 5)
    assert Scene(tapered).n_robots is None and len(tapered.limbs[0].radius) == 2
    other = replace(tapered, limbs=(Limb(radius=(2e-3, 1.5e-3)),) * 5)
    with pytest.raises(ValueError, match="same terms"):
        Simulator(Scene(tapered), 2).set_scene(Scene(other))


def test_set_scene_changes_sizes_and_actuators():
    first = Scene(LENGTHS, actuator=SmaPulse(0.3 * SPREAD), numerics=FAST)
    second = Scene(Seastar(limb_length=0.1 * SPREAD[::-1]), actuator=ACTUATORS["pulse"], numerics=FAST)
    simulator = Simulator(first, N_ROBOTS)
    strokes(simulator, COMMANDS[:1])
    simulator.set_scene(second)
    simulator.reset()
    np.testing.assert_array_equal(strokes(simulator, COMMANDS), strokes(Simulator(second, N_ROBOTS), COMMANDS))
    simulator.set_scene(Scene(numerics=FAST))
    simulator.reset()
    np.testing.assert_array_equal(
        strokes(simulator, COMMANDS), strokes(Simulator(Scene(numerics=FAST), N_ROBOTS), COMMANDS)
    )


def test_wires_in_waters_of_their_own_rest_at_their_temperatures():
    simulator = Simulator(Scene(actuator=THERMAL, numerics=FAST), N_ROBOTS)
    strokes(simulator, COMMANDS[:1])
    simulator.reset()
    np.testing.assert_array_equal(simulator.actuators[:, 0, 0], 15.0 * SPREAD)
    assert not simulator.observe_actuators().any()


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


def test_a_scene_knows_its_robots():
    scene = varied()
    assert scene.n_robots == N_ROBOTS and Scene().n_robots is None
    assert scene.of_robot(2).robot.youngs_modulus == MODULI[2] and scene.of_robot(2).n_robots is None
    assert scene.robot.youngs_modulus == MODULI


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: Seastar(rod_radius=("1", 2.0)), ("rod_radius", "'1'")),
        (lambda: Seastar(limb_length=np.array([0.1, 9.0]), limbs=(Limb(natural_curvature=5.0),) * 5), ("below pi",)),
        (lambda: Limb(direction=np.array([0.1, 0.2])), ("direction", "for all robots")),
        (lambda: SmaPulse(heating_time=np.array([0.1, 0.2])), ("heating_time", "positive")),
        (lambda: Scene(actuator=SmaPulse(np.array([0.1, 3.2]))), ("below pi", "3.2 rad")),
        (lambda: ThermalSma(water_temperature=np.array([20.0, 30.0])), ("T_water",)),
        (lambda: Limited(SmaPulse(np.ones(2)), np.ones(3)), ("equally many",)),
        (lambda: Simulator(Scene(), 2).set_scene(Scene(actuator=SmaPulse(cooling_time=2.0))), ("same terms",)),
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
    with assert_refused(*words):
        make()
