"""What parts declare of their numbers: refusals say name, unit and value, and docstrings have the same units."""

import contextlib
import copy
import math
import pickle
import re
from dataclasses import FrozenInstanceError, fields, is_dataclass, replace

import numpy as np
import pytest

from every_part import ACTUATORS, CURVE, PARTS, WAVES
from refusals import assert_refused
from seastar_gym import (
    AlongLimb,
    Attachment,
    Body,
    Contact,
    Disc,
    FailBlind,
    GridCurrent,
    HeadingTargets,
    Limb,
    Limited,
    MeasuredCurve,
    Miswired,
    Normal,
    Numerics,
    ObstTrap,
    Prey,
    Prizes,
    RewardWeights,
    Scene,
    Seastar,
    Section,
    ShearCurrent,
    Sight,
    Simulator,
    SmaLimb,
    SmaPulse,
    SmaWires,
    Station,
    Stiffening,
    Strip,
    ThermalSma,
    Tube,
    Uniform,
    UniformCurrent,
    Vortex,
    Water,
)
from seastar_gym.envs.randomization import LogUniform
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.tasks.envs import CHALLENGES
from seastar_gym.scene.checks import LONGEST_SHOWN, as_floats, shown
from seastar_gym.scene.number import declared
from seastar_gym.scene.per_robot import PerRobot, unit_of
from seastar_gym.scene.serial import KINDS

NOT_A_NUMBER = [math.nan, math.inf, -math.inf, "0.1", None, True, 1j, [0.1]]
POSITIVE = {
    Seastar: "limb_length rod_radius youngs_modulus density", Limb: "length radius youngs_modulus joint_stiffness",
    Body: "height", Vortex: "core_radius", GridCurrent: "spacing", Contact: "modulus opening_angle layer",
    Stiffening: "ratio width", SmaPulse: "heating_time cooling_time", SmaWires: "heating_time cooling_time period",
    SmaLimb: "rise middle time_constant heating_time period", Limited: "largest_angle largest_rate",
    ThermalSma: "heating_time cooling_time time_constant steady_rise", Numerics: "step newton_tolerance",
    ObstTrap: "longest_way", Prey: "robot_speed catch_radius", Prizes: "side radius seconds robot_speed",
    Sight: "rate", Station: "tolerance", Disc: "radius", Strip: "width height", Tube: "outer inner",
    Section: "area second_moment projected_width added_area bending_stiffness mass_per_length half_width",
}  # fmt: skip
NOT_NEGATIVE = {
    Seastar: "relaxation_time", Body: "radius mass inertia drag_coefficient drag_along drag_across drag_turning "
    "added_mass_along added_mass_across added_mass_turning", Stiffening: "middle", SmaPulse: "peak_angle heating_power",
    Water: "density drag_coefficient tangential_drag_coefficient added_mass_coefficient",
    SmaWires: "peak_angle heating_power", SmaLimb: "peak_angle delay rest_curvature curvature_change heating_power",
    ThermalSma: "peak_angle heating_power", MeasuredCurve: "scale heating_power",
    RewardWeights: "progress waypoint effort heading", ObstTrap: "touch", Prey: "epicycle progress catch effort",
    Prizes: "gain progress prize effort", Station: "progress nearness effort",
}  # fmt: skip
FINITE = {
    Limb: "natural_curvature", Attachment: "x y direction", UniformCurrent: "u_x u_y", ShearCurrent: "rate direction",
    Vortex: "circulation x y", ThermalSma: "water_temperature austenite_start austenite_finish martensite_start "
    "martensite_finish largest_temperature",
}  # fmt: skip
RANGES = {Prey: "speed radius", Station: "current distance", ObstTrap: "distance"}
WITHIN = {
    (AlongLimb, "share"): (0.0, 1.0), (Numerics, "path_tolerance"): (1e-3, 0.02),
    (Numerics, "damping"): (0.0, 0.5), (RewardWeights, "aim"): (0.0, 1.0),
    (Miswired, "swap_probability"): (0.0, 1.0),
}  # fmt: skip
NODES = 2, 10_000
WHOLE = {
    (Seastar, "n_limbs"): (1, 12), (Seastar, "nodes_per_limb"): NODES, (Numerics, "max_iterations"): NODES,
    (FailBlind, "dead"): (0, 2), (ObstTrap, "scattered"): (0, 20), (Prey, "wanted"): (1, 1_000_000),
}  # fmt: skip
MADE = {
    Attachment: Attachment(0.0, 0.0, 0.0), ShearCurrent: ShearCurrent(1.0), Vortex: Vortex(1.0), GridCurrent: WAVES,
    Limited: Limited(SmaPulse()), MeasuredCurve: CURVE, Numerics: Numerics("implicit-midpoint"),
    Disc: Disc(1e-3), Strip: Strip(1e-3, 4e-3), Tube: Tube(2e-3, 1e-3), Section: Section(1e-5, 1e-11, 4e-3),
}  # fmt: skip
"""Parts of which a number is changed, where they need arguments."""


def each_of(table):
    return [(kind, name) for kind, names in table.items() for name in names.split()]


def refuse(kind, name, values, *words):
    """Assert that each of these values is refused; None only where it does not stand for a choice of its own."""
    part = MADE.get(kind) or kind()
    for value in values:
        if value is not None or not declared(kind)[name].is_optional:
            with assert_refused(name, *words, repr(value)):
                replace(part, **{name: value})


def test_every_number_that_is_declared_is_tried():
    tried = {*each_of(POSITIVE), *each_of(NOT_NEGATIVE), *each_of(FINITE), *each_of(RANGES), *WITHIN, *WHOLE}
    package = [kind for kind in KINDS.values() if kind.__module__.startswith(("seastar_gym.scene", "seastar_gym.envs"))]
    assert tried == {(kind, name) for kind in package for name in declared(kind)}


@pytest.mark.parametrize("kind, name", each_of(POSITIVE))
def test_quantities_that_must_be_positive_and_finite_are(kind, name):
    refuse(kind, name, [0.0, -1.0, *NOT_A_NUMBER], "positive", f"[{declared(kind)[name].number.unit}]")


@pytest.mark.parametrize("kind, name", each_of(NOT_NEGATIVE))
def test_quantities_that_may_be_zero_are_not_negative(kind, name):
    assert getattr(replace(MADE.get(kind) or kind(), **{name: 0}), name) == 0.0
    refuse(kind, name, [-1.0, *NOT_A_NUMBER], "not negative", f"[{declared(kind)[name].number.unit}]")


@pytest.mark.parametrize("kind, name", each_of(FINITE))
def test_quantities_of_any_sign_are_finite(kind, name):
    refuse(kind, name, NOT_A_NUMBER[:-1], "finite", f"[{declared(kind)[name].number.unit}]")


@pytest.mark.parametrize("kind, name", each_of(RANGES))
def test_ranges_are_a_smallest_and_a_largest_number(kind, name):
    zero = [] if kind is Station else [(0.0, 1.0)]
    odd = [(0.2, 0.1), (-0.1, 0.1), (0.1, math.nan), (0.1,), *zero, *NOT_A_NUMBER]
    refuse(kind, name, odd, f"{kind.__name__}.{name}", "the smallest and the largest", declared(kind)[name].number.unit)


@pytest.mark.parametrize("kind, name", WITHIN)
def test_shares_and_tolerances_are_within_their_bounds(kind, name):
    low, high = WITHIN[kind, name]
    refuse(kind, name, [-1.0, low - 1e-9, high + 1e-9, 5.0, *NOT_A_NUMBER], f"from {low:g} to {high:g}")


@pytest.mark.parametrize("kind, name", WHOLE)
def test_counts_are_whole_numbers_within_their_bounds(kind, name):
    low, high = WHOLE[kind, name]
    odd = [low - 1, high + 1, -5, float(low + 2), str(low + 2), None, True, False, math.nan]
    refuse(kind, name, odd, f"whole number from {low} to {high}")


OF_ROBOTS = [(kind, name) for kind in KINDS.values() for name, each in declared(kind).items() if each.is_per_robot]


@pytest.mark.parametrize("kind, name", OF_ROBOTS)
def test_numbers_of_each_robot_are_as_good_as_one(kind, name):
    number = getattr(MADE.get(kind) or kind(), name)
    for bad in (math.nan, -math.inf if (kind, name) in each_of(FINITE) else -1.0):
        with assert_refused(name, repr(bad)):
            replace(MADE.get(kind) or kind(), **{name: np.array([0.5 if number is None else number, bad])})
    for shape in ((0,), (), (2, 2)):
        with assert_refused(name, "(n_robots,)"):
            replace(MADE.get(kind) or kind(), **{name: np.ones(shape)})


@pytest.mark.parametrize("kind", [kind for kind in KINDS.values() if declared(kind)])
def test_docstrings_have_the_units_that_are_declared(kind):
    """But for ratios, and for a fraction of the limb length, which sentences say in words."""
    entries = re.split(r"\n    (?=[a-z_][a-z_, ]*: )", kind.__doc__)
    for name, each in declared(kind).items():
        told = [text for text in entries if name in text.partition(":")[0].split(", ")] or [kind.__doc__]
        unit = each.number.unit.partition(" of ")[0]
        assert unit in ("1", "limb lengths") or any(f"[{unit}]" in text for text in told), name


def test_a_number_has_the_unit_of_the_part_in_which_it_stands():
    scene = Scene(Seastar(limbs=(Limb(),) * 5, stiffening=Stiffening()), actuator=Limited(SmaPulse()))
    for name, unit in {
        "robot.n_limbs": "1", "robot.limbs.4.length": "m", "robot.stiffening.middle": "1", "fluid.density": "kg/m^3",
        "actuator.actuator.peak_angle": "rad", "numerics.newton_tolerance": "limb lengths",
        "robot.hub_hinge": None, "robot.limbs.5.length": None, "robot.body.mass": None, "fidelity": None, "robot": None,
    }.items():  # fmt: skip
        assert unit_of(scene, name) == unit, name
    assert unit_of(Scene(actuator=SmaLimb()), "actuator.middle") == "widths of the transformation"


# A number of a part is a float, whatever kind of number it was given as, so that results are the same bits.


KIND_OF_WHOLE = int, np.int64, np.uint8, np.float32, np.float64, np.longdouble
WHOLE_NUMBERS = 0, 1, 2, 3, 70


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
        return [(float(whole), KIND_OF_WHOLE) for whole in WHOLE_NUMBERS]
    n = len(floats_in(value))
    rows = [[float(whole + k * rise) for k in range(n)] for whole in WHOLE_NUMBERS for rise in (0, 1)] if n else []
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


@pytest.mark.parametrize("kind", sorted({type(part).__name__ for part in FOUND.values()}))
def test_parts_are_frozen_equal_by_value_hashable_and_travel(kind):
    for part in (part for part in FOUND.values() if type(part).__name__ == kind):
        name = fields(part)[0].name
        with pytest.raises(FrozenInstanceError):
            setattr(part, name, getattr(part, name))
        for twin in (replace(part), copy.deepcopy(part), pickle.loads(pickle.dumps(part))):
            assert twin == part and hash(twin) == hash(part)


def test_a_whole_number_or_one_of_numpy_is_the_float():
    numbers = {(type(part), name) for part, name in NUMBERS if floats_in(getattr(part, name))}
    tried = set()
    for part, name in NUMBERS:
        for value, kinds in others_of(getattr(part, name)):
            expected = accepted(part, name, value)
            for kind in kinds if expected is not None else ():
                other = kind(value) if value in WHOLE_NUMBERS else with_floats(value, map(kind, floats_in(value)))
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


# Values in sentences are short and on one line, whatever they are; arrays are made of numbers.


def nested(depth: int) -> list:
    return [nested(depth - 1)] if depth else []


@pytest.mark.parametrize("value", [0.1, -3, True, None, "text", (1, 2.0), [[1]], {"a": 1}], ids=repr)
def test_small_values_are_shown_as_python_writes_them(value):
    assert shown(value) == repr(value)


@pytest.mark.parametrize(
    "value",
    [
        "x" * 10_000,
        [0.1] * 10_000,
        nested(900),
        [10**5000],
        Seastar(limb_length=np.linspace(0.1, 0.2, 1000)),
        np.zeros((100, 100)),
        "two\nlines",
    ],
    ids=["text", "list", "nested", "large number", "part", "array", "lines"],
)
def test_large_values_are_cut_and_on_one_line(value):
    text = shown(value)
    assert 0 < len(text) <= LONGEST_SHOWN + 3
    assert "\n" not in text


@pytest.mark.parametrize("value", [10**400, -(10**5000)], ids=["400 digits", "5000 digits"])
def test_numbers_beyond_all_floats_are_not_written_out(value):
    assert shown(value) == "a number beyond all floats"


@pytest.mark.parametrize("value", [1, True, [1, 2], ((0.5,), (1.5,)), np.zeros((2, 3), np.float32)], ids=repr)
def test_numbers_become_floats_of_their_shape(value):
    array = as_floats("heading", value)
    assert array.dtype == np.float64 and array.shape == np.shape(value)


@pytest.mark.parametrize("value", ["abc", None, [[1], [2, 3]], [1j], {}], ids=repr)
def test_what_is_no_array_of_numbers_is_refused(value):
    with assert_refused("heading", "numbers"):
        as_floats("heading", value)
