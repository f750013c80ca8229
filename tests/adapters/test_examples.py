"""Loops and learners of examples/ learn for an iteration each on the native batch."""

import runpy
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from seastar_gym.controllers.learned import load, save
from seastar_gym.evaluation.swim import swim

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name):
    return runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name=name)


@pytest.fixture(scope="module")
def single_file():
    """The loop in one file, and a training of one iteration."""
    loop = example("single_file_ppo")

    def train(**changed):
        shape = {"num_envs": 8, "rollout": 8, "batch_size": 32, "epochs": 1, "hidden": 8, "num_threads": 1}
        return loop["train"](loop["Options"](**{"strokes": 64, **shape, **changed}), quiet=True)

    return train


def test_the_loop_in_one_file_learns_for_an_iteration(single_file):
    one, again, hardly = single_file(), single_file(), single_file(learning_rate=1e-12)
    assert all(np.array_equal(one.weights[name], again.weights[name]) for name in one.weights)
    assert max(np.abs(one.weights[name] - hardly.weights[name]).max() for name in one.weights) > 1e-4


def test_its_policy_is_one_of_the_project(single_file, tmp_path):
    save(single_file(), tmp_path / "policy.safetensors", strokes=64)
    policy = load(tmp_path / "policy.safetensors")
    env = gym.make("SeastarSwim-v0", actions=policy.actions, scene=policy.scene).unwrapped
    assert swim("learned", policy, env, max_strokes=2, seed=0).strokes == 2


@pytest.mark.slow
def test_the_loop_in_one_file_learns_to_swim(single_file):
    """After a third of its training, it swims round the pentagon faster than the script, which takes 241 strokes."""
    learned = {"num_envs": 128, "rollout": 16, "batch_size": 512, "epochs": 6, "hidden": 128, "num_threads": None}
    policy = single_file(strokes=32_768, **learned)
    env = gym.make("SeastarSwim-v0", actions="pairs", fidelity="fast").unwrapped
    assert swim("learned", policy, env, max_strokes=240).finished


@pytest.mark.filterwarnings("ignore")  # of the library's own
def test_torchrl_learns_for_an_iteration():
    pytest.importorskip("torchrl")
    loop = example("torchrl_ppo")
    shape = {"num_envs": 8, "rollout": 8, "batch_size": 32, "epochs": 1, "max_episode_steps": 5}
    actor, rewards = loop["train"](loop["Options"](strokes=128, **shape))
    assert len(rewards) == 2 and np.isfinite(rewards).all()
    env = loop["make_env"](loop["Options"](**shape))
    rollout = env.rollout(7, actor, break_when_any_done=False)
    ended = rollout["next", "done"][..., 0]
    assert ended[:, 4].all() and ended.sum() == 8  # all run out of time in the fifth stroke, and begin anew
    waypoints = rollout["observation"][..., -4:-2]
    assert not np.allclose(waypoints[:, 5], rollout["next", "observation"][:, 4, -4:-2])


@pytest.mark.filterwarnings("ignore")
def test_skrl_learns_for_an_iteration():
    pytest.importorskip("skrl")
    import torch

    loop = example("skrl_ppo")
    shape = {"num_envs": 8, "rollout": 8, "mini_batches": 2, "epochs": 1, "max_episode_steps": 5}
    agents = [loop["train"](loop["Options"](strokes=strokes, **shape)) for strokes in (64, 128)]
    (once, first), (twice, rewards) = agents
    assert len(first) == 8 and len(rewards) == 16 and np.isfinite(rewards).all()
    assert first == rewards[:8]
    weights = [list(agent.models["policy"].parameters()) for agent in (once, twice)]
    assert any(not torch.equal(one, other) for one, other in zip(*weights, strict=True))
