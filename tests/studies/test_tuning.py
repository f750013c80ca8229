"""The study of equal tuning: draws, the best of them, and both again with other seeds."""

import json

from studies import tuning
from studies.command import main


def test_a_method_is_tuned_once_by_what_all_are(tmp_path, monkeypatch, capsys):
    few = dict(list(tuning.draws().items())[:2])
    monkeypatch.setattr(tuning, "draws", lambda: few)
    monkeypatch.setattr(tuning, "EPISODES", 2)
    monkeypatch.setattr(tuning, "LONG", 96)
    given = ["tuning", "--methods", "DQN", "--decisions", "64", "--long", "--out", str(tmp_path)]
    assert main(given) == 0
    found = json.loads((tmp_path / "tuning.json").read_text())
    (row,), (long,) = found["trainings"].values(), found["long trainings"].values()
    best = min(few, key=lambda name: row[f"{name}, seed 0"]["measure"])
    again = {f"{name}, seed {seed}" for name in (tuning.ROWS, best) for seed in tuning.SEEDS}
    assert row.keys() == {f"{name}, seed 0" for name in few} | again
    assert long.keys() == {f"{best}, seed {seed}" for seed in tuning.SEEDS}
    rate, discount, *_ = few[best]
    told = capsys.readouterr().out
    assert "| DQN | plain | " in told and f"| {rate} | {discount} | " in told
    monkeypatch.setattr(tuning, "new_model", None)  # nothing is trained a second time
    assert main(given) == 0
    assert "DQN, draw" not in capsys.readouterr().out


def test_draws_are_in_the_ranges_that_methods_take():
    every = tuning.draws().values()
    assert len(set(every)) == 10
    assert all(1e-4 <= rate < 1e-2 and 0.8 <= discount < 1.0 for rate, discount, _, _ in every)
    assert all(2 <= uses <= 16 and 0.0 <= exploration <= 1.0 for _, _, uses, exploration in every)
