"""Agents are measured on registered tasks, and a table tells how sure their means are."""

import csv
import json

import gymnasium as gym
import numpy as np
import pytest

from seastar_gym.cli.main import main
from seastar_gym.controllers import scripted
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.tasks.station import Station
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.evaluation.rollout import MEASURES, SECONDS, make_batch, measure_of, swim_episodes, task_ids
from seastar_gym.evaluation.scores import Scores, measured, policies_of

SWIM, SHORT, OTHER = "SeastarSwim-v0", "SeastarShort-v0", "SeastarDrift-v0"


class DriftEnv(SeastarSwimEnv):
    """An environment of a task with a split."""

    def __init__(self, split="train", task="drift", **arguments):
        assert split == "test" and task == "drift"
        super().__init__(**arguments)


@pytest.fixture
def tasks():
    """Two tasks that a user's package might register in this one's name: a short path, and one without a batch."""
    entry = {"entry_point": "seastar_gym.envs.seastar_swim:SeastarSwimEnv"}
    batch = {"vector_entry_point": "seastar_gym.envs.vector:SeastarSwimVectorEnv"}
    short = {"path": [[0.03, 0.0]], "random_heading": True, "fidelity": "fast"}
    gym.register(SHORT, **entry, **batch, max_episode_steps=30, kwargs=short)
    gym.register(OTHER, DriftEnv, max_episode_steps=33, kwargs={"fidelity": "fast", "task": "drift"})
    yield
    for task in (SHORT, OTHER):
        del gym.registry[task]


# Episodes


def test_tasks_are_the_registered_ids_of_this_package(tasks):
    assert {SWIM, "SeastarSwimTimed-v0", SHORT} <= set(task_ids())
    assert not any(id.startswith("CartPole") for id in task_ids())
    assert isinstance(make_batch(SHORT, 2), SeastarSwimVectorEnv)
    assert isinstance(make_batch(OTHER, 2, split="test"), gym.vector.SyncVectorEnv)


def test_returns_are_sums_of_rewards_and_who_does_not_arrive_has_the_time_limit(tasks):
    swum = swim_episodes(SHORT, scripted("4+,1-"), [7])
    env, total = gym.make(SHORT), 0.0
    env.reset(seed=7)
    for _ in range(swum.decisions[0]):
        total += env.step(np.array([2, 0, 0, 1, 0]))[1]
    assert swum.returns[0] == pytest.approx(total)
    swum = swim_episodes(SHORT, scripted("rest"), [0, 1], max_decisions=4)
    assert SECONDS.of(swum).tolist() == [4.0, 4.0] and not swum.success.any()


def test_a_task_of_another_measure_without_a_batch_is_swum_on_its_held_out_split(tasks, monkeypatch):
    monkeypatch.setattr("seastar_gym.evaluation.rollout.task_ids", lambda: [OTHER])
    env = DriftEnv("test", fidelity="fast")
    assert measure_of(env) is SECONDS
    monkeypatch.setitem(MEASURES, type(env.task), MEASURES[Station])
    assert measure_of(env) is MEASURES[Station]
    swum = swim_episodes(OTHER, scripted("rest"), [0, 1])
    side = np.hypot(*env.reset(seed=0)[0][182:184]) * 100.0
    np.testing.assert_allclose(MEASURES[Station].of(swum), side, rtol=1e-3)


# The table


def of(*scores, seeds=4):
    return Scores(SWIM, "a", None, "time", "s", "less", list(range(seeds)), list(scores), [True] * seeds, [], [])


@pytest.mark.parametrize(
    "agent, label, policies",
    [
        ("greedy", "greedy", ["greedy"]), ("runs/a.zip", "a", ["runs/a.zip"]), ("mine=a,b", "mine", ["a", "b"]),
        ("pair=rest,4+,1-,{2+,3-},2-,3+", "pair", ["rest", "4+,1-", "{2+,3-}", "2-,3+"]),
        ("x=1.zip", "x=1.zip", ["x=1.zip"]),
        ("runs/lr=0.1/a.zip", "a", ["runs/lr=0.1/a.zip"]), ("mine=a,b.zip", "mine", ["a,b.zip"]),
        ("w/ noise=a,b", "w/ noise", ["a", "b"]),
    ],
)  # fmt: skip
def test_a_label_stands_before_policies_and_not_within_the_name_of_a_file(
    agent, label, policies, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "lr=0.1").mkdir(parents=True)
    for name in ("x=1.zip", "a,b.zip"):
        (tmp_path / name).touch()
    assert policies_of(agent) == (label, policies)


def test_functions_that_take_turns_are_trainings(tasks, tmp_path, monkeypatch):
    (tmp_path / "turns.py").write_text("from seastar_gym.controllers import scripted\n" + "".join(
        f"def seed{k}(env):\n    return scripted({name!r})\n" for k, name in enumerate(("rest", "straight", "4+,1-"))
    ))  # fmt: skip
    monkeypatch.syspath_prepend(tmp_path)
    found = measured(SHORT, "mine=turns:seed0,turns:seed1,turns:seed2", 6, max_decisions=4)
    assert found.trainings == 3 and not np.isnan(found.mean.low)


def test_a_failure_counts_in_the_mean_and_one_seed_has_no_interval():
    """An interquartile mean would hide the quarter that does not arrive."""
    mean = of(100.0, 100.0, 100.0, 300.0).mean
    assert mean.mean == 150.0 and mean.low == 100.0 and mean.high > 150.0
    assert np.isnan(of(100.0, seeds=1).mean.low)


def test_the_command_writes_a_row_for_every_agent_and_the_episodes_of_policies_that_take_turns(tasks, tmp_path, capsys):
    words = ["--task", SHORT, "--agents", "straight", "two=straight,rest", "--seeds", "4", "--decisions", "12"]
    for file in ("table.csv", "table.json"):
        assert main(["evaluate", *words, "--out", str(tmp_path / file)]) == 0
    printed = capsys.readouterr().out
    straight, two = json.loads((tmp_path / "table.json").read_text())
    assert (straight["agent"], two["agent"]) == ("straight", "two") and straight["seeds"] == [1000, 1001, 1002, 1003]
    assert two["returns"][::2] == straight["returns"][::2] and two["decisions"][1::2] == [12, 12]
    assert two["scores"][1::2] == [12.0, 12.0]  # who rests has the time limit
    rows = list(csv.DictReader((tmp_path / "table.csv").read_text().splitlines()))
    assert [float(row["score"]) for row in rows] == [np.mean(one["scores"]) for one in (straight, two)]
    assert all(row["task"] == SHORT and row["task"] in printed for row in rows)


def test_an_agent_that_does_not_fit_costs_the_others_nothing(tasks, tmp_path, capsys):
    file = tmp_path / "table.json"
    words = ["--task", SHORT, "--agents", "lagged", "rest", "--seeds", "2", "--decisions", "2", "--out", str(file)]
    assert main(["evaluate", *words]) == 2
    assert "lagged does not swim SeastarShort-v0: A lagged gait needs two decisions" in capsys.readouterr().err
    assert [one["agent"] for one in json.loads(file.read_text())] == ["rest"]
