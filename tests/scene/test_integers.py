"""A number of a part is a float, whatever kind of number it was given as, so that results are the same bits."""

import contextlib
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

from every_part import ACTUATORS, PARTS
from seastar_gym import HeadingTargets, Normal, RewardWeights, Scene, Seastar, Sight, Simulator, Uniform
from seastar_gym.envs.randomization import LogUniform
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.tasks.envs import CHALLENGES
from seastar_gym.scene.per_robot import PerRobot
from seastar_gym.scene.serial import KINDS

KIND_OF_WHOLE = int, np.int64, np.uint8, np.float32, np.float64, np.longdouble
WHOLE = 0, 1, 2, 3, 70


def parts_of(value):
    """A part and all parts within it."""
    if isinstance(value, tuple):
        for one in value:
            yield from parts_of(one)
    elif is_dataclass(value):
        yield value
        for field in fields(value):
            yield from parts_of(getattr(value, field.name))


SCENES = [*(Scene(**parts) for parts in PARTS.values()), *(Scene(actuator=each) for each in ACTUATORS.values())]
OTHERS = [
    HeadingTargets(0.5), HeadingTargets((0.5, 1.0)), Uniform(0.5, 1.0), LogUniform(0.5, 1.0), Normal(0.5, 1.0),
    RewardWeights(), Sight(delay=Uniform(0.5, 1.0)), Sight(), *CHALLENGES.values(),
]  # fmt: skip
FOUND = {repr(part): part for part in parts_of((*SCENES, *OTHERS))}
NUMBERS = [(part, field.name) for part in FOUND.values() for field in fields(part) if field.init]


def floats_in(value):
    """Floats in a value, at any depth of tuples."""
    if type(value) in (tuple, PerRobot):
        return [number for one in value for number in floats_in(one)]
    return [value] if type(value) is float else []


def with_floats(value, numbers):
    """Value with other numbers, from an iterator, in place of its floats."""
    if type(value) in (tuple, PerRobot):
        return tuple(with_floats(one, numbers) for one in value)
    return next(numbers) if type(value) is float else value


def others_of(value):
    """Whole numbers for the floats of a value, all the same or rising, and those that single precision makes of it."""
    if value is None:
        return [(float(whole), KIND_OF_WHOLE) for whole in WHOLE]
    n = len(floats_in(value))
    rows = [[float(whole + k * rise) for k in range(n)] for whole in WHOLE for rise in (0, 1)] if n else []
    single = [(with_floats(value, map(float, map(np.float32, floats_in(value)))), (np.float32,))] if n else []
    return [*((with_floats(value, iter(row)), KIND_OF_WHOLE) for row in rows), *single]


def accepted(part, name, value):
    """The part with another value of a number; None where it is refused."""
    with contextlib.suppress(ValueError):
        return replace(part, **{name: value})
    return None


def test_every_kind_of_part_is_tried():
    known = {kind for name, kind in KINDS.items() if kind.__module__.startswith("seastar_gym") and is_dataclass(kind)}
    assert known == {type(part) for part in FOUND.values()}


def test_a_whole_number_or_one_of_numpy_is_the_float():
    numbers = {(type(part), name) for part, name in NUMBERS if floats_in(getattr(part, name))}
    tried = set()
    for part, name in NUMBERS:
        for value, kinds in others_of(getattr(part, name)):
            expected = accepted(part, name, value)
            for kind in kinds if expected is not None else ():
                other = kind(value) if value in WHOLE else with_floats(value, map(kind, floats_in(value)))
                assert repr(replace(part, **{name: other})) == repr(expected), (type(part), name, kind)
                tried.add((type(part), name))
    assert len(numbers - tried) <= 1 and len(tried) > 90, numbers - tried


@pytest.mark.parametrize("number", [np.float32(0.02), np.float16(0.02), 1], ids=repr)
def test_numbers_of_an_environment_are_floats_too(number):
    env = SeastarSwimEnv(waypoint_radius=number, decision_period=1, scene=Scene())
    assert repr(env._task.waypoint_radius) == repr(float(number)) and repr(env.decision_period) == "1.0"


def test_numbers_of_each_robot_are_floats_in_any_array():
    for robots in (np.array([1, 2]), np.array([1, 2], np.uint8), np.array([1, 2], np.float32), PerRobot((1, 2))):
        assert repr(Seastar(density=robots)) == repr(Seastar(density=np.array([1.0, 2.0])))


@pytest.mark.parametrize("robot", [Seastar(relaxation_time=0), Seastar(relaxation_time=0, youngs_modulus=1_000_000)])
def test_a_robot_of_whole_numbers_swims_the_same_bits(robot):
    swum = Simulator(Scene(robot)), Simulator(Scene(Seastar(relaxation_time=0.0)))
    for simulator in swum:
        simulator.stroke([[1, 0, 0, -1, 0]])
    np.testing.assert_array_equal(*(simulator.positions for simulator in swum))
