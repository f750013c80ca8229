"""Actions mean what the table in the environment's docstring says, and what is no action is refused."""

import copy
import itertools

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from refusals import assert_refused
from seastar_gym import SymmetryReduction
from seastar_gym.envs.commands import LIMB_COMMANDS, action_space, command_table, to_commands
from seastar_gym.envs.goal import SERVED, GoalForm
from seastar_gym.envs.layout import Layout
from slopes import rotated


@pytest.mark.parametrize("n_limbs", [3, 5, 6])
def test_spaces_and_tables_are_the_documented_ones(n_limbs):
    """Every command once, beginning with rest; limb 1 varies slowest, each in the order 0, +, -."""
    assert LIMB_COMMANDS.tolist() == [0.0, 1.0, -1.0]
    assert action_space("limbs", n_limbs) == spaces.MultiDiscrete([3] * n_limbs)
    assert action_space("joint", n_limbs) == spaces.Discrete(3**n_limbs)
    assert action_space("pairs", n_limbs) == spaces.Discrete(1 + n_limbs * (n_limbs - 1))
    table = command_table("joint", n_limbs)
    np.testing.assert_array_equal(table, [*itertools.product([0.0, 1.0, -1.0], repeat=n_limbs)])
    table = command_table("pairs", n_limbs)
    assert not table[0].any() and len({tuple(row) for row in table}) == len(table) == 1 + n_limbs * (n_limbs - 1)
    assert np.all((table[1:] == 1.0).sum(axis=1) == 1) and np.all((table[1:] == -1.0).sum(axis=1) == 1)
    assert np.all(np.abs(table[1:]).sum(axis=1) == 2.0)


def test_actions_become_commands():
    limbs = to_commands("limbs", 5, [[0, 1, 2, 0, 1], [2, 2, 2, 2, 2]], 2)
    assert limbs.tolist() == [[0.0, 1.0, -1.0, 0.0, 1.0], [-1.0] * 5]
    for actions in ("joint", "pairs"):
        np.testing.assert_array_equal(to_commands(actions, 5, np.array([3, 0]), 2), command_table(actions, 5)[[3, 0]])


# The goal form says where the robot is and where it should be, and rewards as it says for any goals.


STRAIGHT = np.array([0, 1, 0, 0, 2])


def test_an_observation_has_the_goals_in_the_world_and_the_robot_without_waypoints():
    arguments = {"path": [[0.03, 0.0], [0.06, 0.0]], "fidelity": "fast", "random_heading": True}
    plain, env = gym.make("SeastarSwim-v0", **arguments), GoalForm(gym.make("SeastarSwim-v0", **arguments))
    seen, _ = plain.reset(seed=3)
    observed, info = env.reset(seed=3)
    assert env.observation_space.contains(observed)
    np.testing.assert_allclose(observed["achieved_goal"], 10.0 * info["hub_position"])
    np.testing.assert_allclose(observed["desired_goal"], [0.3, 0.0])
    at = Layout.of(plain.unwrapped.scene)
    np.testing.assert_array_equal(observed["observation"][:182], seen[:182])
    cosine, sine = observed["observation"][-2:]
    x, y = observed["desired_goal"] - observed["achieved_goal"]
    in_body = [cosine * x + sine * y, cosine * y - sine * x]
    np.testing.assert_allclose(in_body, seen[at.current_waypoint], atol=1e-6)


def put(env, place, heading) -> None:
    """Put the robot, at rest, where its hub is at a place [m] and its limb 1 looks in a direction [rad]."""
    simulator, nodes = env.unwrapped.simulator, rotated(env.unwrapped.scene.robot.nodes(), heading) + place
    state = simulator.get_state()
    simulator.set_state(state._replace(positions=nodes[None], velocities=np.zeros_like(state.velocities)))


@pytest.mark.parametrize("id", SERVED)
def test_a_goal_pays_where_the_waypoint_counts_is_nowhere_else_in_the_observation_and_can_be_changed(id):
    """Robots are put on the waypoint and beside it, and look the way that is asked for and the other one."""
    env = GoalForm(gym.make(id, fidelity="fast"))
    observed, _ = env.reset(seed=0)
    rest = np.zeros_like(env.action_space.sample())
    goals, achieved, rewards, infos = [], [], [], []
    for beside in (0.05, 0.0, 0.05, 0.0):
        for turned in (3.0, 0.0):
            robots = env.unwrapped._robots
            k, asked = int(robots.waypoint_index[0]), robots.task.headings_of(robots, 0)
            put(env, env.unwrapped.waypoints[k] + [beside, 0.0], turned + (0.0 if asked is None else asked[k]))
            twin = copy.deepcopy(env)
            theirs = twin.unwrapped._robots
            theirs.task.move_waypoints(theirs, np.array([[0.3, 0.1]]))
            if asked is not None:
                theirs.episode.asked[0] += 1.0
            goals.append(observed["desired_goal"])
            observed, reward, *_, info = env.step(rest)
            elsewhere = twin.step(rest)[0]
            np.testing.assert_array_equal(observed["observation"], elsewhere["observation"])
            assert np.abs(observed["desired_goal"] - elsewhere["desired_goal"]).max() > 0.1
            counts = beside == 0.0 and (turned == 0.0 or asked is None)
            assert (reward == 0.0) == (info["waypoint_index"] > k) == counts
            achieved.append(observed["achieved_goal"]), rewards.append(reward), infos.append(info)
    for given in (infos, np.array(infos, dtype=object), infos[0], {}, None):
        np.testing.assert_array_equal(env.compute_reward(achieved, goals, given), rewards)
    assert not env.compute_reward(achieved, achieved, infos).any() and -1.0 in rewards and 0.0 in rewards


@pytest.mark.parametrize("id", sorted(id for id in gym.registry if id.startswith("Seastar") and id not in SERVED))
def test_what_has_more_than_waypoints_has_no_goal_form(id):
    with assert_refused("GoalForm"):
        GoalForm(gym.make(id, fidelity="fast"))


def test_a_goal_form_stands_below_what_changes_observations_and_before_its_first_reset_is_no_step():
    with assert_refused("put SymmetryReduction around it"):
        GoalForm(SymmetryReduction(gym.make("SeastarSwim-v0", fidelity="fast")))
    with pytest.raises(gym.error.ResetNeeded):
        GoalForm(gym.make("SeastarSwim-v0", fidelity="fast").unwrapped).step(STRAIGHT)


# Learners scale their actions, to the rounding of their floats.


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_share_beyond_one_by_rounding_is_one_and_by_more_is_refused(sign):
    for share in (1, 1.0, np.float32(1.0000001), np.float32(1.0) + np.finfo(np.float32).eps, 1.0000004, np.float16(1)):
        assert to_commands("continuous", 1, [[sign * share]], 1).tolist() == [[sign]]
    assert abs(to_commands("continuous", 1, [[sign * 0.9999999]], 1)[0, 0]) < 1.0
    for share in (1.00001, 1.01, np.inf, np.nan, np.float16(1.001)):
        with assert_refused("numbers from -1 to 1"):
            to_commands("continuous", 1, [[sign * share]], 1)
