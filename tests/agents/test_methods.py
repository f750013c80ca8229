"""Methods of the benchmark: each trains a cell, which says what its last policy reaches and what that cost."""

import contextlib
import gc
import json

import numpy as np
import pytest
from stable_baselines3.common.buffers import ReplayBuffer

from later import Later
from losing import Losing
from refusals import assert_refused
from seastar_gym.controllers.registry import load_agent
from seastar_gym.evaluation import benchmark
from seastar_gym.evaluation.benchmark import FIDELITY, Cell, contract, make, read, swum, task_of, track_of, write
from seastar_gym.evaluation.rollout import env_of, require_seen

methods = Later("agents.methods")
NAMES = ("PPO", "PPO, tuned", "PPO, ours", "PPO, ours, frame stack", "RecurrentPPO", "DQN", "SAC")
ID = "SeastarStation-v0"
FULL = [1.0] * 64, [1.0] * 64, [True] * 64
"""Measures, returns and successes of all episodes."""


@pytest.mark.parametrize("name", [name for name in NAMES if name != "PPO, tuned"])
def test_a_method_trains_a_cell(name, tmp_path, monkeypatch):
    monkeypatch.setattr("agents.methods.EPISODES", 2)
    monkeypatch.setattr("agents.methods.CURVE", (1,))
    options = methods.BenchmarkOptions((name,), ids=(ID,), seeds=(3,), decisions=2048, out=tmp_path)
    training = options.cells[-1]
    track, file = training.track, training.file(tmp_path)
    assert {cell.track for cell in options.cells} == {*methods.METHODS[name].tracks}
    assert f"{ID}-3, {name}, {track}" in methods.keep(training, methods.train_cell(training), tmp_path)
    (cell,) = read([file])
    assert (cell.agent, cell.track, cell.id, cell.seed, cell.contract) == (name, track, ID, 3, contract(ID))
    *earlier, last = cell.curve
    assert all(0 < point["decisions"] < 2048 for point in earlier) and last["decisions"] >= cell.decisions == 2048
    assert last["seconds"] == cell.seconds > 0.0
    assert len(cell.measure) == 2 and last["measure"] == pytest.approx(np.mean(cell.measure), abs=1e-3)
    assert file.with_suffix(".zip").stat().st_size > 10_000
    monkeypatch.setattr("agents.methods.require_current", lambda *_: None)  # which counts episodes
    assert len(options.cells) == len(methods.METHODS[name].tracks) - 1
    env = env_of(ID, task=task_of(ID), split="test", fidelity=FIDELITY)
    policy = load_agent(str(file.with_suffix(".zip")), env)
    swam = swum(make(ID, 2, "test", 1, actions=require_seen(policy, env)), policy)
    assert track_of(policy) == track and swam["measure"] == cell.measure
    if benchmark.length_of(policy) is not None:  # files of our own do not say it
        with assert_refused("learned for", "decisions: say --decisions"):
            benchmark.require_length(name, policy, 9999)


@pytest.mark.parametrize("name", NAMES)
def test_a_method_takes_the_four_numbers_that_are_tuned(name):
    draw = methods.Draw(2e-3, 0.95, 4, 0.5)
    model = methods.new_model(name, methods.METHODS[name].tracks[0], ID, 0, draw)
    on_policy = hasattr(model, "n_epochs")
    assert model.lr_schedule(1.0) == 2e-3 and model.gamma == pytest.approx(0.95)
    assert (model.n_epochs if on_policy else model.gradient_steps * model.batch_size / model.n_envs) == 4
    if on_policy:
        assert model.ent_coef == 0.01
    elif name == "DQN":
        assert model.exploration_fraction == 0.25
    else:
        assert model.target_entropy == -1.25 * 5


def test_what_is_no_method_or_id_is_refused():
    for unknown in ("A2C", "dqn"):
        with assert_refused(f"There is no method '{unknown}': choose of PPO; PPO, tuned; PPO, ours; "):
            methods.BenchmarkOptions((unknown,))
    with assert_refused("RecurrentPPO has no track but plain"):
        methods.BenchmarkOptions(("PPO", "RecurrentPPO"), tracks=("symmetric",))
    with assert_refused("at least one method, track, id and seed"):
        methods.BenchmarkOptions(seeds=())
    with assert_refused("SeastarSwim-v0 is no id of the benchmark"):
        methods.BenchmarkOptions(ids=("SeastarSwim-v0",))
    assert tuple(methods.METHODS) == NAMES


def test_cells_that_are_damaged_are_trained_anew_and_those_of_another_contract_refused(tmp_path, capsys):
    options = methods.BenchmarkOptions(("DQN",), tracks=("plain",), ids=(ID,), seeds=(0, 0, 1), out=tmp_path)
    first, second = (cell.file(tmp_path) for cell in options.cells)
    for text in ("", '{"cells": ['):
        first.parent.mkdir(parents=True, exist_ok=True)
        first.write_text(text)
        assert len(options.cells) == 2
        assert f"{first.name} is no " in (told := capsys.readouterr().out) and "trained anew" in told
    for seed, (file, known) in enumerate({first: contract(ID), second: "old"}.items()):
        write([Cell("DQN", "plain", ID, seed, known, 0, *FULL, 200_000)], file)
    with assert_refused(f"{second} and this version are of different contracts of {ID}"):
        assert options.cells
    for wrong in (Cell("DQN", "plain", ID, 7, contract(ID), 0, *FULL, 200_000),
                  Cell("DQN", "plain", ID, 1, contract(ID), 0, *FULL, 100_000)):  # fmt: skip
        write([wrong], second)
        with assert_refused(f"{second} has not the cell that its name says"):
            assert options.cells


def test_a_worker_keeps_no_model_of_an_earlier_cell(monkeypatch):
    monkeypatch.setattr("agents.methods.EPISODES", 2)
    for seed in (0, 1):
        methods.train_cell(methods.Training("DQN", "plain", ID, seed, 128))
    assert sum(type(each) is ReplayBuffer for each in gc.get_objects()) == 1


def test_a_cell_that_a_worker_lost_is_named_and_trained_by_the_same_command(tmp_path, monkeypatch, capsys):
    options = methods.BenchmarkOptions(("DQN",), tracks=("plain",), ids=(ID,), seeds=(0, 1), out=tmp_path)
    files = {"seed": 0, "curve": [{"measure": 2.0}], "seconds": 1.0}
    contents = {".zip": b"model", ".json": json.dumps({"cells": [files]}).encode()}
    executor = Losing(lambda training: training.seed == 1)
    monkeypatch.setattr("agents.methods.train_cell", lambda training: contents)
    monkeypatch.setattr("agents.methods.executor_of", lambda options: contextlib.nullcontext(executor))
    first, second = (training.file(tmp_path) for training in options.cells)
    assert methods.train_cells(options) == 1
    assert f"{second}: Its worker was lost" in (told := capsys.readouterr().out) and "without a result: 1." in told
    assert first.is_file() and first.with_suffix(".zip").read_bytes() == b"model" and not second.exists()
