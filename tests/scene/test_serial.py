"""A scene comes back from its plain form to the last bit; what could not is refused when it is written."""

import copy
import dataclasses
import inspect
import json
from collections import OrderedDict, UserDict, UserList, deque
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seastar_gym
from every_part import ACTUATORS, CURVE, EACH, PARTS, WAVES
from refusals import assert_refused
from seastar_gym import (
    Contact,
    DomainRandomization,
    GridCurrent,
    HeadingTargets,
    Limb,
    Limited,
    LogUniform,
    Normal,
    Numerics,
    RewardWeights,
    Scene,
    Seastar,
    Sight,
    SmaPulse,
    Uniform,
    Water,
    register_part,
)
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.tasks import NAMED
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.scene.actuators.curves import HeatingAndCooling
from seastar_gym.scene.number import numbers_of
from seastar_gym.scene.serial import KINDS, VERSION, from_dict, to_dict


def again(scene: Scene) -> Scene:
    """The scene by way of JSON."""
    return Scene.from_dict(json.loads(json.dumps(scene.to_dict(), allow_nan=False)))


# Coming back


@pytest.mark.parametrize("actuator", ACTUATORS)
def test_every_actuator_comes_back_with_every_part(actuator):
    for name, part in PARTS.items():
        scene = Scene(**{"actuator": ACTUATORS[actuator], **part})
        found = again(scene)
        assert found == scene, name
        assert repr(found) == repr(scene), name  # the types of its numbers, too
        assert numbers_of(found) == numbers_of(scene), name  # and which of them are those of each robot


def test_what_nobody_named_comes_back_unnamed():
    assert not again(Scene()).numerics.named and again(Scene(numerics=Numerics())).numerics.named
    assert again(Scene()).at("fast") == Scene.preset("fast")
    assert again(Scene(Seastar(nodes_per_limb=12))).at("fast").robot.nodes_per_limb == 12
    assert again(Scene()).robot.named_resolution == (None, None)


def test_every_part_of_the_package_is_registered_and_in_the_tables():
    """A new part is not forgotten: of every registered kind some scene of the tables has one, and every field of it."""
    assert {"actuator"}.union(*PARTS.values()) == {field.name for field in dataclasses.fields(Scene)}
    public = (getattr(seastar_gym, name) for name in seastar_gym.__all__)  # registered where they are loaded
    parts = {kind for kind in public if inspect.isclass(kind) and dataclasses.is_dataclass(kind)}
    assert parts - {seastar_gym.StrokeReport, seastar_gym.Certificate} <= set(KINDS.values())
    scenes = [Scene(actuator=actuator) for actuator in ACTUATORS.values()] + [Scene(**part) for part in PARTS.values()]
    seen = {kind for scene in scenes for kind in KINDS if f'"kind": "{kind}"' in json.dumps(scene.to_dict())}
    own = {name: kind.__module__ for name, kind in KINDS.items() if kind.__module__.startswith("seastar_gym")}
    assert {name for name, module in own.items() if not module.startswith("seastar_gym.envs")} == seen - {"Trap"}


OF_ENVIRONMENTS = [
    RewardWeights(199.9, 0.0, 1 / 3), HeadingTargets((0.1, 1 / 3), 0.2), HeadingTargets("random"),
    Sight(100 / 3, Uniform(0.1, 1 / 3), sees=3), *NAMED.values(),
    DomainRandomization({"robot.density": Uniform(900, 1100.1), "actuator.peak_angle": Uniform(0, 0.5)}),
    DomainRandomization({"fluid.density": LogUniform(1.0, 1 / 0.3), "actuator.peak_angle": Normal(0.5, 0.01)}),
]  # fmt: skip


@pytest.mark.parametrize("part", OF_ENVIRONMENTS, ids=lambda part: type(part).__name__)
def test_what_an_environment_is_told_comes_back_in_its_order(part):
    read = from_dict(json.loads(json.dumps(to_dict(part), sort_keys=True)), type(part))
    assert read == part and repr(read) == repr(part)


def carried(value, mapping, sequence):
    """Plain data in other mappings and sequences."""
    if isinstance(value, dict):
        return mapping({name: carried(one, mapping, sequence) for name, one in value.items()})
    return sequence([carried(one, mapping, sequence) for one in value]) if isinstance(value, list) else value


def by_omegaconf(data):
    return pytest.importorskip("omegaconf").OmegaConf.create(data)


FORMS = {
    "read-only": lambda data: carried(data, MappingProxyType, tuple),
    "queues": lambda data: carried(data, OrderedDict, deque),
    "users' own": lambda data: carried(data, UserDict, UserList),
    "OmegaConf": by_omegaconf,
}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_any_mapping_and_sequence_is_plain_data_of_scenes_and_of_what_environments_are_told(form):
    for scene in (Scene.preset("fast"), Scene(Seastar(youngs_modulus=EACH), fluid=Water(current=WAVES))):
        assert Scene.from_dict(form(scene.to_dict())) == scene
    for part in OF_ENVIRONMENTS:
        assert from_dict(form(to_dict(part)), type(part)) == part
    path = [[0.1, 0.0], [0.2, 0.1]]
    np.testing.assert_array_equal(AlongPath(form({"path": path})["path"]).path, path)
    assert SwimOptions(sight=form(to_dict(Sight()))).sight == Sight()


def test_arrays_are_sequences_of_plain_data_unless_entries_are_masked():
    angles = {"version": 1, "kind": "HeadingTargets", "target": np.array([0.1, 0.2])}
    assert from_dict(angles, HeadingTargets) == HeadingTargets((0.1, 0.2))
    with assert_refused("masked"):
        from_dict({**angles, "target": np.ma.array([0.1, 0.2], mask=[True, False])}, HeadingTargets)


# Parts of one's own


@dataclass(frozen=True)
class Sawtooth(HeatingAndCooling):
    """An actuator that is not the package's."""

    peak_angle: float = 0.3
    heating_time: float = 0.2
    cooling_time: float = 0.8

    def delta_psi(self, t):
        return np.interp(t, self.corners, (0.0, self.peak_angle, 0.0))


@dataclass(frozen=True)
class Labelled(Sawtooth):
    label: str = field(default="none", kw_only=True, compare=False, repr=False)
    table: dict = field(default_factory=dict)


class Forgetful(Sawtooth):
    def __init__(self, peak, memory=0):
        super().__init__(peak)


class Incomparable(HeatingAndCooling):
    peak_angle, heating_time, cooling_time = 0.3, 0.2, 0.8
    delta_psi = Sawtooth.delta_psi


def test_a_registered_actuator_of_ones_own_comes_back(monkeypatch):
    """What does not count in comparisons, too."""
    monkeypatch.setitem(KINDS, "Sawtooth", Sawtooth)
    monkeypatch.setitem(KINDS, "Labelled", Labelled)
    assert register_part(Sawtooth) is Sawtooth
    read = again(Scene(actuator=Labelled(0.25, label="the left one", table={"b": (1, 2.0), "a": None}))).actuator
    assert read == Labelled(0.25, table=read.table) and read.label == "the left one" and [*read.table] == ["b", "a"]
    scene = Scene(actuator=Limited(Sawtooth(0.2), largest_rate=3.0))
    data = scene.to_dict()
    assert Scene.from_dict(data) == scene
    monkeypatch.delitem(KINDS, "Sawtooth")
    with assert_refused("Scene.actuator.actuator", "'Sawtooth'", "registered"):
        Scene.from_dict(data)


ELSEWHERE = type("SmaPulse", (SmaPulse,), {"__module__": "elsewhere"})


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: Scene(actuator=Sawtooth()), ("Scene.actuator is a Sawtooth", "seastar_gym.register_part")),
        (lambda: Scene(actuator=Limited(Sawtooth())), ("Scene.actuator.actuator is a Sawtooth",)),
        (lambda: Scene(actuator=ELSEWHERE()), ("Scene.actuator is a SmaPulse",)),
        (lambda: register_part(ELSEWHERE), ("SmaPulse",)),
        (lambda: Scene(actuator=Forgetful(0.3)), ("keeps no peak, memory",)),
        (lambda: Scene(actuator=Incomparable()), ("compare by value",)),
    ],
)
def test_what_would_not_come_back_is_refused_when_it_is_written(make, words, monkeypatch):
    for kind in (Forgetful, Incomparable):
        monkeypatch.setitem(KINDS, kind.__name__, kind)
    with assert_refused(*words):
        make().to_dict()
    assert KINDS["SmaPulse"] is SmaPulse


# What is no scene

HUGE = 10**400
PLAIN = Scene(actuator=Limited(SmaPulse()), fluid=Water(current=WAVES)).to_dict()


def nested(depth: int) -> list:
    lists: list = []
    for _ in range(depth):
        lists = [lists]
    return lists


NO_SCENES = [
    *((data, "is a dict with a version")
      for data in (None, [], 3, "Scene", {}, {"kind": "Scene"}, PLAIN["robot"], Scene())),
    *(({**PLAIN, "version": version}, "of version", f"only of {VERSION}")
      for version in (0, VERSION + 1, HUGE, True, 1.0, None, "1", [1], {})),
    (to_dict(Seastar()), "plain Seastar, not a Scene"),
    ({**PLAIN, "robot": PLAIN["numerics"]}, "Scene.robot must be"),
    *(({**PLAIN, "loads": nested(depth)}, words)
      for depth, words in ((31, "A load is"), (32, "nested too deeply"), (10_000, "nested too deeply"))),
    ({**PLAIN, "fluid": {**PLAIN["fluid"], "current": {"kind": "Vortex"}}}, "does not say"),
    ({**PLAIN, "actuator": {"kind": "Limited"}}, "does not say"),
]  # fmt: skip


def test_what_is_no_scene_is_refused(subtests):
    for data, *words in NO_SCENES:
        with subtests.test(words=words), assert_refused(*words):
            Scene.from_dict(data)


def places(data, path=()):
    """Places of all values in nested data."""
    inner = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in inner:
        yield (*path, key)
        yield from places(value, (*path, key))


SMALL = Scene(
    robot=Seastar(3, 3, limbs=(Limb(radius=1e-3 * EACH), *(Limb(radius=(1e-3, 2e-3)),) * 2)),
    fluid=Water(current=GridCurrent((0.0, 0.0), 0.1, np.zeros((2, 2, 2)))),
    actuator=Limited(CURVE, 0.5, 3.0),
    loads=((1, 0.0, 1e-4),),
    limb_strengths=(1.0, 0.5, 1.0),
    contact=Contact(),
).to_dict()
JUNK = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.just(HUGE), st.just(10**5000),
    st.lists(st.one_of(st.integers(), st.floats(), st.lists(st.integers()))), st.just(SMALL["actuator"]),
    st.dictionaries(st.text(max_size=3), st.integers()), st.builds(lambda k: {"kind": k}, st.sampled_from([*KINDS, 3])),
    st.builds(lambda x: {"kind": "per robot", "items": x}, st.lists(st.one_of(st.floats(), st.integers(), st.text()))),
)  # fmt: skip


def assert_read_or_refused(place, change):
    """Data whose dict or list was changed at a place is a scene that comes back, or is refused in a sentence."""
    data = copy.deepcopy(SMALL)
    inner = data
    for key in place[:-1]:
        inner = inner[key]
    change(inner, place[-1])
    sentence, scene = "", None
    try:
        scene = Scene.from_dict(data)
    except ValueError as refusal:
        sentence = str(refusal)
    assert again(scene) == scene if scene is not None else sentence.endswith(".") and "\n" not in sentence


@given(st.sampled_from(list(places(SMALL))), JUNK)
@settings(max_examples=400)
def test_junk_anywhere_is_refused_in_a_sentence_or_is_a_scene(place, junk):
    assert_read_or_refused(place, lambda inner, key: inner.__setitem__(key, junk))


def test_what_is_missing_has_its_default_or_is_asked_for():
    for place in places(SMALL):
        assert_read_or_refused(place, lambda inner, key: inner.pop(key))
