"""The study of the benchmark: a page from cells, an oracle that is told what is hidden, a rule that finds it out."""

import numpy as np
import pytest

from later import Later
from seastar_gym.evaluation import benchmark
from seastar_gym.evaluation.benchmark import Cell
from studies.command import main

methods = Later("studies.methods")
PREY, STATION = "SeastarPreyTimed-v0", "SeastarStation-v0"


def test_cells_become_a_file_a_picture_and_a_table(tmp_path, monkeypatch, capsys):
    assert main(["methods", "--cells", str(tmp_path), "--out", str(tmp_path / "page")]) == 1
    assert "There are no cells" in capsys.readouterr().err
    monkeypatch.setattr(benchmark, "scales", lambda: {PREY: (0.0, 8.0)})
    for seed in range(3):
        curve = [{"decisions": 10, "seconds": 1.0, "measure": 1.0}, {"decisions": 20, "seconds": 2.0, "measure": 4.0}]
        cell = Cell("PPO", "plain", PREY, seed, "a", 0, [4.0 + seed] * 2, [1.0] * 2, [True] * 2, 20, 2.0, curve)
        check = cell._replace(first=64, measure=[8.0 + seed] * 2, curve=())
        file = tmp_path / f"20/ppo-plain/{PREY}-{seed}.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        benchmark.write([cell, check], file)
    assert main(["methods", "--cells", str(tmp_path), "--out", str(tmp_path / "page")]) == 0
    assert {file.name for file in (tmp_path / "page").iterdir()} == {"benchmark.json", "curves.png", "scores.png"}
    told = capsys.readouterr().out
    assert "| PPO | 5 [4, 6] (3) | 0.625 [0.5, 0.75] |" in told
    assert "| PPO, plain, 20 decisions | **5, 9** (3) |" in told
    assert methods.rows_table({}) == "No row is trained yet."
    assert all(id in methods.ids_table({}) for id in benchmark.ENTRIES)


def after_decisions(agent, id, n):
    """Policy, batch and info after n decisions of the first four test episodes."""
    batch = benchmark.make(id, 4, "test", 1)
    policy = methods.AGENTS[agent](batch)
    observations, info = batch.reset(options={"instance": [*range(4)]})
    for _ in range(n):
        observations, *_, info = batch.step(policy.predict(observations)[0])
    batch.close()
    return policy, batch, info


@pytest.mark.parametrize("id, hidden, n", [("SeastarMiswiredTimed-v0", "wiring", 60),
                                           ("SeastarFailBlind-v0", "limb_strengths", 12)])  # fmt: skip
def test_the_adaptive_rule_finds_out_wirings_and_dead_limbs(id, hidden, n):
    policy, _, info = after_decisions("adaptive", id, n)
    is_changed = info[hidden] != 1.0
    assert (policy.believed[~is_changed] == 1.0).all()
    assert (policy.believed == info[hidden])[is_changed].mean() > 0.6  # it has not heated all others


def test_the_adaptive_rule_keeps_a_station_better_than_the_planner_as_it_knows_the_current():
    planned, (policy, batch, info) = (after_decisions(agent, STATION, 40) for agent in ("planner", "adaptive"))
    assert np.mean(info["distance"]) < 0.6 * np.mean(planned[2]["distance"])
    current = np.stack([batch.unwrapped._robots.drawn[f"fluid.current.u_{axis}"] for axis in "xy"], axis=1)
    np.testing.assert_allclose(policy.flow, current, atol=0.1 * np.abs(current).max())


def test_an_oracle_keeps_a_station_better_than_a_planner_and_that_better_than_the_greedy_rule():
    ends = {}
    for agent, make_agent in methods.AGENTS.items():
        batch = benchmark.make(STATION, 4, "test", 1)
        policy = make_agent(batch)
        observations, info = batch.reset(seed=0)
        for _ in range(15):
            observations, *_, info = batch.step(policy.predict(observations)[0])
        ends[agent] = info["distance"]
        batch.close()
    assert np.mean(ends["oracle"]) < 0.8 * np.mean(ends["planner"]) < 0.7 * np.mean(ends["greedy"])


def test_an_oracle_of_robots_seen_by_a_camera_learns_with_full_sight_once(tmp_path, monkeypatch):
    monkeypatch.setattr("studies.oracle.SIGHTED", tmp_path)
    monkeypatch.setattr("studies.oracle.DECISIONS", 1)  # one rollout
    for _ in range(2):
        batch = benchmark.make("SeastarSwimSimToReal-v0", 2, "test", 1)
        policy = methods.AGENTS["oracle"](batch)
        observations, _ = batch.reset(options={"instance": [0, 1]})
        actions, _ = policy.predict(np.full_like(observations, np.nan))  # it does not look at pictures
        batch.step(actions)
        batch.close()
        monkeypatch.setattr("studies.oracle.PPO", None)  # a second training would fail
    assert len(list(tmp_path.glob("*.safetensors"))) == 1
