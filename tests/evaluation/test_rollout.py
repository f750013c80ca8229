"""The one loop in which policies swim: what they are asked, when episodes end, and what is kept of them."""

from itertools import count
from typing import get_args

import gymnasium as gym
import numpy as np
import pytest

from seastar_gym import Scene
from seastar_gym.controllers.scripted import scripted
from seastar_gym.envs.commands import Actions, action_space, to_commands
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.task import SwimTask
from seastar_gym.evaluation.rollout import TaskBatch, rollout
from seastar_gym.evaluation.swim import RECORDED, swim, swims_of
from seastar_gym.evaluation.tasks import make_batch

NEAR = [[0.02, 0.0]]


class Asked:
    """A policy that swims along limb 1 and writes down what it is asked. It counts the decisions of every episode."""

    def __init__(self):
        self.asked = []

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        alone = observation.ndim == 1
        before = np.zeros(1 if alone else len(observation), int) if state is None else state
        self.asked.append((None if state is None else state.tolist(), list(episode_start), deterministic))
        action = np.array([0, 1, 0, 0, 2])
        return action if alone else np.tile(action, (len(observation), 1)), np.where(episode_start, 0, before) + 1


def batch(n, **arguments):
    return make_batch("SeastarSwim-v0", n, 1, **{"fidelity": "fast", "max_episode_steps": 3, **arguments})


def test_a_policy_gets_its_state_back_and_hears_of_every_start_once():
    policy = Asked()
    done = swim("asked", policy, SeastarSwimEnv(fidelity="fast"), max_strokes=3, seed=0)
    assert policy.asked == [(None, [True], True), ([1], [False], True), ([2], [False], True)]
    assert done.strokes == 3
    np.testing.assert_array_equal(done.time, [0.0, 1.0, 2.0, 3.0])
    np.testing.assert_array_equal(done.limbs_heated, [2, 2, 2])
    policy = Asked()
    rollout(batch(2), policy, seeds=0)
    assert policy.asked == [(None, [True] * 2, True), ([1, 1], [False] * 2, True), ([2, 2], [False] * 2, True)]


@pytest.mark.parametrize("kind", ["vector_entry_point", "sync"])
def test_episodes_of_a_batch_are_those_of_one_robot_each(kind):
    """Whatever makes the batch; each in its own time: one robot arrives early and rests, the others have a limit."""
    own = {"path": [[0.06, 0.0]], "random_heading": True, "fidelity": "fast", "actions": "pairs"}
    own["waypoint_radius"] = 0.05
    robots = gym.make_vec("SeastarSwim-v0", 3, vectorization_mode=kind, **own)
    found = rollout(robots, scripted("straight", "pairs"), seeds=[0, 1, 2], until=8, record=(*RECORDED, "nothing"))
    assert "nothing" not in found.entries and found.decisions.tolist() == [6, 3, 8]
    for robot, seed in enumerate((0, 1, 2)):
        env = gym.make("SeastarSwim-v0", **own)
        alone = rollout(env, scripted("straight", "pairs"), seeds=seed, until=8, record=RECORDED)
        assert alone.decisions[0] == found.decisions[robot] and alone.success[0] == found.success[robot]
        assert alone.returns[0] == found.returns[robot] and alone.total("energy")[0] == found.total("energy")[robot]
        for name in ("time", "hub_position", "waypoint_index"):
            np.testing.assert_array_equal(alone.last(name)[0], found.last(name)[robot])
        np.testing.assert_array_equal(alone.of("energy")[:, 0], found.of("energy")[: alone.decisions[0], robot])
        assert np.isnan(found.of("energy")[alone.decisions[0] :, robot]).all()


def test_who_has_arrived_rests_until_all_have():
    task = SwimTask(Scene.preset("fast"), 2, "line", RewardWeights(), 0.01, False, 1)
    robots, commands = TaskBatch(task), []
    robots.reset(seed=0)
    step = robots.step
    robots.step = lambda actions: commands.append(np.array(actions)) or step(actions)
    paths = [np.array(NEAR), np.array([[0.04, 0.0]])]
    task._draw = lambda robot, rng, asked: task._set_path(robot, paths[robot])
    early, late = swims_of("asked", rollout(robots, Asked(), seeds=0, record=RECORDED))
    assert early.finished and late.finished and early.strokes < late.strokes == len(commands)
    assert [given[0].any() for given in commands] == [stroke < early.strokes for stroke in range(late.strokes)]
    assert all(given[1].any() for given in commands)
    np.testing.assert_array_equal(early.waypoints, paths[0])


@pytest.mark.parametrize("actions", get_args(Actions))
def test_zero_is_rest_in_every_action_mode(actions):
    zero = np.zeros_like(action_space(actions, 5).sample())
    assert not to_commands(actions, 5, np.array([zero]), 1).any()


def test_a_rollout_ends_when_it_is_told_to_and_shows_every_info():
    seen = []

    def look(info):
        seen.append(info["time"][0])
        return len(seen) == 3

    assert rollout(batch(1, max_episode_steps=9), Asked(), seeds=0, on_step=look).decisions.tolist() == [2]
    assert seen == [0.0, 1.0, 2.0]
    numbers = count()
    found = rollout(batch(1, max_episode_steps=9), Asked(), seeds=0, until=4, on_step=lambda info: next(numbers))
    assert found.decisions.tolist() == [4] and next(numbers) == 5  # a number is no wish to end
    assert not found.success.any()
