"""The study of trainings goes all the way, continues where it stopped, and says what it found."""

import json

import pytest

from agents import ablations
from agents.ablations import VARIANTS, Options, Variant, final_strokes, main, table
from agents.ppo import Hyperparameters

TINY = {"num_envs": 8, "rollout": 8, "batch_size": 32, "epochs": 1, "hidden": (8,), "max_episode_steps": 10}


@pytest.fixture
def variants(monkeypatch):
    """Two small trainings, one of which begins with a single waypoint."""
    small = {
        ablations.DEFAULT: Variant(tuple(TINY.items())),
        "one waypoint first": Variant(tuple(TINY.items()), first_path="line"),
    }
    monkeypatch.setattr(ablations, "VARIANTS", small)
    monkeypatch.setattr(ablations, "MAX_STROKES", 3)
    return tuple(small)


def test_every_variant_is_a_valid_training_of_its_own():
    default = Hyperparameters()
    assert VARIANTS[ablations.DEFAULT].hyperparameters == default
    others = [one for name, one in VARIANTS.items() if name != ablations.DEFAULT]
    assert all(one != Variant() for one in others)
    assert all(one.hyperparameters != default for one in others if one.changes)


def test_trainings_are_measured_and_not_repeated(variants, tmp_path, capsys):
    out = tmp_path / "ablations.json"
    command = ["--variants", *variants, "--strokes", "192", "--every", "64", "--paths", "2", "--num-threads", "1"]
    command += ["--out", str(out)]
    assert main([*command, "--seeds", "0"]) == 0
    first = json.loads(out.read_text())
    for name in variants:
        run = first["runs"][name]["0"]
        assert [trained for trained, _ in run["curve"]] == [64, 128, 192]
        assert final_strokes(first["runs"][name]) == [3.0]  # no robot arrives that soon
        assert f"| {name} | 3.0 | 3 |" in table(first)
    assert out.with_suffix(".png").is_file()
    capsys.readouterr()
    assert main([*command, "--seeds", "0", "1"]) == 0
    assert "seed 0" not in capsys.readouterr().out
    both = json.loads(out.read_text())
    assert both["runs"][variants[0]].keys() == {"0", "1"}
    assert f"| {variants[0]} | 3.0 (3.0 to 3.0) | 3, 3 |" in table(both)


def test_results_of_other_trainings_are_not_mixed(variants, tmp_path, capsys):
    out = tmp_path / "ablations.json"
    options = Options(variants=variants, out=out)
    out.write_text(json.dumps(ablations.read_results(options, "") | {"settings": {"strokes": 1}}))
    assert main(["--variants", *variants, "--out", str(out)]) == 2
    assert "give another --out" in capsys.readouterr().err


def test_an_unknown_variant_is_refused():
    with pytest.raises(ValueError, match="Unknown variant 'larger'"):
        Options(variants=("larger",))
