"""A scene holds the values of the chapter, and its parts are frozen and equal by value."""

import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest

from oracle import Star
from refusals import assert_refused
from seastar_gym import GridCurrent, Numerics, Scene, Seastar, Simulator, SmaPulse, UniformCurrent, Water

SAMPLED = GridCurrent((0.0, 0.0), 0.1, np.zeros((3, 2, 2)))
FIDELITIES = ("fast", "balanced", "accurate", "reference", "chapter")


# The chapter's values


def test_defaults_are_the_chapters_values_in_the_continuums_discretisation():
    robot, water, actuator = Seastar(), Water(), SmaPulse()
    assert dataclasses.astuple(robot) == (
        *(5, 10, 0.1, 1.6e-3, 1e6, 1000.0, "opening", (), None, "continuum"), *(None, None, None),
    )  # fmt: skip
    assert dataclasses.astuple(water) == (1000.0, 1.0, None, None, None)
    assert dataclasses.astuple(actuator)[:3] == (math.pi / 5, 0.1, 0.9)
    assert Numerics().scheme == "implicit-euler"
    assert Scene() == Scene(robot, water, actuator, Numerics())


@pytest.mark.parametrize("vector", [(0.001, 0.0), [0.001, 0.0]])
def test_a_uniform_current_given_as_a_vector_is_told_how_to_be_given(vector):
    with assert_refused("UniformCurrent takes u_x and u_y", "vector"):
        UniformCurrent(vector)
    each = UniformCurrent(np.array([0.001, 0.002]))
    assert dataclasses.replace(each, u_y=0.1).u_x == each.u_x == (0.001, 0.002)


def test_a_scene_knows_whether_its_numerics_were_named_and_is_otherwise_the_same():
    plain, named = Scene(), Scene(numerics=Numerics())
    assert not plain.numerics.named and named.numerics.named
    assert plain == named and hash(plain) == hash(named) and repr(plain) == repr(named)
    for same in (dataclasses.replace(plain, robot=Seastar()), copy.deepcopy(plain), plain.of_robot(0)):
        assert not same.numerics.named
    assert dataclasses.replace(plain.numerics, step=1e-3).named
    assert Numerics(**dataclasses.asdict(plain.numerics)).named is False
    Simulator(plain).set_scene(named)  # one frame
    with assert_refused("named", "True or False"):
        Numerics(named="no")


def test_chapter_robot_has_46_nodes_in_the_documented_order():
    robot = Seastar()
    nodes = robot.nodes()
    assert robot.n_nodes == 46 and nodes.shape == (46, 2)
    assert robot.edge_length == pytest.approx(0.1 / 9)
    np.testing.assert_array_equal(nodes[0], 0.0)
    for limb in range(5):
        direction = np.array([math.cos(2 * math.pi * limb / 5), math.sin(2 * math.pi * limb / 5)])
        for i in range(1, 10):
            np.testing.assert_allclose(nodes[9 * limb + i], i * 0.1 / 9 * direction, atol=1e-16)


@pytest.mark.parametrize("n_limbs, nodes_per_limb", [(3, 2), (4, 7), (5, 10), (12, 3)])
def test_nodes_are_the_oracles(n_limbs, nodes_per_limb):
    robot = Seastar(n_limbs, nodes_per_limb, limb_length=0.07)
    star = Star(n_limbs, nodes_per_limb, limb_length=0.07)
    np.testing.assert_allclose(robot.nodes(), star.rest, rtol=0.0, atol=1e-16)
    assert robot.n_nodes == star.n_nodes


def test_nodes_are_a_fresh_array():
    robot = Seastar()
    robot.nodes()[:] = 7.0
    assert robot.nodes().max() < 0.2


def test_fidelities_go_from_fast_to_exact():
    presets = {name: Numerics.preset(name) for name in FIDELITIES}
    assert presets["chapter"] == Numerics("implicit-euler", 3e-3)
    assert presets["balanced"].scheme == presets["accurate"].scheme == presets["reference"].scheme
    steps = [presets[name].step for name in FIDELITIES[:4]]
    assert steps == sorted(steps, reverse=True)
    for name in FIDELITIES:
        scene = Scene.preset(name)
        assert scene.is_chapters and scene.numerics == presets[name]
        assert scene.robot.discretisation == ("chapter" if name == "chapter" else "continuum")
    nodes = [Scene.preset(name).robot.nodes_per_limb for name in FIDELITIES[:4]]
    assert nodes == sorted(nodes)


@pytest.mark.parametrize("part", [Seastar(), Water(), SmaPulse(), Numerics(), Scene(), SAMPLED])
def test_parts_are_frozen_equal_by_value_hashable_and_travel(part):
    name = dataclasses.fields(part)[0].name
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(part, name, getattr(part, name))
    for twin in (dataclasses.replace(part), copy.deepcopy(part), pickle.loads(pickle.dumps(part))):
        assert twin == part and hash(twin) == hash(part)
