"""What parts declare of their numbers: refusals say name, unit and value, and docstrings have the same units."""

import contextlib
import copy
import itertools
import math
import pickle
import re
from dataclasses import FrozenInstanceError, fields, is_dataclass, replace

import numpy as np
import pytest

from every_part import ACTUATORS, PARTS
from refusals import assert_refused
from seastar_gym import (
    HeadingTargets,
    Limb,
    Limited,
    Normal,
    RewardWeights,
    Scene,
    Seastar,
    Sight,
    SmaLimb,
    SmaPulse,
    Stiffening,
    Uniform,
)
from seastar_gym.envs.randomization import LogUniform
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.tasks import NAMED
from seastar_gym.scene.checks import require_count, require_finite, require_number, require_range, require_within
from seastar_gym.scene.number import PerRobot, declared, unit_of
from seastar_gym.scene.serial import KINDS

# A number is within what is declared of it, for all robots and for each.

NOT_A_NUMBER = [math.nan, math.inf, -math.inf, "0.1", None, True, 1j, [0.1]]


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
    RewardWeights(), Sight(delay=Uniform(0.5, 1.0)), Sight(), *NAMED.values(),
]  # fmt: skip
FOUND = [*dict.fromkeys(parts_of((*SCENES, *OTHERS)))]
EXAMPLES = {type(part): part for part in reversed(FOUND)}
"""A part of every kind."""
DECLARED = [(kind, name, each) for kind in EXAMPLES for name, each in declared(kind).items()]


def outside(number):
    """What a number must not be by its declaration: beyond its bounds, or no number at all."""
    check, bounds = number.require.func, number.require.keywords
    positive = not bounds.get("zero_allowed")
    if check is require_range:
        return [(0.2, 0.1), (-0.1, 0.1), (0.1, math.nan), (0.1,), *[(0.0, 1.0)] * positive, *NOT_A_NUMBER]
    if check is require_count:
        low, high = bounds["smallest"], bounds["largest"]
        return [low - 1, high + 1, float(low + 1), str(low + 1), None, True, math.nan]
    if check is require_within:
        return [bounds["low"] - 1e-9, bounds["high"] + 1e-9, *NOT_A_NUMBER]
    return NOT_A_NUMBER if check is require_finite else [-5e-324, -1.0, *[0.0] * positive, *NOT_A_NUMBER]


def ends(number):
    """The last that it may be."""
    bounds = number.require.keywords
    names = {"low", "high", "smallest", "largest"} & bounds.keys()
    zero = {require_number: 0.0, require_range: (0.0, 0.0)}
    return [bounds[name] for name in names] + ([zero[number.require.func]] if bounds.get("zero_allowed") else [])


def test_every_kind_of_part_is_tried():
    known = {kind for name, kind in KINDS.items() if kind.__module__.startswith("seastar_gym") and is_dataclass(kind)}
    assert known == {kind for kind in EXAMPLES if kind.__module__.startswith("seastar_gym")}


def test_what_is_declared_is_what_was(golden):
    """In the words of the sentences that refuse."""
    lines = []
    for kind, name, each in DECLARED:
        with pytest.raises(ValueError, match="not Ellipsis") as refused:
            each.number.require(f"{each.number.whose}{name}", ...)
        flags = [flag.replace("_", " ") for flag, holds in each._asdict().items() if holds is True]
        sentence = str(refused.value).removesuffix(", not Ellipsis.")
        lines.append(f"{kind.__name__}: {sentence}. {', '.join(flags)}".strip())
    golden("declared.txt", "\n".join(sorted(lines)))


@pytest.mark.parametrize("kind, name, each", DECLARED, ids=lambda each: getattr(each, "__name__", str(each)[:30]))
def test_numbers_are_as_declared_or_refused_in_their_words(kind, name, each):
    part, unit = EXAMPLES[kind], "" if each.number.unit == "1" else f"[{each.number.unit}]"
    for value in outside(each.number):
        if value is not None or not each.is_optional:
            with assert_refused(name, unit, repr(value)):
                replace(part, **{name: value})
    for value in ends(each.number):
        each.number.require(name, value)
    if each.is_per_robot:
        for bad in (math.nan, -math.inf if each.number.require.func is require_finite else -1.0):
            with assert_refused(name, repr(bad)):
                replace(part, **{name: np.array([0.5, bad])})
        for shape in ((0,), (), (2, 2)):
            with assert_refused(name, "(n_robots,)"):
                replace(part, **{name: np.ones(shape)})


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


KINDS_OF_NUMBERS = float, int, np.int64, np.uint8, np.float32, np.float64, np.longdouble
NUMBERS = [(part, field.name) for part in FOUND for field in fields(part) if field.init]


def with_floats(value, make):
    """Value with what is made of every float in it, or of None, at any depth of tuples."""
    if type(value) in (tuple, PerRobot):
        return tuple(with_floats(one, make) for one in value)
    return make(value) if value is None or type(value) is float else value


def others_of(value):
    """Floats in place of those of a value, all the same, rising or of single precision, and other kinds of them."""
    for first, rise in itertools.product((0, 1, 2, 70), (0, 1)):
        numbers = ((kind, itertools.count(first, rise)) for kind in KINDS_OF_NUMBERS)
        yield [with_floats(value, lambda _, kind=kind, n=n: kind(next(n))) for kind, n in numbers]
    yield [with_floats(value, kind) for kind in (lambda number: float(np.float32(number)), np.float32)]


def accepted(part, name, value):
    """The part with another value of a number; None where it is refused."""
    with contextlib.suppress(ValueError):
        return replace(part, **{name: value})
    return None


@pytest.mark.parametrize("kind", sorted({type(part).__name__ for part in FOUND}))
def test_parts_are_frozen_equal_by_value_hashable_and_travel(kind):
    for part in (part for part in FOUND if type(part).__name__ == kind):
        name = fields(part)[0].name
        with pytest.raises(FrozenInstanceError):
            setattr(part, name, getattr(part, name))
        for twin in (replace(part), copy.deepcopy(part), pickle.loads(pickle.dumps(part))):
            assert twin == part and hash(twin) == hash(part)


def test_a_whole_number_or_one_of_numpy_is_the_float():
    tried = set()
    for part, name in NUMBERS:
        value = getattr(part, name)
        for floats, *others in others_of(value):
            if floats != value and (expected := accepted(part, name, floats)) is not None:
                assert {repr(replace(part, **{name: other})) for other in others} == {repr(expected)}, (part, name)
                tried.add((type(part), name))
    assert len(tried) > 140


def test_numbers_of_environments_and_of_each_robot_are_floats_too():
    for number in (np.float32(0.02), np.float16(0.02), 1):
        env = SeastarSwimEnv(waypoint_radius=number, decision_period=1, scene=Scene())
        assert repr(env.waypoint_radius) == repr(float(number)) and repr(env.decision_period) == "1.0"
    for robots in (np.array([1, 2]), np.array([1, 2], np.uint8), np.array([1, 2], np.float32), PerRobot((1, 2))):
        assert repr(Seastar(density=robots)) == repr(Seastar(density=np.array([1.0, 2.0])))
