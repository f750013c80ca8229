"""A scene holds the values of the chapter, is shown as it is made, and what cannot be modelled is refused."""

import copy
import dataclasses
import math
from functools import partial

import numpy as np
import pytest

from oracle import Star
from refusals import assert_refused
from seastar_gym import (
    Contact,
    GridCurrent,
    Limb,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    UniformCurrent,
    Vortex,
    Water,
)
from seastar_gym.model.rods import make_rods

FIDELITIES = ("fast", "balanced", "accurate", "reference", "chapter")


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


@pytest.mark.parametrize("vector", [(0.001, 0.0), [0.001, 0.0]])
def test_a_uniform_current_given_as_a_vector_is_told_how_to_be_given(vector):
    with assert_refused("UniformCurrent takes u_x and u_y", "vector"):
        UniformCurrent(vector)
    each = UniformCurrent(np.array([0.001, 0.002]))
    assert dataclasses.replace(each, u_y=0.1).u_x == each.u_x == (0.001, 0.002)


def test_a_scene_knows_whether_its_numerics_were_named_and_is_otherwise_the_same():
    plain, named = Scene(), Scene.preset("balanced")
    assert not plain.numerics.named and named.numerics.named
    assert plain == named and hash(plain) == hash(named)
    for same in (dataclasses.replace(plain, robot=Seastar()), copy.deepcopy(plain), plain.of_robot(0)):
        assert not same.numerics.named
    assert dataclasses.replace(plain.numerics, step=1e-3).named
    assert Numerics(**dataclasses.asdict(plain.numerics)).named is False
    Simulator(plain).set_scene(named)  # one frame
    with assert_refused("named", "True or False"):
        Numerics(named="no")


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
    with assert_refused("discretisation", "'exact'"):
        Seastar(discretisation="exact")


def test_chapter_robot_has_46_nodes_in_the_documented_order():
    robot = Seastar(nodes_per_limb=10)
    nodes = robot.nodes()
    assert robot.n_nodes == 46 and nodes.shape == (46, 2)
    assert robot.edge_length == pytest.approx(0.1 / 9)
    np.testing.assert_array_equal(nodes[0], 0.0)
    for limb in range(5):
        direction = np.array([math.cos(2 * math.pi * limb / 5), math.sin(2 * math.pi * limb / 5)])
        for i in range(1, 10):
            np.testing.assert_allclose(nodes[9 * limb + i], i * 0.1 / 9 * direction, atol=1e-16)


@pytest.mark.parametrize("n_limbs", range(1, 13))
def test_nodes_are_the_oracles(n_limbs):
    for nodes_per_limb in (2, 3, 7, 10):
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


def test_a_long_current_is_cut_where_a_scene_is_shown():
    grid = GridCurrent.from_function(lambda x, y: (y, x), (0.0, 1.0), (0.0, 1.0), 0.01)
    for text in (repr(Scene(fluid=Water(current=grid))), Scene(fluid=Water(current=grid))._repr_html_()):
        assert "GridCurrent" in text and len(text) < 2000


def test_notebooks_show_every_part_of_a_scene_with_its_units():
    text = SCENES[2]._repr_html_()
    for words in ("limb_length 0.1 m", "Water", "Vortex", "peak_angle", "step 0.005 s", "(0.0, -1.0)"):
        assert words in text
    assert "contact" not in text and "<td" in Numerics()._repr_html_()


# Scenes that cannot be modelled are refused in one sentence.


def coefficients(**robot):
    """Those of a robot that have to be finite and positive."""
    return make_rods(Scene(Seastar(**robot)))


SCHEMES = "'implicit-euler', 'sdirk2', 'sdirk3', 'implicit-midpoint'"
REFUSED = [
    (lambda: Numerics(newton_tolerance=0.1), "newton_tolerance", "0.01"),
    (lambda: Numerics("sdirk2", path_tolerance=0.01), "path_tolerance", "implicit-midpoint", "sdirk2"),
    (lambda: Simulator(Scene(numerics=Numerics(step=1e-15))), "step"),
    *((partial(Seastar, hub_hinge=name), "hub_hinge", "'opening', 'turning'", repr(name))
      for name in ("", "Opening", "interior", None, 1)),
    *((partial(Numerics, scheme=name), "scheme", SCHEMES, repr(name)) for name in ("", "euler", "SDIRK2", None)),
    *((partial(Numerics.preset, name), "fidelity", *map(repr, FIDELITIES), repr(name)) for name in ("", "exact", None)),
    *((partial(Scene, robot=robot), "robot") for robot in (None, Seastar)),
    *((partial(Scene, fluid=fluid), "fluid") for fluid in ("water", 1000.0)),
    *((partial(Scene, numerics=numerics), "numerics") for numerics in ("fast", None)),
    (lambda: Scene(actuator=None), "actuator"),
    *((partial(Scene, **{name: ((node, 1.0, 0.0) if name == "loads" else node,)}), "node", "0 to 55", repr(node))
      for name in ("held_nodes", "loads") for node in (-1, 56, 1.5, "0", True, None)),
    *((partial(Scene, loads=(load,)), "load", "F_x, F_y")
      for load in ((1, 2.0), (1, math.nan, 0.0), (1, 0.0, math.inf), (1, 1.0, 2.0, 3.0))),
    (lambda: Scene(held_nodes=5),),
    *((partial(Scene, loads=loads),) for loads in ((3,), ((1, "a", 0.0),), ((1, None, 0.0),))),
    *((partial(coefficients, **{name: value}),) for name, value in
      {"rod_radius": 1e-90, "limb_length": 1e300, "youngs_modulus": 1e308, "density": 1e-320}.items()),
]  # fmt: skip
"""What is refused, and words of the sentence."""


@pytest.mark.parametrize("refused", REFUSED, ids=lambda refused: " ".join(refused[1:]))
def test_what_cannot_be_modelled_is_refused_in_a_sentence(refused):
    make, *words = refused
    with assert_refused(*words):
        make()


@pytest.mark.parametrize("scheme", ["implicit-euler", "sdirk2", "sdirk3"])
def test_numerical_damping_is_for_the_implicit_midpoint_rule(scheme):
    with assert_refused("damping", "implicit-midpoint", scheme):
        Numerics(scheme, damping=0.002)
    assert Numerics(scheme, damping=0).damping == 0.0


@pytest.mark.parametrize("n_limbs", range(3, 13))
def test_peak_angles_that_let_a_hub_hinge_reach_pi_are_refused(n_limbs):
    """Neighbours turned apart by a peak angle each: 2 pi/n_limbs + 2 peak < pi."""
    limit = 0.5 * (math.pi - 2.0 * math.pi / n_limbs)
    robot = Seastar(n_limbs=n_limbs, discretisation="chapter")
    for peak in (limit, limit + 1e-9, 3.0):
        with assert_refused("reach pi", f"{n_limbs} limbs", f"{limit:.4g}"):
            Scene(robot=robot, actuator=SmaPulse(peak_angle=peak))
    assert Scene(robot=robot, actuator=SmaPulse(peak_angle=0.999 * limit)).actuator.peak_angle < limit


@pytest.mark.parametrize("n_limbs", range(2, 13))
def test_a_rigid_hub_has_no_such_hinges_and_refuses_half_turns_alone(n_limbs):
    robot = Seastar(n_limbs=n_limbs)
    for peak in (math.pi, math.pi + 1e-9, 10.0):
        with assert_refused("below pi", f"{peak:.4g} rad"):
            Scene(robot=robot, actuator=SmaPulse(peak_angle=peak))
    Scene(robot=robot, actuator=SmaPulse(peak_angle=0.999 * math.pi))


@pytest.mark.parametrize("discretisation, share", [("chapter", 0.3), ("continuum", 0.3), ("continuum", 1.0)])
def test_the_largest_allowed_peak_still_swims(discretisation, share):
    pulse = SmaPulse(peak_angle=0.999 * share * math.pi)
    scene = Scene(Seastar(discretisation=discretisation), actuator=pulse, numerics=Numerics(step=0.01))
    commands = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 5)).reshape(5, -1).T
    simulator = Simulator(scene, len(commands))
    report = simulator.stroke(commands)
    assert not report.status.any() and np.isfinite(simulator.positions).all()


def test_a_turning_hub_refuses_peaks_that_close_it_and_an_opening_hub_allows_crossing_limbs():
    turning = Seastar(hub_hinge="turning", discretisation="chapter")
    with assert_refused("turning", "above zero"):
        Scene(robot=turning, actuator=SmaPulse(peak_angle=0.64))
    Scene(robot=turning, actuator=SmaPulse(peak_angle=math.pi / 5))
    scene = Scene(actuator=SmaPulse(peak_angle=0.8), numerics=Numerics(step=0.01))
    report = Simulator(scene).stroke([[1.0, -1.0, 0.0, 0.0, 0.0]])
    assert report.smallest_opening_angle[0] < 0.0


def test_whose_coefficients_overflow_is_told_in_the_numbers_that_they_are_made_of():
    limbs = tuple(Limb(direction=2.0 * math.pi * j / 12, radius=(1e-3, 1e-90), youngs_modulus=1e6) for j in range(12))
    with assert_refused("limbs 0.1 m long", "radii of 1e-90 to 0.001 m", "moduli of 1e+06 Pa", "1100 kg/m^3"):
        Scene(robot=Seastar(12, limbs=limbs, density=1100.0))
