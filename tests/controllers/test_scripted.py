"""The scripted gaits do what the chapter says, in every action mode, alone and in batches."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

from seastar_gym import HeadingTargets, Numerics, Scene, Simulator
from seastar_gym.controllers.scripted import GAITS, OpenLoopPolicy, RandomPolicy, scripted, to_actions
from seastar_gym.controllers.turning import TurnThenSwim
from seastar_gym.envs.commands import action_space, command_table, to_commands
from seastar_gym.envs.layout import HEADINGS, Layout
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import transform_commands
from seastar_gym.evaluation.swim import swim
from seastar_gym.gaits import pentagon_gait, straight_gait, timed, turning_wave

MODES = ["limbs", "joint", "pairs"]
OBSERVATION = np.zeros(186, np.float32)
SECOND_ORDER = Scene(numerics=Numerics(scheme="sdirk2", step=10e-3))


def steps_of(commands, scene=SECOND_ORDER):
    """Hub positions [m] at rest and after every stroke, shape (n_strokes + 1, 2)."""
    simulator = Simulator(scene, threads=1)
    simulator.reset()
    hub = [simulator.hub_position()[0]]
    for command in commands:
        simulator.stroke(command[None])
        hub.append(simulator.hub_position()[0])
    return np.array(hub)


def strokes_of(policy, n_strokes, observation=OBSERVATION):
    """Actions of a number of strokes from the start."""
    actions, state = [], None
    for _ in range(n_strokes):
        action, state = policy.predict(observation, state)
        actions.append(action)
    return np.array(actions)


# The chapter's swims


def test_pentagon_gait_is_the_sequence_of_13_15():
    gait = pentagon_gait()
    assert gait.shape == (250, 5)
    assert np.all(gait.sum(axis=1) == 0.0)
    sides = gait.reshape(5, 50, 5)
    heated = [set((1 + np.flatnonzero(side[0])).tolist()) for side in sides]
    assert heated == [{2, 5}, {1, 3}, {2, 4}, {3, 5}, {1, 4}]
    assert np.all(sides[:, :45] == sides[:, :1])
    assert np.all(sides[:, 45:] == 0.0)


def test_pentagon_gait_traces_a_regular_pentagon_that_closes():
    corners = steps_of(pentagon_gait())[::50]
    sides = np.diff(corners, axis=0)
    lengths = np.hypot(*sides.T)
    turns = np.degrees(np.diff(np.unwrap(np.arctan2(sides[:, 1], sides[:, 0]))))
    assert lengths.mean() == pytest.approx(0.1439, abs=2e-4)
    np.testing.assert_allclose(lengths, lengths.mean(), rtol=5e-4)
    np.testing.assert_allclose(turns, 72.0, atol=0.05)
    assert np.hypot(*corners[-1]) < 0.2e-3


def test_straight_gait_moves_along_x_and_not_sideways():
    hub = steps_of(np.repeat(straight_gait(), 3, axis=0))
    assert np.all(np.diff(hub[:, 0]) > 3e-3)
    assert np.all(np.abs(hub[:, 1]) < 1e-10)


# Policies


@pytest.mark.parametrize("actions", MODES)
def test_every_action_mode_means_the_same_commands(actions):
    chosen = strokes_of(scripted("pentagon", actions), 251)
    space = action_space(actions, 5)
    assert all(action in space for action in chosen)
    np.testing.assert_array_equal(
        to_commands(actions, 5, chosen, 251), np.concatenate([pentagon_gait(), straight_gait()])
    )


@pytest.mark.parametrize("actions", MODES)
def test_one_robot_and_a_batch_get_the_same_actions(actions):
    gait = scripted("pentagon", actions)
    alone = strokes_of(gait, 60)
    batch = strokes_of(gait, 60, np.zeros((3, 186), np.float32))
    assert batch.shape == (60, 3, *action_space(actions, 5).shape)
    for robot in range(3):
        np.testing.assert_array_equal(batch[:, robot], alone)


def test_episode_start_begins_the_gait_anew_for_that_robot_alone():
    gait, batch = scripted("pentagon", "pairs"), np.zeros((2, 186), np.float32)
    _, state = gait.predict(batch, (np.array([48, 49]),))
    action, state = gait.predict(batch, state, episode_start=np.array([False, True]))
    rest, first_side = to_actions(np.zeros(5), "pairs", 5), to_actions(straight_gait()[0], "pairs", 5)
    np.testing.assert_array_equal(action, [rest, first_side])
    np.testing.assert_array_equal(state[0], [50, 1])


NO_STATES = (
    *((made,) for made in (np.zeros(2), [0, 0], np.zeros(3, int), np.zeros(1, int), np.zeros((2, 1), int))),
    np.zeros(2, int), (np.zeros(2, int),) * 2,
)  # fmt: skip


@pytest.mark.parametrize("state", NO_STATES, ids=str)
def test_a_state_that_no_call_gave_is_refused(state):
    with pytest.raises(ValueError, match=r"decisions made of shape \(2,\)\.$"):
        scripted("pentagon").predict(np.zeros((2, 186), np.float32), state)


@pytest.mark.parametrize("commands", [np.zeros(5), np.zeros((0, 5)), np.zeros((1, 1, 5))], ids=np.shape)
def test_what_are_no_commands_is_refused(commands):
    with pytest.raises(ValueError, match="commands"):
        OpenLoopPolicy(commands)


def test_two_episodes_can_share_one_gait():
    gait = scripted("pentagon")
    first, second = strokes_of(gait, 60), strokes_of(gait, 60)
    np.testing.assert_array_equal(first, second)


def test_stable_baselines3_can_evaluate_a_gait():
    env = Monitor(gym.make("SeastarSwim-v0", path=[[0.02, 0.0]], waypoint_radius=2e-3, fidelity="fast"))
    rewards, lengths = evaluate_policy(scripted("straight"), env, n_eval_episodes=2, return_episode_rewards=True)
    assert lengths[0] == lengths[1] < 10
    assert rewards[0] == rewards[1] > 0.0


@pytest.mark.parametrize("actions", MODES)
def test_random_actions_follow_their_generator_and_reach_every_choice(actions):
    batch = np.zeros((1000, 186), np.float32)
    first, second = (scripted("random", actions, rng=np.random.default_rng(3)).predict(batch)[0] for _ in range(2))
    np.testing.assert_array_equal(first, second)
    n_choices = {"limbs": 3, "joint": 243, "pairs": 21}[actions]
    assert first.shape == (1000, *action_space(actions, 5).shape)
    assert len(np.unique(first)) > 0.95 * n_choices
    alone, state = scripted("random", actions).predict(OBSERVATION)
    assert alone in action_space(actions, 5)
    assert state is None


def test_resting_heats_no_limb():
    np.testing.assert_array_equal(strokes_of(scripted("rest"), 2), np.zeros((2, 5)))


@pytest.mark.parametrize("name", ["4+,1-", "1-,4+", "{1-, 4+}"])
def test_a_pair_may_be_written_as_in_the_chapter(name):
    np.testing.assert_array_equal(strokes_of(scripted(name), 1), [[2, 0, 0, 1, 0]])


def test_gaits_fit_robots_of_other_limbs():
    action, _ = scripted("straight", n_limbs=6).predict(OBSERVATION)
    np.testing.assert_array_equal(action, [0, 1, 0, 0, 0, 2])


# Refusals


@pytest.mark.parametrize("name", ["pentagram", "", "2+", "2+,5+", "2-,5-", "a+,b-", "1+,2-,3+"])
def test_an_unknown_name_is_answered_with_the_known_ones(name):
    with pytest.raises(ValueError, match="Unknown scripted agent") as refusal:
        scripted(name)
    assert all(known in str(refusal.value) for known in GAITS)


@pytest.mark.parametrize("name", ["1+,1-", "1+,6-", "0+,1-"])
def test_a_pair_needs_two_limbs_of_the_robot(name):
    with pytest.raises(ValueError, match="two different limbs from 1 to 5"):
        scripted(name)


def test_continuous_actions_are_shares_for_one_robot_or_many():
    rng, policy = np.random.default_rng(3), RandomPolicy(np.random.default_rng(3), "continuous", 4)
    for shape in ((3, 4), (4,)):
        action, state = policy.predict(np.zeros((*shape[:-1], 7), np.float32))
        np.testing.assert_array_equal(action, rng.uniform(-1.0, 1.0, shape).astype(np.float32))
        assert action.dtype == np.float32 and state is None
    shares = to_actions([[0.5, -0.25]], "continuous", 2)
    assert shares.dtype == np.float32 and shares.tolist() == [[0.5, -0.25]]


def test_gaits_that_turn_are_for_five_limbs_and_decide_as_often_as_asked():
    np.testing.assert_array_equal(GAITS["wave"](5, 0.2), turning_wave(0.2))
    np.testing.assert_array_equal(GAITS["pentagon"](5, 0.5), timed(pentagon_gait(), 0.5))
    for name in ("pentagon", "wave", "lagged-pentagon"):
        with pytest.raises(ValueError, match=r"are for five limbs, not 4\.$"):
            GAITS[name](4, 0.5)
    assert scripted("rest", n_limbs=3).predict(OBSERVATION)[0].tolist() == [0, 0, 0]
    modes = [scripted(name, decision_period=0.1).actions for name in ("thrifty", "lagged")]
    assert modes == ["continuous", "limbs"]


# An agent that turns to the asked heading by a gait, and swims once it has it.


AT = Layout.of(Scene(), entries=HEADINGS)
CLOCKWISE = np.array([[1, -1, 0, 0, 0], [0, 0, 1, -1, 0], [0, 0, 0, 0, 1]], float)
SWIMS = np.array([0, 1, 0, 0, -1], float)


class Swimmer:
    """Policy of pairs that swims straight, and keeps what it was shown."""

    def __init__(self) -> None:
        self.shown: list[Any] = []

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert deterministic
        self.shown.append(observation)
        return np.int64((command_table("pairs", 5) == SWIMS).all(axis=1).argmax()), None


def seen(left: float) -> np.ndarray:
    """Observation of a robot that has to turn by so much [rad]."""
    numbers = np.random.default_rng(0).normal(size=AT.size).astype(np.float32)
    numbers[AT.headings] = np.cos(left), np.sin(left), 1.0, 0.0
    return numbers


def agent(swimmer: Swimmer | None = None) -> TurnThenSwim:
    return TurnThenSwim(CLOCKWISE, swimmer or Swimmer(), "pairs", Scene(), HeadingTargets(tolerance=0.2), 0.5)


def commands_of(policy: TurnThenSwim, lefts: list[float]) -> list[list[float]]:
    """Commands of decisions, one after the other, with so much left to turn [rad]."""
    state, found = None, []
    for left in lefts:
        action, state = policy.predict(seen(left), state)
        found.append(command_table("joint", 5)[action].tolist())
    return found


def test_it_turns_by_the_gait_to_the_side_where_the_heading_lies():
    assert commands_of(agent(), [-1.0] * 4) == [*CLOCKWISE.tolist(), CLOCKWISE[0].tolist()]
    mirrored = transform_commands(CLOCKWISE, 9)
    assert commands_of(agent(), [1.0] * 4) == [*mirrored.tolist(), mirrored[0].tolist()]
    assert mirrored[0].tolist() == [-1, 0, 0, 0, 1]  # limb 1 stays, and 2 becomes 5


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_turning_begins_above_nine_tenths_of_the_tolerance_and_ends_below_four_tenths(side):
    lefts = [0.179, 0.181, 0.1, 0.081, 0.079, 0.1, 0.179, 0.2]
    found = commands_of(agent(), [side * left for left in lefts])
    assert [command != SWIMS.tolist() for command in found] == [False, True, True, True, False, False, False, True]
    assert found[1] == found[7]  # the gait begins anew


def test_the_swimmer_sees_nothing_of_headings():
    swimmer = Swimmer()
    commands_of(agent(swimmer), [0.1, 1.0])
    (shown,) = swimmer.shown
    np.testing.assert_array_equal(shown, np.delete(seen(0.1), AT.headings))


class Resting:
    """Swimmer that rests; it sees observations without headings."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert observation.shape == (196,)
        return 0, None


@pytest.mark.parametrize("asked", [0.5, -0.5])
def test_a_robot_turns_to_the_side_that_is_asked_for_and_then_swims(asked):
    scene, headings = make_scene(None, "fast", 0.2), HeadingTargets(asked)
    policy = TurnThenSwim(turning_wave(0.2), Resting(), "pairs", scene, headings, 0.2)
    env = SeastarSwimEnv([[0.3, 0.0]], "joint", "fast", decision_period=0.2, headings=headings)
    done = swim("turn", policy, env, max_strokes=40)
    heated = done.limbs_heated > 0
    last = int(np.flatnonzero(heated)[-1])
    assert heated[:last].all() and 10 < last < 30 and not heated[last + 1 :].any()
    assert env._task.facts()["heading"][0] == pytest.approx(asked, abs=headings.tolerance)
