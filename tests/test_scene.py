"""A scene holds the chapter's values, has its coefficients, and refuses what cannot be modelled with one sentence."""

import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oracle import Star
from refusals import assert_refused
from seastar_gym import GridCurrent, Numerics, Scene, Seastar, Simulator, SmaPulse, UniformCurrent, Water
from seastar_gym.model.rods import make_rods

SAMPLED = GridCurrent((0.0, 0.0), 0.1, np.zeros((3, 2, 2)))
FIDELITIES = ("fast", "balanced", "accurate", "reference", "chapter")


# The chapter's values


def test_defaults_are_the_chapters_values():
    robot, water, actuator = Seastar(), Water(), SmaPulse()
    assert dataclasses.astuple(robot) == (5, 10, 0.1, 1.6e-3, 1e6, 1000.0, "opening", (), None)
    assert dataclasses.astuple(water) == (1000.0, 1.0, None, None, None)
    assert dataclasses.astuple(actuator) == (math.pi / 5, 0.1, 0.9)
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


@given(
    n_limbs=st.integers(3, 12), nodes_per_limb=st.integers(2, 40), limb_length=st.floats(0.01, 1.0),
    rod_radius=st.floats(1e-4, 1e-2), density=st.floats(100.0, 1e4),
)  # fmt: skip
def test_total_mass_is_that_of_the_limbs(n_limbs, nodes_per_limb, limb_length, rod_radius, density):
    robot = Seastar(n_limbs, nodes_per_limb, limb_length, rod_radius, density=density)
    mass = make_rods(Scene(robot=robot, actuator=SmaPulse(peak_angle=0.1))).mass
    assert mass.shape == (robot.n_nodes,)
    assert mass.sum() == pytest.approx(n_limbs * limb_length * math.pi * rod_radius**2 * density, rel=1e-12)


@pytest.mark.parametrize("hub_hinge", ["opening", "turning"])
def test_coefficients_are_the_oracles(hub_hinge):
    values = {"n_limbs": 4, "nodes_per_limb": 6, "limb_length": 0.2, "rod_radius": 2e-3, "youngs_modulus": 3e5}
    robot, water = Seastar(**values, density=1200.0, hub_hinge=hub_hinge), Water(density=900.0, drag_coefficient=1.3)
    star = Star(**values, density=1200.0, hub_hinge=hub_hinge, fluid_density=900.0, drag_coefficient=1.3)
    rods = make_rods(Scene(robot, water, SmaPulse(peak_angle=0.1)))
    np.testing.assert_allclose(rods.mass, star.masses, rtol=1e-14)
    np.testing.assert_allclose(rods.drag, star.drag, rtol=1e-14)
    np.testing.assert_allclose(rods.stretching.EA, star.EA, rtol=1e-14)
    np.testing.assert_allclose(rods.stretching.EA_over_l * rods.stretching.l_over_EA, 1.0, rtol=1e-14)
    np.testing.assert_allclose(rods.stretching.EA_over_l, star.EA / star.edge_length, rtol=1e-14)
    np.testing.assert_allclose(rods.bending.EI_over_dl, star.EI / star.edge_length, rtol=1e-14)
    np.testing.assert_allclose(rods.bending.EI_over_dl * rods.bending.dl_over_EI, 1.0, rtol=1e-14)
    assert rods.hub.side == {"opening": 1.0, "turning": -1.0}[hub_hinge]
    assert rods.hub.angle == pytest.approx(math.pi / 2 if hub_hinge == "opening" else -math.pi / 2)
    assert len(rods.stretching.EA) == len(star.edges) and len(rods.bending.EI_over_dl) == len(star.hinges)


@pytest.mark.parametrize("fluid", [None, Water(density=0.0), Water(drag_coefficient=0.0)])
def test_vacuum_has_no_drag(fluid):
    assert not make_rods(Scene(fluid=fluid)).drag.any()


def test_fidelities_go_from_fast_to_exact():
    presets = {name: Numerics.preset(name) for name in FIDELITIES}
    assert presets["chapter"] == Numerics("implicit-euler", 3e-3)
    assert presets["balanced"].scheme == presets["accurate"].scheme == presets["reference"].scheme
    steps = [presets[name].step for name in FIDELITIES[:4]]
    assert steps == sorted(steps, reverse=True)


@pytest.mark.parametrize("part", [Seastar(), Water(), SmaPulse(), Numerics(), Scene(), SAMPLED])
def test_parts_are_frozen_equal_by_value_hashable_and_travel(part):
    name = dataclasses.fields(part)[0].name
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(part, name, getattr(part, name))
    for twin in (dataclasses.replace(part), copy.deepcopy(part), pickle.loads(pickle.dumps(part))):
        assert twin == part and hash(twin) == hash(part)


# Refusals


NOT_POSITIVE = [0.0, -1.0, math.nan, math.inf, -math.inf, "0.1", None, True, 1j, [0.1]]


@pytest.mark.parametrize("value", NOT_POSITIVE, ids=repr)
@pytest.mark.parametrize(
    "kind, name, unit",
    [
        (Seastar, "limb_length", "[m]"),
        (Seastar, "rod_radius", "[m]"),
        (Seastar, "youngs_modulus", "[Pa]"),
        (Seastar, "density", "[kg/m^3]"),
        (SmaPulse, "heating_time", "[s]"),
        (SmaPulse, "cooling_time", "[s]"),
        (Numerics, "step", "[s]"),
        (Numerics, "newton_tolerance", "limb lengths"),
    ],
)
def test_quantities_that_must_be_positive_and_finite_are(kind, name, unit, value):
    with assert_refused(name, "positive", unit, repr(value)):
        kind(**{name: value})


@pytest.mark.parametrize("value", NOT_POSITIVE[1:], ids=repr)
@pytest.mark.parametrize("kind, name", [(Water, "density"), (Water, "drag_coefficient"), (SmaPulse, "peak_angle")])
def test_quantities_that_may_be_zero_are_not_negative(kind, name, value):
    assert getattr(kind(**{name: 0.0}), name) == 0.0
    with assert_refused(name, "not negative", repr(value)):
        kind(**{name: value})


@pytest.mark.parametrize("value", [13, 0, -5, 5.0, "5", None, True, math.nan], ids=repr)
def test_a_seastar_has_one_to_twelve_limbs(value):
    with assert_refused("n_limbs", "whole number", repr(value)):
        Seastar(n_limbs=value)


@pytest.mark.parametrize("value", [1, 0, -1, 10.0, "10", None, False, 10**6], ids=repr)
def test_a_limb_has_two_nodes_or_more(value):
    with assert_refused("nodes_per_limb", "whole number", repr(value)):
        Seastar(nodes_per_limb=value)


@pytest.mark.parametrize("value", [1, 0, -1, 10.0, "10", None, True], ids=repr)
def test_a_stage_may_take_two_iterations_or_more(value):
    with assert_refused("max_iterations", "whole number", repr(value)):
        Numerics(max_iterations=value)


def test_a_tolerance_that_promises_nothing_is_refused():
    with assert_refused("newton_tolerance", "0.01"):
        Numerics(newton_tolerance=0.1)


@pytest.mark.parametrize("name", ["", "Opening", "interior", None, 1])
def test_unknown_hub_hinges_are_refused_with_the_known_ones(name):
    with assert_refused("hub_hinge", "'opening', 'turning'", repr(name)):
        Seastar(hub_hinge=name)


@pytest.mark.parametrize("name", ["", "euler", "SDIRK2", None])
def test_unknown_schemes_are_refused_with_the_known_ones(name):
    with assert_refused("scheme", "'implicit-euler', 'sdirk2', 'sdirk3', 'implicit-midpoint'", repr(name)):
        Numerics(scheme=name)


@pytest.mark.parametrize("name", ["", "exact", None])
def test_unknown_fidelities_are_refused_with_the_known_ones(name):
    with assert_refused("fidelity", *map(repr, FIDELITIES), repr(name)):
        Numerics.preset(name)


@pytest.mark.parametrize(
    "name, value",
    [
        ("robot", None),
        ("robot", Seastar),
        ("fluid", "water"),
        ("fluid", 1000.0),
        ("actuator", None),
        ("numerics", "fast"),
        ("numerics", None),
    ],
)
def test_a_scene_refuses_parts_of_another_kind(name, value):
    with assert_refused(name):
        Scene(**{name: value})


@pytest.mark.parametrize("value", NOT_POSITIVE, ids=repr)
def test_a_path_tolerance_is_one_that_was_measured_and_for_the_implicit_midpoint_rule(value):
    if value is not None:
        with assert_refused("path_tolerance", "0.001 to 0.02"):
            Numerics("implicit-midpoint", path_tolerance=value)
    with assert_refused("path_tolerance", "0.001 to 0.02"):
        Numerics("implicit-midpoint", path_tolerance=0.1)
    with assert_refused("path_tolerance", "implicit-midpoint", "sdirk2"):
        Numerics("sdirk2", path_tolerance=0.01)


@pytest.mark.parametrize("node", [-1, 46, 1.5, "0", True, None], ids=repr)
def test_held_and_loaded_nodes_are_nodes_of_the_robot(node):
    with assert_refused("node", "0 to 45", repr(node)):
        Scene(held_nodes=(node,))
    with assert_refused("node", "0 to 45", repr(node)):
        Scene(loads=((node, 1.0, 0.0),))


@pytest.mark.parametrize("load", [(1, 2.0), (1, math.nan, 0.0), (1, 0.0, math.inf), (1, 1.0, 2.0, 3.0)], ids=repr)
def test_loads_are_finite_forces_in_the_plane(load):
    with assert_refused("load", "F_x, F_y"):
        Scene(loads=(load,))


@pytest.mark.parametrize(
    "arguments",
    [{"held_nodes": 5}, {"loads": (3,)}, {"loads": ((1, "a", 0.0),)}, {"loads": ((1, None, 0.0),)}],
    ids=str,
)
def test_what_is_no_tuple_of_nodes_or_loads_is_refused_with_a_sentence(arguments):
    with assert_refused():
        Scene(**arguments)


@pytest.mark.parametrize("n_limbs", range(3, 13))
def test_peak_angles_that_let_a_hub_hinge_reach_pi_are_refused(n_limbs):
    """Neighbours turned apart by a peak angle each: 2 pi/n_limbs + 2 peak < pi."""
    limit = 0.5 * (math.pi - 2.0 * math.pi / n_limbs)
    robot = Seastar(n_limbs=n_limbs)
    for peak in (limit, limit + 1e-9, 3.0):
        with assert_refused("reach pi", f"{n_limbs} limbs", f"{limit:.4g}"):
            Scene(robot=robot, actuator=SmaPulse(peak_angle=peak))
    assert Scene(robot=robot, actuator=SmaPulse(peak_angle=0.999 * limit)).actuator.peak_angle < limit


def test_the_largest_allowed_peak_still_swims():
    scene = Scene(actuator=SmaPulse(peak_angle=0.999 * 0.3 * math.pi), numerics=Numerics(step=0.01))
    commands = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 5)).reshape(5, -1).T
    simulator = Simulator(scene, len(commands))
    report = simulator.stroke(commands)
    assert not report.status.any() and np.isfinite(simulator.positions).all()


def test_a_turning_hub_refuses_peaks_that_close_it_and_an_opening_hub_allows_crossing_limbs():
    with assert_refused("turning", "above zero"):
        Scene(robot=Seastar(hub_hinge="turning"), actuator=SmaPulse(peak_angle=0.64))
    Scene(robot=Seastar(hub_hinge="turning"), actuator=SmaPulse(peak_angle=math.pi / 5))
    scene = Scene(actuator=SmaPulse(peak_angle=0.8), numerics=Numerics(step=0.01))
    report = Simulator(scene).stroke([[1.0, -1.0, 0.0, 0.0, 0.0]])
    assert report.smallest_opening_angle[0] < 0.0


@pytest.mark.parametrize(
    "scene",
    [
        {"robot": {"rod_radius": 1e-90}},
        {"robot": {"limb_length": 1e300}},
        {"robot": {"youngs_modulus": 1e308}},
        {"robot": {"density": 1e-320}},
    ],
    ids=str,
)
def test_a_scene_refuses_what_has_no_finite_positive_coefficients(scene):
    with assert_refused():
        make_rods(Scene(robot=Seastar(**scene["robot"])))


def test_a_step_too_short_to_count_is_refused():
    with assert_refused("step"):
        Simulator(Scene(numerics=Numerics(step=1e-15)))
