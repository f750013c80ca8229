"""Methods of the benchmark: each trains a cell, which says what its last policy reaches and what that cost."""

import numpy as np
import pytest

from later import Later
from refusals import assert_refused
from seastar_gym.evaluation.benchmark import contract, read

methods = Later("agents.methods")
NAMES = ("PPO", "PPO, ours", "PPO, ours, frame stack", "RecurrentPPO", "DQN", "SAC")
ID = "SeastarStation-v0"


@pytest.mark.parametrize("name", NAMES)
def test_a_method_trains_a_cell(name, tmp_path, monkeypatch):
    monkeypatch.setattr("agents.methods.EPISODES", 2)
    monkeypatch.setattr("agents.methods.CURVE", (1,))
    options = methods.BenchmarkOptions((name,), ids=(ID,), seeds=(3,), decisions=2048, out=tmp_path)
    (*arguments, file) = options.cells[-1]
    track = arguments[1]
    assert {cell[1] for cell in options.cells} == {*methods.METHODS[name].tracks}
    assert f"{ID}-3, {name}, {track}" in methods.train_cell(*arguments, file)
    (cell,) = read([file])
    assert (cell.agent, cell.track, cell.id, cell.seed, cell.contract) == (name, track, ID, 3, contract(ID))
    *earlier, last = cell.curve
    assert all(0 < point["decisions"] < 2048 for point in earlier) and last["decisions"] >= cell.decisions == 2048
    assert last["seconds"] == cell.seconds > 0.0
    assert len(cell.measure) == 2 and last["measure"] == pytest.approx(np.mean(cell.measure), abs=1e-3)
    assert file.with_suffix(".zip").stat().st_size > 10_000
    assert len(options.cells) == len(methods.METHODS[name].tracks) - 1


def test_what_is_no_method_or_id_is_refused():
    with assert_refused("There is no method 'A2C': choose of PPO, "):
        methods.BenchmarkOptions(("A2C",))
    with assert_refused("SeastarSwim-v0 is no id of the benchmark"):
        methods.BenchmarkOptions(ids=("SeastarSwim-v0",))
    assert tuple(methods.METHODS) == NAMES
