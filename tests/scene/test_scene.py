"""A scene holds the values of the chapter, and is shown as it is made."""

import copy
import dataclasses
import math

import pytest

from seastar_gym import Contact, Limb, Numerics, Scene, Seastar, Simulator, SmaPulse, Vortex, Water

FIDELITIES = ("rapid", "fast", "balanced", "accurate", "reference", "chapter")


# The chapter's values


def test_defaults_are_the_chapters_values_in_the_continuums_discretisation():
    robot, water, actuator = Seastar(), Water(), SmaPulse()
    assert dataclasses.astuple(robot) == (
        *(5, 12, 0.1, 1.6e-3, 1e6, 1000.0, "opening", (), None, "continuum"), *(None, None, None),
    )  # fmt: skip
    assert dataclasses.astuple(water) == (1000.0, 1.0, None, None, None)
    assert dataclasses.astuple(actuator)[:3] == (math.pi / 5, 0.1, 0.9)
    assert Numerics().scheme == "implicit-euler"
    assert Scene() == Scene(robot, water, actuator, Numerics.preset("balanced")) == Scene.preset("balanced")


def test_a_scene_knows_whether_its_numerics_were_named_and_is_otherwise_the_same():
    plain, named = Scene(), Scene.preset("balanced")
    assert not plain.numerics.named and named.numerics.named
    assert plain == named and hash(plain) == hash(named)
    for same in (dataclasses.replace(plain, robot=Seastar()), copy.deepcopy(plain), plain.of_robot(0)):
        assert not same.numerics.named
    assert dataclasses.replace(plain.numerics, step=1e-3).named
    assert Numerics(**dataclasses.asdict(plain.numerics)).named is False
    Simulator(plain).set_scene(named)  # one frame


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_fidelity_chooses_the_resolution_that_a_robot_does_not_name(fidelity):
    preset, soft = Scene.preset(fidelity), Scene(Seastar(youngs_modulus=1e5))
    assert Scene().at(fidelity) == preset and Scene().at() == Scene()
    assert soft.at(fidelity).robot == dataclasses.replace(preset.robot, youngs_modulus=1e5)
    assert soft.at(fidelity).robot.named_resolution == (preset.robot.discretisation, preset.robot.nodes_per_limb)
    for nodes in (10, 12):  # the default, too, is kept where somebody names it
        named = dataclasses.replace(Scene(dataclasses.replace(Seastar(), nodes_per_limb=nodes)), gravity=None)
        assert named.at(fidelity).robot.nodes_per_limb == nodes
    continuum = Scene(Seastar(discretisation="continuum"))
    assert continuum.at(fidelity).robot.discretisation == "continuum"
    held = Scene(held_nodes=(0, 1), loads=((11, 0.0, 1e-3),))
    assert held.at(fidelity).robot == held.robot  # nodes are counted on a mesh


def test_a_resolution_that_nobody_named_is_not_lost():
    robot = Seastar(discretisation="chapter")
    assert robot.nodes_per_limb == 10 and robot.named_resolution == ("chapter", None)
    assert dataclasses.replace(robot, discretisation="continuum") == Seastar()
    for same in (dataclasses.replace(Seastar(), limb_length=0.1), copy.deepcopy(Seastar()), Scene().of_robot(0).robot):
        assert same == Seastar(nodes_per_limb=12) and same.named_resolution == (None, None)


# How parts are shown

SCENES = (
    Scene(),
    Scene.preset("chapter"),
    Scene(Seastar(limbs=(Limb(radius=(2e-3, 1e-3)),) * 5), Water(current=Vortex(1e-3, y=0.1)), gravity=(0.0, -1.0)),
    Scene(Seastar(8, density=900.0), fluid=None, contact=Contact(), limb_strengths=(1.0,) * 7 + (0.5,)),
)


@pytest.mark.parametrize("part", [*SCENES, Numerics(), Numerics.preset("reference")], ids=repr)
def test_scenes_and_numerics_are_shown_as_the_short_call_that_makes_them(part):
    assert eval(repr(part)) == part and len(repr(part)) < 250
    assert "=" not in repr(type(part)())


def test_notebooks_show_every_part_of_a_scene_with_its_units(golden):
    golden("shown.html", "\n".join(part._repr_html_() for part in (SCENES[2], Numerics())))
