"""Scenes that cannot be modelled are refused in one sentence."""

import math

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Limb, Numerics, Scene, Seastar, Simulator, SmaPulse
from seastar_gym.model.rods import make_rods

FIDELITIES = ("fast", "balanced", "accurate", "reference", "chapter")


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


@pytest.mark.parametrize("scheme", ["implicit-euler", "sdirk2", "sdirk3"])
def test_numerical_damping_is_for_the_implicit_midpoint_rule(scheme):
    with assert_refused("damping", "implicit-midpoint", scheme):
        Numerics(scheme, damping=0.002)
    assert Numerics(scheme, damping=0).damping == 0.0


def test_a_path_tolerance_is_for_the_implicit_midpoint_rule():
    with assert_refused("path_tolerance", "implicit-midpoint", "sdirk2"):
        Numerics("sdirk2", path_tolerance=0.01)


@pytest.mark.parametrize("node", [-1, 56, 1.5, "0", True, None], ids=repr)
def test_held_and_loaded_nodes_are_nodes_of_the_robot(node):
    with assert_refused("node", "0 to 55", repr(node)):
        Scene(held_nodes=(node,))
    with assert_refused("node", "0 to 55", repr(node)):
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


def test_whose_coefficients_overflow_is_told_in_the_numbers_that_they_are_made_of():
    limbs = tuple(Limb(direction=2.0 * math.pi * j / 12, radius=(1e-3, 1e-90), youngs_modulus=1e6) for j in range(12))
    with assert_refused("limbs 0.1 m long", "radii of 1e-90 to 0.001 m", "moduli of 1e+06 Pa", "1100 kg/m^3"):
        Scene(robot=Seastar(12, limbs=limbs, density=1100.0))


def test_a_step_too_short_to_count_is_refused():
    with assert_refused("step"):
        Simulator(Scene(numerics=Numerics(step=1e-15)))
