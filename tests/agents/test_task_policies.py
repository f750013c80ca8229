"""Policies of tasks: they remember on disk as their learners do, and the box has one for every task that is kept."""

import hashlib

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import seastar_gym
from agents.ppo import describe, make_model, policy_of
from agents.tasks.command import RECIPES, file_of, main
from agents.tasks.learning import LEARNERS, hyperparameters, make_learning_env
from refusals import assert_refused
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers.learned import TASKS, load, save
from seastar_gym.controllers.registry import load_agent, task_of
from seastar_gym.envs.symmetry import VectorFrameStack
from seastar_gym.envs.tasks.prey import Prey
from seastar_gym.evaluation.swim import swim
from seastar_gym.evaluation.tasks import make_batch, require_seen, swim_episodes

IDS = list(RECIPES)


def small_policy(id, learner):
    """Learner of a task that has learned nothing, and its policy."""
    torch.manual_seed(0)
    env = make_learning_env(id, LEARNERS[learner], "fast", 1)
    task, _, period, *_ = seastar_gym.TASKS[id]
    model = make_model(env, hyperparameters(task, period), seed=0)
    return model, policy_of(model)


@pytest.mark.parametrize("id", ["SeastarFailBlind-v0", "SeastarObstTrap-v0", "SeastarMiswiredTimed-v0"])
def test_a_policy_on_disk_remembers_as_its_learner_does(id, tmp_path):
    """Through episodes of several lengths side by side, whose past begins anew with each."""
    model, policy = small_policy(id, "PPO, memory")
    save(policy, tmp_path / "policy.safetensors")
    policy = load(tmp_path / "policy.safetensors")
    assert policy.description.past == 8 and policy.description.task == seastar_gym.TASKS[id][0]
    plain, inner = (
        make_batch(id, 5, split="test", fidelity="fast", threads=1, max_episode_steps=4, autoreset_mode="SameStep")
        for _ in range(2)
    )
    wrapped = VectorFrameStack(inner, 8)
    (observations, _), (shown, _) = plain.reset(seed=3), wrapped.reset(seed=3)
    state, begins = None, np.ones(5, bool)
    for _ in range(10):
        theirs, _ = model.predict(shown, deterministic=True)
        ours, state = policy.predict(observations, state, begins, deterministic=True)
        observations, _, terminated, truncated, _ = plain.step(ours)
        begins = terminated | truncated
        shown = wrapped.step(theirs)[0]
        np.testing.assert_array_equal(observations, wrapped._latest)


def test_one_robot_is_told_what_a_batch_is():
    _, policy = small_policy("SeastarFailBlind-v0", "PPO, memory")
    seen = np.random.default_rng(0).normal(size=(6, 1, policy.description.observation_size)).astype(np.float32)
    one, many = None, None
    for each in seen:
        alone, one = policy.predict(each[0], one, [False], deterministic=True)
        together, many = policy.predict(np.repeat(each, 3, axis=0), many, np.zeros(3, bool), deterministic=True)
        assert alone.shape == () and (together == alone).all()
    assert not np.array_equal(one[0][0, 0], one[0][0, 1])
    env = make_learning_env("SeastarFailBlind-v0", LEARNERS["PPO, memory"], "fast", 1)
    beneath = describe(BatchVecEnv(RecordEpisodeStatistics(env.env)), (64,))
    assert beneath == describe(env, (64,)) and beneath.past == 8


def test_a_policy_of_another_task_is_refused_with_observations_as_long_too():
    """Miswired and Station show as many numbers, and Prey as many as waypoints; numbers of a task may differ."""
    miswired, prey = (load(file_of(f"Seastar{task}-v0", TASKS)) for task in ("Miswired", "Prey"))
    station, swim_env = gym.make("SeastarStation-v0").unwrapped, gym.make("SeastarSwim-v0", actions="pairs").unwrapped
    assert miswired.description.observation_size == station.observation_space.shape[0]
    for name, policy in (("miswired", miswired), ("fail-blind", small_policy("SeastarFailBlind-v0", "PPO")[1])):
        with assert_refused(f"The policy was trained for the task {name}, the environment's is station."):
            require_seen(policy, station)
    for ask in (lambda: require_seen(prey, swim_env), lambda: swim("prey", prey, swim_env, max_strokes=1)):
        with assert_refused("The policy was trained for the task prey, the environment's is waypoints."):
            ask()
    require_seen(prey, gym.make("SeastarPrey-v0", task=Prey(speed=(0.001, 0.002)), fidelity="fast").unwrapped)
    require_seen(load(), gym.make("SeastarPrey-v0").unwrapped)


def test_the_command_trains_compares_seeds_and_writes_a_card(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("agents.tasks.command.VALIDATION", 4)
    monkeypatch.setattr("agents.tasks.command.EPISODES", 4)
    done = ["--tasks", "SeastarPrey-v0", "--seeds", "0", "1", "--decisions", "8192", "--out", str(tmp_path)]
    assert main([*done, "--num-threads", "1"]) == 0
    policy = load(tmp_path / "prey.safetensors")
    assert policy.training["seeds"] == [0, 1] and policy.training["id"] == "SeastarPrey-v0"
    card = (tmp_path / "prey.md").read_text(encoding="utf-8")
    assert "| `fast` |" in card and "prey caught" in card and "the best of seeds 0, 1" in card
    assert capsys.readouterr().out.count("mean return") == 2
    with pytest.raises(SystemExit):
        main(["--tasks", "SeastarSwim-v0"])
    assert "has no bundled policy" in capsys.readouterr().err


@pytest.mark.parametrize("id", IDS)
def test_the_box_has_a_policy_of_every_task_that_is_kept(id):
    """With the card of its weights, found by its name, and better than a robot at rest."""
    file = file_of(id, TASKS)
    policy, card = load(file), file.with_suffix(".md").read_text(encoding="utf-8")
    assert hashlib.sha256(file.read_bytes()).hexdigest() in card and f"{policy.training['strokes']:,}" in card
    env = gym.make(id, fidelity="fast").unwrapped
    assert task_of(env) == policy.description.task
    learned = load_agent("learned", env)
    np.testing.assert_array_equal(learned.weights["0.weight"], policy.weights["0.weight"])
    swum, rest = (
        swim_episodes(id, agent, [1000, 1001, 1002, 1003], fidelity="fast", max_decisions=100)
        for agent in (learned, load_agent("rest", env))
    )
    assert swum.returns.mean() > rest.returns.mean()
