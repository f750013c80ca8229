"""A robot turned by a sector or mirrored is the same robot: observations, commands and actions say so."""

import dataclasses
import math
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from own_actuators import Remembering
from own_terms import Trap
from refusals import assert_refused
from seastar_gym import (
    Attachment,
    Body,
    Contact,
    DomainRandomization,
    HeadingTargets,
    Limb,
    Limited,
    MeasuredCurve,
    Numerics,
    Scene,
    Seastar,
    ShearCurrent,
    Sight,
    SmaLimb,
    SmaPulse,
    SmaWires,
    ThermalSma,
    Uniform,
    UniformCurrent,
    Vortex,
    Water,
)
from seastar_gym.envs import symmetry
from seastar_gym.envs.commands import command_table, to_commands
from seastar_gym.envs.group import inverse, limb_order, transform_commands
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import SymmetryReduction, VectorSymmetryReduction
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from symmetries import compose, elements_of, matrix, reduced_swim, symmetry_for, turns_and_axis

N_LIMBS = (3, 4, 5, 7, 8)
MODES = ("limbs", "joint", "pairs", "continuous")
ROUNDING = 2e-6  # of float32 observations of order one


def observations_of(n_limbs, n=50, dtype=np.float64, seed=0):
    return np.random.default_rng(seed).normal(size=(n, Layout(n_limbs).size)).astype(dtype)


def random_actions(mode, n_limbs, n, seed=1):
    rng = np.random.default_rng(seed)
    if mode == "limbs":
        return rng.integers(0, 3, (n, n_limbs))
    if mode == "continuous":
        return rng.uniform(-1.0, 1.0, (n, n_limbs))
    return rng.integers(0, len(command_table(mode, n_limbs)), n)


def direction(observations):
    return np.arctan2(observations[..., -3], observations[..., -4])


# The group

FAST = Numerics.preset("fast")
STAR = Seastar(4, 4)
WIDE = tuple(Attachment(x, y, math.atan2(y, 0.3 * x)) for x, y in ((0.03, -0.015), (0.03, 0.015), (-0.03, 0.015),
                                                                   (-0.03, -0.015)))  # fmt: skip
SWIRL = tuple(Attachment(0.02 * math.cos(a), 0.02 * math.sin(a), a + 0.5) for a in np.arange(4) * math.pi / 2.0)
HEXAGON = Body(outline=tuple((0.02 * math.cos(a), 0.02 * math.sin(a)) for a in np.arange(6) * math.pi / 3.0))
LESSER = {
    "all bent": (Scene(replace(STAR, limbs=(Limb(natural_curvature=9.0),) * 4)), 4, None),
    "one longer": (Scene(replace(STAR, limbs=(Limb(), Limb(length=0.07), Limb(), Limb()))), 1, 0.5 * math.pi),
    "two bent": (Scene(replace(STAR, limbs=(Limb(natural_curvature=9.0), Limb(natural_curvature=-9.0)) * 2)), 2,
                 0.25 * math.pi),
    "rectangle": (Scene(replace(STAR, body=Body.rectangle(0.06, 0.03, attachments=WIDE))), 2, 0.0),
    "swirl": (Scene(replace(STAR, body=Body(radius=0.02, attachments=SWIRL))), 4, None),
    "lopsided": (Scene(replace(STAR, body=Body(radius=0.02, centre_of_mass=(4e-3, 0.0)))), 1, 0.0),
    "plate in water": (Scene(replace(STAR, body=Body.rectangle(0.04, 0.04, drag_along=0.3))), 2, 0.0),
}  # fmt: skip
"""Scene, its number of turns, and the direction of its mirror's line."""
ELLIPSE = Water(added_mass_coefficient=1.0)
"""Water that moves along with a hexagon is that of an ellipse: half a turn and mirrors are left of six."""
GROUPS = (
    LESSER
    | {
        "hexagon": (Scene(Seastar(6, 4, body=HEXAGON)), 6, 0.0),
        "hexagon in heavy water": (Scene(Seastar(6, 4, body=HEXAGON), ELLIPSE), 2, 0.0),
    }
    | {f"{n} limbs": (Scene(Seastar(n, 4)), n, 0.0) for n in N_LIMBS}
)


@pytest.mark.parametrize("name", GROUPS)
def test_the_group_is_found_from_limbs_body_and_attachments(name):
    """Its elements carry the rest shape onto itself with its limbs in their order, and multiply as their matrices."""
    scene, n_turns, axis = GROUPS[name]
    group = symmetry.symmetry_of(scene)
    assert (n_turns, axis) == pytest.approx(turns_and_axis(group), abs=1e-12)
    nodes, elements = scene.robot.nodes()[1:].reshape(scene.robot.n_limbs, -1, 2), elements_of(group)
    undone = inverse(elements, group)
    np.testing.assert_array_equal(compose(undone, elements, group), 0)
    np.testing.assert_array_equal(compose(elements, undone, group), 0)
    for element in elements:
        carried = nodes @ matrix(element, group).T
        np.testing.assert_allclose(carried[limb_order(group)[element]], nodes, atol=1e-15)
        for other in elements:
            product = matrix(compose(other, element, group), group)
            np.testing.assert_allclose(product, matrix(other, group) @ matrix(element, group), atol=1e-12)


# Observations


@pytest.mark.parametrize("name", GROUPS)
def test_every_vector_is_carried_by_the_matrix_and_moves_with_its_limb(name):
    scene = GROUPS[name][0]
    group, n_limbs = symmetry.symmetry_of(scene), scene.robot.n_limbs
    elements, order = elements_of(group), limb_order(group)
    observations = observations_of(n_limbs, n=len(elements))
    carried = symmetry_for(group).carry(observations, elements)
    for element, before, after in zip(elements, observations, carried, strict=True):
        before, after = before.reshape(-1, 2), after.reshape(-1, 2)
        expected = before @ matrix(element, group).T
        n_stations = (len(expected) - 3) // 2
        for block in (slice(0, n_stations), slice(n_stations, 2 * n_stations)):
            limbs = expected[block].reshape(n_limbs, -1, 2)
            np.testing.assert_allclose(after[block].reshape(n_limbs, -1, 2), limbs[order[element]], atol=1e-14)
        np.testing.assert_allclose(after[2 * n_stations :], expected[2 * n_stations :], atol=1e-14)


@pytest.mark.parametrize("name", GROUPS)
@pytest.mark.parametrize("dtype, atol", [(np.float64, 1e-12), (np.float32, ROUNDING)])
def test_reduced_waypoints_lie_in_sector_zero_and_carried_robots_are_not_told_apart(name, dtype, atol):
    scene, n_turns, axis = GROUPS[name]
    group, observations = symmetry.symmetry_of(scene), observations_of(scene.robot.n_limbs, 500, dtype)
    reduced, elements = symmetry_for(group).reduce(observations)
    assert reduced.dtype == dtype and set(elements) == set(elements_of(group))
    width = (2.0 if axis is None else 1.0) * np.pi / n_turns
    assert ((direction(reduced) - (axis or 0.0) + atol) % (2.0 * np.pi)).max() <= width + 2.0 * atol
    restored = symmetry_for(group).carry(reduced, inverse(elements, group))
    np.testing.assert_allclose(restored, observations, atol=1e-14 if dtype is np.float64 else ROUNDING)
    for element in elements_of(group) if dtype is np.float64 else ():
        carried = symmetry_for(group).carry(observations, np.full(500, element))
        np.testing.assert_allclose(symmetry_for(group).reduce(carried)[0], reduced, atol=1e-12)


# Boundaries


def aimed(n_limbs, current, following, distance=1.0):
    """An observation with the waypoints in these directions [rad]."""
    observation = observations_of(n_limbs, n=1, dtype=np.float32)[0]
    observation[-4:] = np.array([np.cos(current), np.sin(current), np.cos(following), np.sin(following)]) * distance
    return observation


@given(n_limbs=st.sampled_from(N_LIMBS), boundary=st.integers(0, 30), left=st.booleans(), noise=st.floats(-2e-7, 2e-7))
def test_on_a_boundary_the_next_waypoint_decides_and_rounding_does_not(n_limbs, boundary, left, noise):
    width = np.pi / n_limbs
    angle = boundary * width
    observation = aimed(n_limbs, angle + noise, angle + (1.0 if left else -1.0))
    assert symmetry_for(n_limbs).sectors(observation) == (boundary if left else boundary - 1) % (2 * n_limbs)


# Commands and actions


@pytest.mark.parametrize("n_limbs", [3, 4, 5])
@pytest.mark.parametrize("mode", MODES)
def test_action_maps_say_what_the_command_map_says_and_are_a_group_action(mode, n_limbs):
    actions, everywhere = random_actions(mode, n_limbs, 30), np.ones(30, int)

    def carry(actions, element):
        return symmetry_for(n_limbs, mode=mode).carry_actions(actions, element * everywhere)

    np.testing.assert_array_equal(carry(actions, 0), actions)
    for first in range(2 * n_limbs):
        carried = to_commands(mode, n_limbs, carry(actions, first), 30)
        commands = to_commands(mode, n_limbs, actions, 30)
        np.testing.assert_array_equal(carried, transform_commands(commands, first * everywhere))
        for second in range(2 * n_limbs):
            at_once = carry(actions, compose(second, first, n_limbs))
            np.testing.assert_array_equal(carry(carry(actions, first), second), at_once)


# Which scenes are symmetric

TAPERED = replace(STAR, limbs=(Limb(length=0.09, radius=(2e-3, 1e-3)),) * 4)
EVERYTHING = Scene(
    replace(STAR, relaxation_time=1e-3),
    Water(tangential_drag_coefficient=0.1, added_mass_coefficient=1.0),
    contact=Contact(),
    limb_strengths=(0.9,) * 4,
)
SYMMETRIC = {
    "three limbs": Scene(Seastar(3, 4), actuator=SmaPulse(0.3)),
    "five limbs": Scene(Seastar(5, 4)),
    "turning hub": Scene(Seastar(4, 4, hub_hinge="turning", discretisation="chapter"), actuator=SmaPulse(0.4)),
    "rod": Scene(Seastar(2, 4, hub_hinge="turning", discretisation="chapter"), actuator=SmaPulse(0.4)),
    "profiles": Scene(TAPERED),
    "curve": Scene(STAR, actuator=MeasuredCurve((0.0, 0.2, 1.0), (0.0, 0.5, 0.0))),
    "every term": EVERYTHING,
    "held hub": Scene(STAR, held_nodes=(0,)),
    "wires": Scene(STAR, actuator=SmaWires(0.4)),
    "refractory wires": Scene(STAR, actuator=SmaWires(0.4, refractory=True, period=0.5)),
    "thermal": Scene(STAR, actuator=ThermalSma(0.4, cooling_time=0.4)),
    "hot": Scene(STAR, actuator=ThermalSma(0.4, cooling_time=0.4, largest_temperature=60.0)),
    "limited": Scene(STAR, actuator=Limited(SmaPulse(0.4), 0.35, 1.0)),
    "measured limb": Scene(STAR, actuator=SmaLimb(period=0.5)),
    "seven limbs": Scene(Seastar(7, 4)),
    "seven nodes": Scene(Seastar(5, 7)),
    "five limbs in time": Scene(Seastar(5, 4), actuator=SmaWires()),
}
OPTIONS = {
    **{f"seen as {sees}": lambda sign, sees=sees: {"sight": Sight(7.0, 0.1, sees=sees)} for sees in ("pose", 1, 3, 9)},
    "seen late": lambda sign: {"sight": Sight(7.0, 0.1, sees="nodes")},
    "headings": lambda sign: {"headings": HeadingTargets((0.1 * sign, -sign, 3.0 * sign))},
}
"""Options of an environment of wires that decides every half second; headings change their sign in a mirror."""
DRAWS = DomainRandomization({"robot.youngs_modulus": Uniform(5e5, 2e6), "fluid.density": Uniform(900.0, 1100.0)})
OWN_LENGTHS = DomainRandomization({"robot.limbs.1.length": Uniform(0.05, 0.06)})
ASYMMETRIC = {
    "lengths": (Scene(replace(STAR, limbs=(Limb(length=0.08), Limb(length=0.07), Limb(), Limb()))), None, "not alike"),
    "spread": (Scene(replace(STAR, limbs=tuple(Limb(direction=d) for d in (0.0, 1.5, 3.1, 4.7)))), None, "not alike"),
    "bent": (Scene(replace(STAR, limbs=(Limb(natural_curvature=9.0), Limb(), Limb(), Limb()))), None, "straight"),
    "strengths": (Scene(STAR, limb_strengths=(1.0, 0.5, 1.0, 1.0)), None, "equally strong"),
    "held": (Scene(STAR, held_nodes=(6,)), None, "held"),
    "loads": (Scene(STAR, loads=((0, 1e-4, 0.0),)), None, "loaded"),
    "gravity": (Scene(replace(STAR, density=1050.0), gravity=(0.0, -9.81)), None, "gravity"),
    "own terms": (Scene(STAR, terms=(Trap(k=0.05, x=0.05),)), None, "isotropic"),
    "uniform current": (Scene(STAR, Water(current=UniformCurrent(2e-3))), None, "current"),
    "shear": (Scene(STAR, Water(current=ShearCurrent(0.05))), None, "current"),
    "vortex": (Scene(STAR, Water(current=Vortex(1e-3))), None, "current"),
    "drawn lengths": (Scene(TAPERED), OWN_LENGTHS, "robot.limbs.1.length is drawn"),
}
"""Scene, draws, and words of the refusal."""


def test_every_field_of_a_scene_but_its_numerics_is_tried():
    scenes = [*SYMMETRIC.values(), *(scene for scene, _, _ in ASYMMETRIC.values())]
    names = {field.name for field in dataclasses.fields(Scene)}
    tried = {name for name in names for scene in scenes if getattr(scene, name) != getattr(Scene(), name)}
    assert tried == names - {"numerics"}


SLOW = ("rectangle", "swirl")


def pairs_for(scene, n):
    return random_actions("pairs", scene.robot.n_limbs, n)


@pytest.mark.parametrize(
    "scene, draws, options",
    [
        *(pytest.param(scene, None, None, id=name) for name, scene in SYMMETRIC.items()),
        pytest.param(SYMMETRIC["five limbs"], DRAWS, None, id="draws"),
        *(pytest.param(SYMMETRIC["five limbs in time"], None, options, id=name) for name, options in OPTIONS.items()),
        *(
            pytest.param(LESSER[name][0], None, None, id=name, marks=[pytest.mark.slow] * (name in SLOW))
            for name in ("all bent", "one longer", *SLOW)
        ),
    ],
)
def test_in_every_accepted_scene_the_world_may_be_turned_and_mirrored(scene, draws, options):
    """The same reduced actions then see and earn the same, but for the noise of cameras."""
    group, swims = symmetry.symmetry_of(scene), []
    for element in elements_of(group):
        more = {"decision_period": 0.5, **options(1.0 - 2.0 * (element % 2))} if options else {}
        swims.append(reduced_swim(scene, draws, matrix(element, group), pairs_for(scene, 5), **more))
    rewards, seen = swims[0]
    assert scene.held_nodes or np.ptp(rewards) > 0.01
    rounding = (1e-4, 2e-4) if options and "sight" in more else (1e-6, 2e-5)
    for its_rewards, its_seen in swims[1:]:
        np.testing.assert_allclose(its_rewards, rewards, rtol=0.0, atol=rounding[0])
        np.testing.assert_allclose(its_seen, seen, rtol=0.0, atol=rounding[1])


@pytest.mark.parametrize("name", ASYMMETRIC)
def test_a_scene_that_is_not_symmetric_is_refused_with_its_reason(name):
    scene, randomization, words = ASYMMETRIC[name]
    arguments = {"scene": replace(scene, numerics=FAST), "randomization": randomization}
    with assert_refused("symmetry of the regular polygon", words):
        SymmetryReduction(SeastarSwimEnv(**arguments))
    with assert_refused("symmetry of the regular polygon", words):
        VectorSymmetryReduction(SeastarSwimVectorEnv(2, **arguments))


@pytest.mark.parametrize(
    "wrap, name",
    [(gym.wrappers.ClipAction, "ClipAction"), (gym.wrappers.NormalizeObservation, "NormalizeObservation"),
     (lambda env: gym.wrappers.FrameStackObservation(env, 3), "FrameStackObservation"),
     (SymmetryReduction, "SymmetryReduction")],
)  # fmt: skip
def test_what_changes_observations_or_actions_belongs_around_the_reduction(wrap, name):
    """What has no effect may be below it."""
    SymmetryReduction(gym.wrappers.FlattenObservation(SeastarSwimEnv(fidelity="fast")))
    env = gym.make("SeastarSwimContinuous-v0", fidelity="fast")
    with assert_refused(f"put {name} around it"):
        SymmetryReduction(wrap(env))
    if hasattr(gym.wrappers.vector, name):
        batch = SeastarSwimVectorEnv(2, actions="continuous", fidelity="fast")
        with assert_refused(f"put {name} around it"):
            VectorSymmetryReduction(getattr(gym.wrappers.vector, name)(batch))


def test_actuators_that_remember_say_what_a_mirror_does_and_every_robot_of_a_batch_has_to_be_symmetric():
    with assert_refused("symmetry of the regular polygon", "remember"):
        SymmetryReduction(SeastarSwimEnv(scene=Scene(actuator=Remembering())))
    bent = Limb(natural_curvature=np.array([0.0, 0.0, 9.0]))
    with assert_refused("symmetry of the regular polygon", "straight"):
        one_bent = Scene(replace(STAR, limbs=(bent, Limb(), Limb(), Limb())))
        VectorSymmetryReduction(SeastarSwimVectorEnv(3, scene=one_bent))
    alike = Seastar(4, 4, limb_length=np.array([0.1, 0.11, 0.12]))
    VectorSymmetryReduction(SeastarSwimVectorEnv(3, scene=Scene(alike)))
