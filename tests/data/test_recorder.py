"""A recorder keeps what a batch did: episodes that one environment does again to the last bit."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import seastar_gym  # noqa: F401
from refusals import assert_refused
from seastar_gym import VectorSymmetryReduction
from seastar_gym.controllers import load
from seastar_gym.data.dataset import record, summary
from seastar_gym.data.recorder import Recorder
from seastar_gym.evaluation.rollout import rollout

SHORT = {"actions": "pairs", "fidelity": "fast", "max_episode_steps": 3}
TASK = "SeastarSwim-v0"


def recorder(n=2, **arguments):
    return Recorder(gym.make_vec(TASK, n, vectorization_mode="vector_entry_point", **SHORT, **arguments))


def assert_swum_again(episode, env):
    """One environment does the same, from the episode's seed by its actions."""
    observation, info = env.reset(seed=episode.seed)
    for step in range(len(episode.actions)):
        np.testing.assert_array_equal(episode.observations[step], observation)
        assert all(np.array_equal(values[step], info[name]) for name, values in episode.infos.items())
        observation, reward, terminated, truncated, info = env.step(episode.actions[step])
        assert reward == episode.rewards[step]
        assert (terminated, truncated) == (episode.terminated[step], episode.truncated[step])
    np.testing.assert_array_equal(episode.observations[-1], observation)
    assert terminated or truncated


def test_recorded_episodes_are_those_of_one_environment():
    episodes = record(TASK, load(), 3, seed=5, **SHORT)
    assert [one.seed for one in episodes] == [5, 6, 7]
    env = gym.make(TASK, **SHORT)
    for one in episodes:
        assert_swum_again(one, env)
    assert summary(episodes).startswith("3 episodes, 9 decisions, mean return ")


def test_a_learner_s_wrapper_outside_leaves_what_is_kept_as_the_environment_has_it():
    anywhere = {"path": "random", "random_heading": True}
    inner = recorder(**anywhere)
    batch = VectorSymmetryReduction(inner)
    seen, _ = batch.reset(seed=[3, 4])
    for _ in range(3):
        seen, *_ = batch.step(np.array([7, 11]))
    assert not np.array_equal([one.observations[-1] for one in inner.episodes()], seen)
    for one in inner.episodes():
        assert_swum_again(one, gym.make(TASK, **SHORT, **anywhere))


def test_episodes_follow_each_other_and_only_the_first_have_seeds():
    """What a reset broke off is not kept, and actions are copied."""
    batch, actions = recorder(), np.array([3, 0])
    batch.reset(seed=9)
    batch.step(actions)
    batch.reset(seed=0)
    rewards = []
    for _ in range(8):  # 3 decisions, a reset, 3 decisions, a reset
        rewards.append(batch.step(actions)[1])
        actions += 1
    kept = batch.episodes()
    assert [one.seed for one in kept] == [0, 1, None, None]
    assert [one.actions.tolist() for one in kept] == [[3, 4, 5], [0, 1, 2], [7, 8, 9], [4, 5, 6]]
    np.testing.assert_array_equal(kept[2].rewards, [reward[0] for reward in rewards[4:7]])
    assert kept[2].infos["time"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert [one.seed for one in batch.episodes(only_first=True)] == [0, 1]
    assert_swum_again(kept[0], gym.make(TASK, **SHORT))


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
def test_other_resets_are_refused(mode):
    with assert_refused("A recorder needs autoreset_mode=AutoresetMode.NEXT_STEP"):
        recorder(autoreset_mode=mode)
    with assert_refused("A rollout needs autoreset_mode=AutoresetMode.NEXT_STEP"):
        rollout(gym.make_vec(TASK, 1, vectorization_mode="vector_entry_point", autoreset_mode=mode), load())
    with assert_refused("leave reset_mask out"):
        recorder().reset(options={"reset_mask": np.array([True, False])})
