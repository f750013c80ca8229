"""The goal form says where the robot is and where it should be, and rewards as it says for any goals."""

import gymnasium as gym
import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Sight
from seastar_gym.envs.goal import GoalForm
from seastar_gym.envs.layout import Layout

STRAIGHT = np.array([0, 1, 0, 0, 2])


@pytest.fixture
def env():
    return GoalForm(gym.make("SeastarSwim-v0", path=[[0.03, 0.0], [0.06, 0.0]], fidelity="fast", random_heading=True))


def test_an_observation_has_the_goals_in_the_world_and_the_robot_without_waypoints(env):
    plain = gym.make("SeastarSwim-v0", path=[[0.03, 0.0], [0.06, 0.0]], fidelity="fast", random_heading=True)
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


def test_the_reward_is_that_of_the_goal_of_the_decision_and_goals_move_on():
    env = GoalForm(gym.make("SeastarSwim-v0", path=[[0.03, 0.0], [0.06, 0.0]], fidelity="fast"))
    observed, _ = env.reset(seed=0)
    rewards, goals, over = [], [observed["desired_goal"]], False
    while not over:
        observed, reward, over, _, info = env.step(STRAIGHT)
        rewards.append(reward)
        goals.append(observed["desired_goal"])
        assert reward == env.compute_reward(observed["achieved_goal"], goals[-2], info)
    assert sum(reward == 0.0 for reward in rewards) == 2 and rewards[-1] == 0.0
    np.testing.assert_allclose(goals[-1], [0.6, 0.0])


def test_rewards_of_many_goals_at_once(env):
    achieved = np.array([[0.0, 0.0], [0.0, 0.09], [0.3, 0.11]])
    desired = np.array([[0.0, 0.0], [0.0, 0.0], [0.3, 0.0]])
    np.testing.assert_array_equal(env.compute_reward(achieved, desired, [{}] * 3), [0.0, 0.0, -1.0])


def test_other_environments_are_refused():
    with assert_refused("GoalForm needs an environment of waypoints"):
        GoalForm(gym.make("CartPole-v1"))
    with assert_refused("which no camera knows"):
        GoalForm(gym.make("SeastarSwim-v0", fidelity="fast", sight=Sight()))
