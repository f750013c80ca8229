"""A robot turned by a sector or mirrored is the same robot: observations, commands and actions say so."""

import dataclasses
import math
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from hypothesis import given
from hypothesis import strategies as st

from own_actuators import Remembering
from refusals import assert_refused
from seastar_gym import (
    Attachment,
    Body,
    Contact,
    DomainRandomization,
    Limb,
    Limited,
    MeasuredCurve,
    Numerics,
    Scene,
    Seastar,
    ShearCurrent,
    Simulator,
    SmaLimb,
    SmaPulse,
    SmaWires,
    State,
    ThermalSma,
    Uniform,
    UniformCurrent,
    Vortex,
    Water,
)
from seastar_gym.envs import symmetry
from seastar_gym.envs.commands import command_table, to_commands
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.masks import action_masks
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import (
    Symmetry,
    SymmetryReduction,
    VectorSymmetryReduction,
    require_symmetry,
    symmetry_in,
)
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.actuators.actuator import mirrored
from symmetries import elements_of, matrix, reduced_swim, symmetry_for, turns_and_axis

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
GROUPS = LESSER | {f"{n} limbs": (Scene(Seastar(n, 4)), n, 0.0) for n in N_LIMBS}


@pytest.mark.parametrize("name", GROUPS)
def test_the_group_is_found_from_limbs_body_and_attachments(name):
    """Its elements carry the rest shape onto itself with its limbs in their order, and multiply as their matrices."""
    scene, n_turns, axis = GROUPS[name]
    group = symmetry.symmetry_of(scene)
    assert (n_turns, axis) == pytest.approx(turns_and_axis(group), abs=1e-12)
    nodes, elements = scene.robot.nodes()[1:].reshape(scene.robot.n_limbs, -1, 2), elements_of(group)
    undone = symmetry.inverse(elements, group)
    np.testing.assert_array_equal(symmetry.compose(undone, elements, group), 0)
    np.testing.assert_array_equal(symmetry.compose(elements, undone, group), 0)
    for element in elements:
        carried = nodes @ matrix(element, group).T
        np.testing.assert_allclose(carried[symmetry.limb_order(group)[element]], nodes, atol=1e-15)
        for other in elements:
            product = matrix(symmetry.compose(other, element, group), group)
            np.testing.assert_allclose(product, matrix(other, group) @ matrix(element, group), atol=1e-12)


# Observations


@pytest.mark.parametrize("name", GROUPS)
def test_every_vector_is_carried_by_the_matrix_and_moves_with_its_limb(name):
    scene = GROUPS[name][0]
    group, n_limbs = symmetry.symmetry_of(scene), scene.robot.n_limbs
    elements, order = elements_of(group), symmetry.limb_order(group)
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
    restored = symmetry_for(group).carry(reduced, symmetry.inverse(elements, group))
    np.testing.assert_allclose(restored, observations, atol=1e-14 if dtype is np.float64 else ROUNDING)
    for element in elements_of(group) if dtype is np.float64 else ():
        carried = symmetry_for(group).carry(observations, np.full(500, element))
        np.testing.assert_allclose(symmetry_for(group).reduce(carried)[0], reduced, atol=1e-12)


def test_element_zero_changes_no_bit_and_shares_no_memory():
    observations = observations_of(5, dtype=np.float32)
    same = symmetry_for(5).carry(observations, np.zeros(len(observations), int))
    np.testing.assert_array_equal(same, observations)
    assert not np.shares_memory(same, observations)


def test_one_observation_is_a_batch_without_an_axis():
    observations = observations_of(5)
    batch, elements = symmetry_for(5).reduce(observations)
    for one, reduced, element in zip(observations, batch, elements, strict=True):
        alone, its_element = symmetry_for(5).reduce(one)
        np.testing.assert_array_equal(alone, reduced)
        assert its_element == element and its_element.shape == ()


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


@pytest.mark.parametrize("n_limbs", N_LIMBS)
@pytest.mark.parametrize("behind", [0.0, np.pi])
def test_where_nothing_decides_the_sector_is_that_anticlockwise_of_the_boundary(n_limbs, behind):
    for boundary in range(2 * n_limbs):
        angle = boundary * np.pi / n_limbs
        assert symmetry_for(n_limbs).sectors(aimed(n_limbs, angle, angle + behind)) == boundary


def test_a_waypoint_at_the_hub_lies_in_sector_zero():
    assert symmetry_for(5).sectors(aimed(5, 0.0, 0.0, distance=0.0)) == 0


# Commands and actions


def test_a_mirror_swaps_plus_and_minus():
    straight = np.array([0.0, 1.0, 0.0, 0.0, -1.0])  # {2+, 5-} swims along limb 1, which a mirror at it keeps
    mirror_at_limb_1 = 2 * 5 - 1
    np.testing.assert_array_equal(symmetry.transform_commands(straight, mirror_at_limb_1), straight)
    turn_limb_2_onto_limb_1 = 2
    np.testing.assert_array_equal(
        symmetry.transform_commands(straight, turn_limb_2_onto_limb_1), [1.0, 0.0, 0.0, -1.0, 0.0]
    )


@pytest.mark.parametrize("n_limbs", [3, 4, 5])
@pytest.mark.parametrize("mode", MODES)
def test_action_maps_say_what_the_command_map_says(mode, n_limbs):
    actions = random_actions(mode, n_limbs, 200)
    elements = np.random.default_rng(2).integers(0, 2 * n_limbs, 200)
    carried = symmetry_for(n_limbs, mode=mode).carry_actions(actions, elements)
    np.testing.assert_array_equal(
        to_commands(mode, n_limbs, carried, 200),
        symmetry.transform_commands(to_commands(mode, n_limbs, actions, 200), elements),
    )


@pytest.mark.parametrize("n_limbs", [3, 4, 5])
@pytest.mark.parametrize("mode", MODES)
def test_action_maps_are_a_group_action(mode, n_limbs):
    actions = random_actions(mode, n_limbs, 30)
    everywhere = np.ones(30, int)

    def carry(actions, element):
        return symmetry_for(n_limbs, mode=mode).carry_actions(actions, element * everywhere)

    np.testing.assert_array_equal(carry(actions, 0), actions)
    for first in range(2 * n_limbs):
        for second in range(2 * n_limbs):
            at_once = carry(actions, symmetry.compose(second, first, n_limbs))
            np.testing.assert_array_equal(carry(carry(actions, first), second), at_once)


@pytest.mark.parametrize("group", [5, *(symmetry.symmetry_of(scene) for scene, *_ in LESSER.values())], ids=str)
@pytest.mark.parametrize("mode", MODES)
def test_restored_actions_are_those_before_the_reduction(mode, group):
    actions = random_actions(mode, 5 if group == 5 else 4, 100)
    elements = np.random.default_rng(3).choice(elements_of(group), 100)
    reduced = symmetry_for(group, mode=mode).carry_actions(actions, elements)
    np.testing.assert_array_equal(symmetry_for(group, mode=mode).restore(reduced, elements), actions)


# A policy behind it


def a_policy(reduced):
    """Any function of the reduced observation, and a sensitive one."""
    weights = np.random.default_rng(5).normal(size=(reduced.shape[-1], 243))
    return np.argmax(reduced @ weights, axis=-1)


def swim(path, element, n_strokes=8):
    """Commands and hub positions [m] of a policy behind the reduction, from a crooked state in motion.

    The commands of the first strokes, which are not the policy's, are carried by the element.
    """
    env = gym.make("SeastarSwim-v0", path=path, actions="joint", fidelity="fast").unwrapped
    env.reset(seed=0)
    for action in symmetry_for(5, mode="joint").carry_actions(random_actions("joint", 5, 4), element):
        observation, *_ = env.step(action)
    hubs, commands = [], []
    for _ in range(n_strokes):
        reduced, its_element = symmetry_for(5).reduce(observation)
        action = symmetry_for(5, mode="joint").restore(a_policy(reduced), its_element)
        observation, *_, info = env.step(action)
        hubs.append(info["hub_position"])
        commands.append(env.command_table[action])
    return np.array(hubs), np.array(commands)


@pytest.mark.parametrize("element", range(1, 10))
def test_a_policy_behind_the_reduction_is_equivariant(element):
    """With its world carried by an element, the robot makes the carried swim, with the carried commands."""
    carry = matrix(element, 5)
    path = np.array([[0.03, 0.05], [-0.04, 0.06], [0.02, -0.03]])
    hubs, commands = swim(path, 0)
    assert np.ptp(hubs, axis=0).min() > 1e-3 and len(np.unique(commands, axis=0)) > 1
    carried_hubs, carried_commands = swim(path @ carry.T, element)
    np.testing.assert_array_equal(carried_commands, symmetry.transform_commands(commands, element))
    np.testing.assert_allclose(carried_hubs, hubs @ carry.T, atol=1e-9)


MEMORIES = {
    "wires": SmaWires(period=0.5),
    "refractory": SmaWires(cooling_time=0.6, period=0.3, refractory=True),
    "thermal": ThermalSma(heating_time=0.1, cooling_time=0.4, largest_temperature=60.0),
    "limited": Limited(SmaPulse(), largest_rate=0.4),
    "measured limb": SmaLimb(period=0.5),
}


@pytest.mark.parametrize(
    "actuator, n_limbs, nodes_per_limb",
    [
        *((SmaPulse(), *shape) for shape in ((4, 4), (5, 4), (7, 4), (5, 7))),
        *((actuator, n_limbs, 4) for actuator in MEMORIES.values() for n_limbs in (4, 5)),
    ],
)
def test_a_random_policy_in_the_wrapper_swims_the_carried_way(actuator, n_limbs, nodes_per_limb):
    """From rest, along a carried path, for every element: what is seen, with the memory of actuators, is the same."""
    path = np.array([[0.01, 0.013], [-0.03, 0.02], [0.02, -0.03]])
    numerics, n_actions = Numerics("implicit-midpoint", 0.01, newton_tolerance=1e-10), 1 + n_limbs * (n_limbs - 1)
    scene = Scene(Seastar(n_limbs, nodes_per_limb), actuator=actuator, numerics=numerics)

    def swim_along(path):
        env = SymmetryReduction(gym.make("SeastarSwim-v0", path=path, actions="pairs", scene=scene))
        seen, hubs = [env.reset(seed=0)[0]], []
        weights = np.random.default_rng(6).normal(size=(seen[0].size, n_actions))
        for k in range(10):
            observation, *_, info = env.step((np.argmax(seen[-1] @ weights) + 5 * k) % n_actions)
            seen.append(observation)
            hubs.append(info["hub_position"])
        return np.array(seen), np.array(hubs)

    seen, hubs = swim_along(path)
    n_remembered = n_limbs * len(symmetry.memory_mirror(actuator))
    remembered = seen[1:, -4 - n_remembered : -4]
    assert np.ptp(hubs, axis=0).max() > 1e-3
    assert not n_remembered or (np.abs(remembered).max(axis=1) > 0.01).sum() > 5
    for element in range(1, 2 * n_limbs):
        carry = matrix(element, n_limbs)
        carried_seen, carried_hubs = swim_along(path @ carry.T)
        np.testing.assert_allclose(carried_hubs, hubs @ carry.T, atol=1e-9)
        np.testing.assert_allclose(carried_seen, seen, atol=1e-5)


def test_memory_is_restored_by_the_inverse():
    mirror = symmetry.memory_mirror(ThermalSma())
    assert mirror == ((1, 1), (0, 1), (3, 1), (2, 1)) and symmetry.memory_mirror(SmaPulse()) == ()
    observations = np.random.default_rng(0).normal(size=(50, Layout(5).size + 20))
    reduced, elements = symmetry_for(5, mirror).reduce(observations)
    restored = symmetry_for(5, mirror).carry(reduced, symmetry.inverse(elements, 5))
    np.testing.assert_allclose(restored, observations, atol=1e-14)


# Wrappers

SQUARE_ROBOT = Scene(robot=Seastar(n_limbs=4, nodes_per_limb=4), numerics=Numerics.preset("fast"))
SETTINGS = {"path": "random", "random_heading": True, "scene": SQUARE_ROBOT}


@pytest.mark.parametrize("mode", MODES)
def test_the_wrapper_does_what_the_functions_do(mode):
    plain, wrapped = (gym.make("SeastarSwim-v0", actions=mode, **SETTINGS) for _ in range(2))
    wrapped = SymmetryReduction(wrapped)
    observation, info = plain.reset(seed=3)
    reduced, its_info = wrapped.reset(seed=3)
    for action in random_actions(mode, 4, 6):
        expected, element = symmetry_for(4).reduce(observation)
        np.testing.assert_array_equal(reduced, expected)
        assert wrapped.observation_space.contains(reduced)
        observation, *outcome, info = plain.step(symmetry_for(4, mode=mode).restore(action, element))
        reduced, *its_outcome, its_info = wrapped.step(action)
        assert its_outcome == outcome
        np.testing.assert_array_equal(its_info["hub_position"], info["hub_position"])


@pytest.mark.parametrize("autoreset", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_the_batch_does_what_single_environments_do(autoreset):
    """Over the end of the episodes, with the last observations reduced by elements of their own."""
    n, limit = 3, 5
    batch = VectorSymmetryReduction(
        gym.make_vec(
            "SeastarSwim-v0", n, "vector_entry_point", max_episode_steps=limit, autoreset_mode=autoreset,
            actions="pairs", **SETTINGS,
        )
    )  # fmt: skip
    make = lambda: SymmetryReduction(  # noqa: E731
        gym.make("SeastarSwim-v0", max_episode_steps=limit, actions="pairs", **SETTINGS)
    )
    singles = gym.vector.SyncVectorEnv([make] * n, autoreset_mode=autoreset)
    observations, _ = batch.reset(seed=7)
    np.testing.assert_array_equal(observations, singles.reset(seed=7)[0])
    ends = 0
    for actions in random_actions("pairs", 4, 3 * limit * n).reshape(-1, n):
        observations, *outcome, info = batch.step(actions)
        expected, *expected_outcome, expected_info = singles.step(actions)
        np.testing.assert_array_equal(observations, expected)
        np.testing.assert_array_equal(outcome, expected_outcome)
        for robot in np.flatnonzero(info.get("_final_obs", [])):
            ends += 1
            final = info["final_obs"][robot]
            np.testing.assert_array_equal(final, expected_info["final_obs"][robot])
            assert 0.0 <= direction(final) <= np.pi / 4
            assert not np.array_equal(final, observations[robot])
    assert ends == (9 if autoreset is AutoresetMode.SAME_STEP else 0)


def test_observations_of_the_batch_are_fresh_every_step():
    batch = VectorSymmetryReduction(gym.make_vec("SeastarSwim-v0", 2, "vector_entry_point", **SETTINGS))
    first, _ = batch.reset(seed=0)
    kept = first.copy()
    second, *_ = batch.step(np.ones((2, 4), int))
    np.testing.assert_array_equal(first, kept)
    assert not np.shares_memory(first, second)


def test_the_wrapper_refuses_an_action_that_is_none():
    env = SymmetryReduction(gym.make("SeastarSwim-v0", disable_env_checker=True, **SETTINGS))
    env.reset(seed=0)
    with pytest.raises(ValueError, match="an action is a whole number from 0 to 2"):
        env.step(np.array([0, 1, 2, 3]))
    for action in ([0, 1, 2], 1, [[0, 1], [0]], None, np.zeros((2, 4), int)):
        with pytest.raises(ValueError, match=r'^With actions="limbs" .*\.$'):
            env.step(action)


@pytest.mark.parametrize("mode", MODES)
def test_the_wrapper_of_a_batch_refuses_actions_of_another_number_of_robots(mode):
    batch = VectorSymmetryReduction(SeastarSwimVectorEnv(3, actions=mode, **SETTINGS))
    batch.reset(seed=0)
    for actions in (random_actions(mode, 4, 2), random_actions(mode, 4, 3)[:, None], [[0, 1], [0]]):
        with pytest.raises(ValueError, match=rf'^With actions="{mode}" .*\.$'):
            batch.step(actions)


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
    "limited": Scene(STAR, actuator=Limited(SmaPulse(0.4), 0.35, 1.0)),
}
DRAWS = DomainRandomization({"robot.youngs_modulus": Uniform(5e5, 2e6), "fluid.density": Uniform(900.0, 1100.0)})
WEAK_LIMBS = DomainRandomization({"limb_strengths": Uniform(0.2, 1.0)})
OWN_LENGTHS = DomainRandomization({"robot.limbs.1.length": Uniform(0.05, 0.06)})
ASYMMETRIC = {
    "lengths": (Scene(replace(STAR, limbs=(Limb(length=0.08), Limb(length=0.07), Limb(), Limb()))), None, "not alike"),
    "spread": (Scene(replace(STAR, limbs=tuple(Limb(direction=d) for d in (0.0, 1.5, 3.1, 4.7)))), None, "not alike"),
    "bent": (Scene(replace(STAR, limbs=(Limb(natural_curvature=9.0), Limb(), Limb(), Limb()))), None, "straight"),
    "strengths": (Scene(STAR, limb_strengths=(1.0, 0.5, 1.0, 1.0)), None, "equally strong"),
    "held": (Scene(STAR, held_nodes=(6,)), None, "held"),
    "loads": (Scene(STAR, loads=((0, 1e-4, 0.0),)), None, "loaded"),
    "gravity": (Scene(replace(STAR, density=1050.0), gravity=(0.0, -9.81)), None, "gravity"),
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


def pairs_for(scene, n):
    return random_actions("pairs", scene.robot.n_limbs, n)


@pytest.mark.parametrize(
    "scene, draws, n",
    [
        *(pytest.param(scene, None, 5, id=name) for name, scene in SYMMETRIC.items()),
        pytest.param(SYMMETRIC["five limbs"], DRAWS, 5, id="draws"),
        *(pytest.param(LESSER[name][0], None, 4, id=name) for name in ("all bent", "one longer")),
        *(pytest.param(LESSER[name][0], None, 4, id=name, marks=pytest.mark.slow) for name in ("rectangle", "swirl")),
    ],
)
def test_in_every_accepted_scene_the_world_may_be_turned_and_mirrored(scene, draws, n):
    """The same reduced actions then earn the same rewards."""
    group, actions = symmetry.symmetry_of(scene), pairs_for(scene, n)
    rewards, seen = reduced_swim(scene, draws, np.eye(2), actions)
    assert scene.held_nodes or np.ptp(rewards) > 0.01
    for element in elements_of(group)[1:]:
        its_rewards, its_seen = reduced_swim(scene, draws, matrix(element, group), actions)
        np.testing.assert_allclose(its_rewards, rewards, rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(its_seen, seen, rtol=0.0, atol=2e-5)


@pytest.mark.parametrize("name", ASYMMETRIC)
def test_a_scene_that_is_not_symmetric_is_refused_with_its_reason(name):
    scene, randomization, words = ASYMMETRIC[name]
    arguments = {"scene": replace(scene, numerics=FAST), "randomization": randomization}
    with assert_refused("symmetry of the regular polygon", words):
        SymmetryReduction(SeastarSwimEnv(**arguments))
    with assert_refused("symmetry of the regular polygon", words):
        VectorSymmetryReduction(SeastarSwimVectorEnv(2, **arguments))


def test_strengths_that_are_drawn_alike_for_all_limbs_leave_the_symmetry_as_it_is():
    arguments = {"scene": Scene(STAR, numerics=FAST), "randomization": WEAK_LIMBS}
    seen, _ = SymmetryReduction(SeastarSwimEnv(**arguments)).reset(seed=3)
    batch, _ = VectorSymmetryReduction(SeastarSwimVectorEnv(2, **arguments)).reset(seed=3)
    np.testing.assert_array_equal(batch[0], seen)


def test_a_refusal_names_the_body_if_there_is_one_and_limbs_of_one_number_are_alike():
    uneven = replace(STAR, limbs=(Limb(length=0.08), Limb(length=0.07), Limb(), Limb()))
    with assert_refused("not alike, straight and evenly spread."):
        require_symmetry(Scene(uneven))
    with assert_refused("evenly spread around a body of their symmetry."):
        require_symmetry(Scene(replace(uneven, body=Body(radius=0.02))))
    require_symmetry(Scene(STAR, limb_strengths=(0.5,) * 4), DRAWS)


@pytest.mark.parametrize("mode", ["limbs", "joint", "pairs", "continuous"])
def test_the_symmetry_of_a_scene_is_that_of_its_environment(mode):
    for scene in (Scene(STAR), Scene(STAR, actuator=SmaWires(0.4))):
        found = Symmetry.of(scene, mode)
        assert found == symmetry_in(SeastarSwimEnv(actions=mode, scene=replace(scene, numerics=FAST)))


@pytest.mark.parametrize("name", ASYMMETRIC)
def test_a_refusal_has_its_reason_in_the_swim(name, monkeypatch):
    """Were the scene accepted, the same reduced actions would not earn the same in a world that is turned."""
    scene, randomization, _ = ASYMMETRIC[name]
    actions = pairs_for(scene, 5)
    monkeypatch.setattr(symmetry.wrappers, "require_symmetry", lambda *_: None)
    swims = [reduced_swim(scene, randomization, matrix(element, 4), actions)[0] for element in range(8)]
    assert np.ptp(swims, axis=0).max() > 1e-3


def test_an_ellipse_of_fluid_leaves_a_polygon_what_suits_its_axes():
    """Water that moves along with a hexagon is that of an ellipse: half a turn and mirrors are left of six."""
    corners = tuple((0.02 * math.cos(a), 0.02 * math.sin(a)) for a in np.arange(6) * math.pi / 3.0)
    robot = Seastar(6, 4, body=Body(outline=corners))
    assert symmetry.symmetry_of(Scene(robot)) == 6
    group = symmetry.symmetry_of(Scene(robot, Water(added_mass_coefficient=1.0)))
    assert (group.n_turns, group.axis) == (2, 0.0)


def test_actuators_that_remember_are_refused_unless_they_say_what_a_mirror_does():
    with assert_refused("symmetry of the regular polygon", "remember"):
        SymmetryReduction(SeastarSwimEnv(scene=Scene(actuator=Remembering())))
    SymmetryReduction(SeastarSwimEnv(scene=Scene(actuator=ThermalSma())))


# Actuators with a memory

REMEMBERING = {
    "wires": SmaWires(),
    "refractory wires": SmaWires(refractory=True),
    "thermal": ThermalSma(),
    "hot": ThermalSma(largest_temperature=60.0),
    "limited": Limited(SmaPulse(), 0.5, 2.0),
}


@pytest.mark.parametrize("name", REMEMBERING)
def test_a_carried_robot_swims_the_carried_way(name):
    """State, commands and observations are carried; after a decision, both are the same again."""
    scene = Scene(Seastar(5, 4), actuator=REMEMBERING[name], numerics=FAST)
    mirror, rng = symmetry.memory_mirror(scene.actuator), np.random.default_rng(0)
    assert len(mirror) == {"limited": 1, "thermal": 4, "hot": 4}.get(name, 2)
    simulator, other = Simulator(scene, 10), Simulator(scene, 10)
    elements = np.arange(10)
    for _ in range(3):  # from rest to a state that no symmetry has
        simulator.advance(0.2, np.repeat(rng.uniform(-1, 1, (1, 5)), 10, axis=0))
    for duration in (0.2, 0.5):
        state = simulator.get_state()
        other.set_state(carried_state(state, scene))
        commands = np.repeat(rng.uniform(-1, 1, (1, 5)), 10, axis=0)
        np.testing.assert_array_equal(other.refractory_wires(), carried_wires(simulator.refractory_wires(), elements))
        report = simulator.advance(duration, commands)
        its_report = other.advance(duration, symmetry.transform_commands(commands, elements))
        np.testing.assert_allclose(its_report.heating_time, report.heating_time, rtol=0.0, atol=1e-9)
        expected, found = carried_state(simulator.get_state(), scene), other.get_state()
        np.testing.assert_allclose(found.positions, expected.positions, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(found.actuators, expected.actuators, rtol=0.0, atol=1e-9)
        seen = np.concatenate([np.zeros((10, 182)), simulator.observe_actuators(), np.ones((10, 4))], axis=1)
        carried = symmetry_for(5, mirror).carry(seen, elements)[:, 182:-4]
        np.testing.assert_allclose(carried, other.observe_actuators(), rtol=0.0, atol=1e-9)


def carried_state(state, scene):
    """States of the robots carried by all elements in turn."""
    n_limbs, elements = scene.robot.n_limbs, np.arange(2 * scene.robot.n_limbs)
    order = symmetry.limb_order(n_limbs)

    def carried(vectors):
        turned = np.stack([one @ matrix(element, n_limbs).T for element, one in zip(elements, vectors, strict=True)])
        of_limbs = turned[:, 1:].reshape(len(elements), n_limbs, -1, 2)
        moved = np.stack([one[order[element]] for element, one in zip(elements, of_limbs, strict=True)])
        return np.concatenate([turned[:, :1], moved.reshape(len(elements), -1, 2)], axis=1)

    actuators = np.stack([one[order[element]] for element, one in zip(elements, state.actuators, strict=True)])
    actuators[1::2] = mirrored(scene.actuator, actuators[1::2])
    return State(carried(state.positions), carried(state.velocities), state.time, actuators)


def carried_wires(wires, elements):
    order = symmetry.limb_order(wires.shape[1])
    moved = np.stack([one[order[element]] for element, one in zip(elements, wires, strict=True)])
    moved[1::2] = moved[1::2, :, ::-1]
    return moved


@pytest.mark.parametrize("mode", MODES)
def test_masks_are_carried_with_the_actions(mode):
    """A mask of the carried robot is true for the carried actions of which that of the robot is true."""
    refractory, elements = np.random.default_rng(2).random((10, 5, 2)) < 0.3, np.arange(10)
    masks = symmetry_for(5, mode=mode).carry_masks(action_masks(mode, refractory), elements)
    np.testing.assert_array_equal(masks, action_masks(mode, carried_wires(refractory, elements)))


@pytest.mark.parametrize("mode", MODES)
def test_the_wrappers_have_the_masks_of_the_reduced_robot(mode):
    """A reduced action that the mask forbids is one that would not be followed."""
    scene = Scene(STAR, actuator=SmaWires(0.4, refractory=True), numerics=FAST)
    arguments = {"actions": mode, "scene": scene, "decision_period": 0.2, "path": [[-0.05, -0.02], [0.1, 0.1]]}
    env = SymmetryReduction(SeastarSwimEnv(**arguments))
    batch = VectorSymmetryReduction(SeastarSwimVectorEnv(2, **arguments))
    env.reset(seed=0)
    batch.reset(seed=0)
    for action in random_actions(mode, 4, 6):
        masks = env.action_masks()
        np.testing.assert_array_equal(batch.action_masks(), [masks, masks])
        *_, info = env.step(action)
        *_, its_info = batch.step(np.array([action, action]))
        assert (info["masked_limbs"] == 0) == followed_as_a_whole(action, masks, mode)
        np.testing.assert_array_equal(its_info["action_mask"][0], info["action_mask"])
        np.testing.assert_array_equal(info["action_mask"], env.action_masks())


def followed_as_a_whole(action, mask, mode):
    if mode == "limbs":
        return all(mask.reshape(-1, 3)[limb, choice] for limb, choice in enumerate(action))
    if mode == "continuous":
        return all(mask.reshape(-1, 2)[limb, int(share < 0)] for limb, share in enumerate(action) if share)
    return bool(mask[action])


def test_unobserved_memory_is_not_carried():
    """The environment without it is symmetric all the same."""
    env = SymmetryReduction(SeastarSwimEnv(decision_period=0.5, observe_actuators=False))
    assert env.reset(seed=0)[0].shape == (186,)


def test_every_robot_of_a_batch_has_to_be_symmetric():
    bent = Limb(natural_curvature=np.array([0.0, 0.0, 9.0]))
    with assert_refused("symmetry of the regular polygon", "straight"):
        one_bent = Scene(replace(STAR, limbs=(bent, Limb(), Limb(), Limb())))
        VectorSymmetryReduction(SeastarSwimVectorEnv(3, scene=one_bent))
    alike = Seastar(4, 4, limb_length=np.array([0.1, 0.11, 0.12]))
    VectorSymmetryReduction(SeastarSwimVectorEnv(3, scene=Scene(alike)))
