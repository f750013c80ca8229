"""The study of equal tuning: draws, the best of them, and both again with other seeds."""

import json

from later import Later
from studies.command import main
from studies.frame import DOCS

methods, tuning = Later("agents.methods"), Later("studies.tuning")


def test_a_method_is_tuned_once_by_what_all_are(tmp_path, monkeypatch, capsys):
    few = dict(list(tuning.draws().items())[:2])
    monkeypatch.setattr("studies.tuning.draws", lambda: few)
    monkeypatch.setattr("studies.tuning.EPISODES", 2)
    given = ["tuning", "--methods", "DQN", "--decisions", "64", "--out", str(tmp_path)]
    assert main(given) == 0
    found = json.loads((tmp_path / "tuning.json").read_text())
    (row,) = found["trainings"].values()
    best = min(few, key=lambda name: row[f"{name}, seed 0"]["measure"])
    again = {f"{name}, seed {seed}" for name in (tuning.OWN, best) for seed in tuning.SEEDS}
    assert row.keys() == {f"{name}, seed 0" for name in few} | again
    rate, discount, *_ = few[best]
    told = capsys.readouterr().out
    assert "| DQN | plain | " in told and f"| {rate} | {discount} | " in told
    monkeypatch.setattr("studies.tuning.new_model", None)  # nothing is trained a second time
    assert main(given) == 0
    assert "DQN, draw" not in capsys.readouterr().out


def test_draws_are_in_the_ranges_that_methods_take():
    every = tuning.draws().values()
    assert len(set(every)) == 10
    assert all(1e-4 <= rate < 1e-2 and 0.8 <= discount < 1.0 for rate, discount, _, _ in every)
    assert all(2 <= uses <= 16 and 0.0 <= exploration <= 1.0 for _, _, uses, exploration in every)


def test_tuned_rows_have_the_best_draws():
    found = json.loads((DOCS / "results/benchmark/tuning.json").read_text())["trainings"]
    tuned = {name.removesuffix(", tuned"): method.draw for name, method in methods.METHODS.items() if method.draw}
    assert tuned and all(draw == tuning.draws()[tuning.best_of(found[name])] for name, draw in tuned.items())
    learner = methods.new_model("PPO, tuned", "plain", tuning.ID, 0)
    assert (learner.learning_rate, learner.gamma, learner.n_epochs) == tuned["PPO"][:3]
