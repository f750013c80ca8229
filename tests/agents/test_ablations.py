"""The study of trainings goes all the way, continues where it stopped, and says what it found."""

import json

import pytest

from seastar_gym import RewardWeights
from seastar_gym.envs.task import SwimTask
from studies.command import main
from studies.learning import ablations
from studies.learning.ablations import VARIANTS, Options, Variant, final_strokes, learn, table

TINY = {"num_envs": 8, "rollout": 8, "batch_size": 32, "epochs": 1, "hidden": (8,), "max_episode_time": 10.0}


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
    default = ablations.COMMON
    assert VARIANTS[ablations.DEFAULT].hyperparameters == default
    others = [one for name, one in VARIANTS.items() if name != ablations.DEFAULT]
    assert all(one != Variant() for one in others)
    assert all(one.hyperparameters != default for one in others if one.changes)


def test_trainings_are_measured_and_not_repeated(variants, tmp_path, capsys):
    out = tmp_path / "ablations.json"
    command = ["learning.ablations", "--variants", *variants, "--strokes", "192", "--every", "64", "--paths", "2"]
    command += ["--num-threads", "1", "--out", str(out)]
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
    assert ", 0: " not in capsys.readouterr().out
    both = json.loads(out.read_text())
    assert both["runs"][variants[0]].keys() == {"0", "1"}
    assert f"| {variants[0]} | 3.0 (3.0 to 3.0) | 3, 3 |" in table(both)


@pytest.fixture
def seen(monkeypatch):
    """Path and aim of the task in every stroke of an environment, in order."""
    found, step = [], SwimTask.step

    def observed(task, commands):
        found.append((task.path, task.reward.aim))
        return step(task, commands)

    monkeypatch.setattr(SwimTask, "step", observed)
    return found


@pytest.mark.parametrize(
    ("variant", "stages"),
    [
        (Variant(tuple(TINY.items())), [("random", RewardWeights().aim)]),
        (
            Variant((*TINY.items(), ("reward", RewardWeights(aim=0.4))), first_path="line"),
            [("line", 0.4), ("random", 0.4)],
        ),
    ],
)
def test_a_training_swims_the_paths_of_its_variant_and_keeps_to_its_aim(variant, stages, seen, monkeypatch):
    monkeypatch.setattr(ablations, "mean_strokes", lambda *_: 0.0)  # those swims are no training
    learn(variant, 0, Options(strokes=192, every=64, num_threads=1))
    assert [stage for stage, before in zip(seen, [None, *seen], strict=False) if stage != before] == stages
    if len(stages) == 2:
        assert list(map(seen.count, stages)) == [8, 16]  # strokes: a third of the training, then the rest


def test_the_default_training_alone_is_drawn(variants, tmp_path):
    ablations.draw({"runs": {ablations.DEFAULT: {"0": {"curve": [[64, 170.0], [128, 165.0]]}}}}, tmp_path / "one.png")
    assert (tmp_path / "one.png").is_file()


def test_an_unknown_variant_is_refused():
    with pytest.raises(ValueError, match="Unknown variant 'larger'"):
        Options(variants=("larger",))
