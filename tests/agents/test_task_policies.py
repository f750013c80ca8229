"""Policies of tasks: they remember on disk as their learners do, and the box has one for every task that is kept."""

import hashlib

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from later import Later
from refusals import assert_refused
from seastar_gym import TASKS
from seastar_gym.controllers import learned
from seastar_gym.controllers.learned import load, save
from seastar_gym.controllers.registry import load_agent, task_of
from seastar_gym.envs.symmetry import VectorFrameStack
from seastar_gym.envs.tasks.prey import Prey
from seastar_gym.evaluation.rollout import make_batch, require_seen, swim_episodes
from seastar_gym.evaluation.swim import swim

tasks = Later("agents.tasks")
ppo = Later("agents.ppo")


@pytest.mark.parametrize("id", ["SeastarFailBlind-v0", "SeastarObstTrap-v0", "SeastarMiswiredTimed-v0"])
def test_a_policy_on_disk_remembers_as_its_learner_does(id, tmp_path):
    """Through episodes of several lengths side by side, whose past begins anew with each."""
    model = tasks.new_model(id, 0, "fast", 1)
    save(tasks.swims(ppo.policy_of(model), id), tmp_path / "policy.safetensors")
    policy = load(tmp_path / "policy.safetensors")
    assert policy.description.past == 8 and policy.description.task == TASKS[id].task
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


def test_a_memory_beneath_other_wrappers_is_described():
    env = tasks.new_model("SeastarFailBlind-v0", 0, "fast", 1).get_env()
    beneath = ppo.describe(type(env)(RecordEpisodeStatistics(env.env)), (64,))
    assert beneath == ppo.describe(env, (64,)) and beneath.past == 8


def test_a_policy_of_another_task_is_refused_with_observations_as_long_too():
    """Miswired and Station show as many numbers, and Prey as many as waypoints; numbers of a task may differ."""
    miswired, prey, blind = (learned.pretrained(task) for task in ("miswired", "prey", "fail-blind"))
    station, swim_env = gym.make("SeastarStation-v0").unwrapped, gym.make("SeastarSwim-v0", actions="pairs").unwrapped
    assert miswired.description.observation_size == station.observation_space.shape[0]
    for name, policy in (("miswired", miswired), ("fail-blind", blind)):
        with assert_refused(f"The policy was trained for the task {name}, the environment's is station."):
            require_seen(policy, station)
    for ask in (lambda: require_seen(prey, swim_env), lambda: swim("prey", prey, swim_env, max_strokes=1)):
        with assert_refused("The policy was trained for the task prey, the environment's is waypoints."):
            ask()
    require_seen(prey, gym.make("SeastarPrey-v0", task=Prey(speed=(0.001, 0.002)), fidelity="fast").unwrapped)
    require_seen(load(), gym.make("SeastarPrey-v0").unwrapped)


def test_the_command_trains_compares_seeds_and_writes_a_card(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("agents.tasks.VALIDATION", 4)
    monkeypatch.setattr("agents.tasks.EPISODES", 4)
    done = ["--tasks", "SeastarPrey-v0", "--seeds", "0", "1", "--decisions", "4096", "--out", str(tmp_path)]
    assert tasks.main([*done, "--num-threads", "1"]) == 0
    policy = load(tmp_path / "prey.safetensors")
    assert policy.training["seeds"] == [0, 1] and policy.training["id"] == "SeastarPrey-v0"
    card = (tmp_path / "prey.md").read_text(encoding="utf-8")
    assert "| `fast` |" in card and "prey caught" in card and "the best of seeds 0, 1" in card
    assert capsys.readouterr().out.count("mean return") == 2
    with pytest.raises(SystemExit):
        tasks.main(["--tasks", "SeastarSwim-v0"])
    assert "has no bundled policy" in capsys.readouterr().err


@pytest.mark.parametrize("id", TASKS)
def test_the_box_has_a_policy_of_every_task_that_is_kept(id):
    """With the card of its weights, found by its name, and better than a robot at rest."""
    file = tasks.file_of(id, learned.TASKS)
    policy, card = load(file), file.with_suffix(".md").read_text(encoding="utf-8")
    assert hashlib.sha256(file.read_bytes()).hexdigest() in card and f"{policy.training['strokes']:,}" in card
    env = gym.make(id, fidelity="fast").unwrapped
    assert task_of(env) == policy.description.task
    by_name = load_agent("learned", env)
    np.testing.assert_array_equal(by_name.weights["0.weight"], policy.weights["0.weight"])
    swum, rest = (
        swim_episodes(id, agent, [1000, 1001, 1002, 1003], fidelity="fast", max_decisions=100)
        for agent in (by_name, load_agent("rest", env))
    )
    assert swum.returns.mean() > rest.returns.mean()
