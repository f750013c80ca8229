"""The study of trainings in time goes all the way for every learner, and continues where it stopped."""

import json
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import SAC

from seastar_gym.controllers import checkpoint
from seastar_gym.envs import symmetry
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.evaluation.statistics import mean_with_interval
from seastar_gym.evaluation.swim import swim
from studies.command import main
from studies.frame import DOCS
from studies.learning.timed import study, trainings
from studies.learning.timed.shares import ChosenCommands, shares_of_pairs
from studies.learning.timed.study import Options
from studies.learning.timed.tables import as_markdown, pulses_per_metre
from studies.learning.timed.trainings import TRAININGS, ReducedPolicy, Training, learn
from studies.pages import numbers
from symmetries import assert_equivariant

TINY = (
    ("decision_period", 0.5), ("num_envs", 8), ("rollout", 8), ("batch_size", 32), ("epochs", 1), ("hidden", (8,)),
    ("max_episode_time", 10.0),
)  # fmt: skip


@pytest.fixture
def small(monkeypatch):
    """A small training of every kind."""
    learners = {learner: Training(TINY, 64, learner) for learner in ("pairs", "shares", "gaussian", "sac", "td3")}
    later = Training((*TINY, ("decision_period", 0.2)), 64, start="pairs")
    monkeypatch.setattr(trainings, "TRAININGS", learners | {"later": later})
    monkeypatch.setattr(study, "TRAININGS", learners | {"later": later})
    monkeypatch.setattr(trainings, "SAC_SETTINGS", trainings.SAC_SETTINGS | {"learning_starts": 16, "batch_size": 16})
    monkeypatch.setattr("seastar_gym.evaluation.many.TIME_LIMIT", 2.0)


def test_the_trainings_of_the_study_are_valid_and_differ():
    assert len({(one.hyperparameters, one.learner, one.start) for one in TRAININGS.values()}) == len(TRAININGS)
    for training in TRAININGS.values():
        assert training.hyperparameters.decision_period is not None
        assert training.start is None or TRAININGS[training.start].learner == "pairs"


def test_no_seed_is_left_out_of_the_committed_results():
    runs = numbers(DOCS, study.STUDY)["runs"]
    assert all(list(found) == [str(seed) for seed in range(len(found))] for found in runs.values())


@pytest.mark.parametrize("page", ["results.md", "training.md"])
def test_pages_beside_the_study_quote_its_mean_of_ten_seeds(page):
    """The fastest training stands beside all ten, and each is named once."""
    runs = numbers(DOCS, study.STUDY)["runs"]["0.2 s, coasting"]
    text = (DOCS / page).read_text(encoding="utf-8")
    seconds = {
        fidelity: np.array([run["pentagon"][fidelity]["seconds"] for run in runs.values()])
        for fidelity in ("fast", "balanced", "reference")
    }
    shown = ["{:.1f} [{:.1f}, {:.1f}] s".format(*mean_with_interval(each)) for each in seconds.values()]
    if page == "results.md":
        assert f"| 0.2 s | {' | '.join(shown)} |" in text
        assert "seed 1 |" not in text
    assert f"{seconds['fast'].mean():.1f}" in text


def test_every_learner_is_measured_and_none_twice(small, tmp_path, capsys):
    out = tmp_path / "in_time.json"
    names = ("pairs", "shares", "gaussian", "sac", "td3", "later")
    command = ["learning.timed", "--trainings", *names, "--paths", "2", "--again", "fast"]
    command += ["--networks", str(tmp_path), "--out", str(out)]
    assert main([*command, "--seeds", "0"]) == 0
    first = json.loads(out.read_text())
    for name in names:
        found = first["runs"][name]["0"]
        assert found["training_s"] > 0.0 and found["pentagon"].keys() == {"fast"}
        assert found["pentagon"]["fast"]["seconds"] == 2.0 and found["held_out"]["arrived"] == 0
        assert f"| {name} | 1 | 2.0 |" in as_markdown(first["runs"])
    assert out.with_suffix(".png").is_file()
    capsys.readouterr()
    assert main([*command, "--seeds", "0", "1", "--trainings", "pairs"]) == 0
    assert ", 0: " not in capsys.readouterr().out
    again = json.loads(out.read_text())
    assert again["runs"]["pairs"].keys() == {"0", "1"} and again["runs"]["pairs"]["0"] == first["runs"]["pairs"]["0"]


def test_sac_takes_gradient_steps_on_the_native_batch(small, tmp_path, monkeypatch):
    taken = []
    monkeypatch.setattr(SAC, "train", lambda model, gradient_steps, batch_size: taken.append(gradient_steps))
    learned = learn("sac", 0, "fast", tmp_path)
    assert isinstance(learned.policy, ReducedPolicy) and len(taken) == 6  # of 8 decisions, 2 come before
    done = swim(
        "sac", learned.policy, SeastarSwimEnv(actions="continuous", decision_period=0.5, fidelity="fast"), max_strokes=3
    )
    assert np.all((done.heating_time > 0.0) & (done.heating_time < 0.5))


def test_a_training_begins_with_another_s_network(small, tmp_path, monkeypatch):
    learn("pairs", 0, "fast", tmp_path)
    monkeypatch.setitem(trainings.TRAININGS, "later", replace(trainings.TRAININGS["later"], decisions=0))
    learn("later", 0, "fast", tmp_path)
    before, after = (checkpoint.load(trainings.network_file(tmp_path, name, 0)) for name in ("pairs", "later"))
    assert (before.decision_period, after.decision_period) == (0.5, 0.2)
    for name, weights in before.weights.items():
        np.testing.assert_array_equal(after.weights[name], weights)


def test_a_network_that_is_there_is_not_trained_again(small, tmp_path):
    first = learn("pairs", 0, "fast", tmp_path)
    again = learn("pairs", 0, "fast", tmp_path)
    assert first.seconds > 0.0 and again.seconds is None
    for name, weights in first.policy.weights.items():
        np.testing.assert_array_equal(again.policy.weights[name], weights)


def test_shares_are_those_of_pairs():
    table = shares_of_pairs(5, (1.0, 0.6))
    assert table.shape == (41, 5)
    np.testing.assert_array_equal(table[:21], command_table("pairs", 5))
    np.testing.assert_allclose(table[21:], 0.6 * table[1:21])
    env = ChosenCommands(SeastarSwimVectorEnv(2, actions="continuous", decision_period=0.5, fidelity="fast"), table)
    assert env.action_space == gym.spaces.MultiDiscrete([41, 41])
    env.reset(seed=0)
    *_, info = env.step(np.array([0, 30]))
    np.testing.assert_allclose(info["heating_time"], [0.0, 0.12])


class Numbers:
    """Model that answers with a linear function of the observation, as numbers of commands or as commands."""

    def __init__(self, size, discrete):
        self.weights, self.discrete = np.random.default_rng(0).normal(size=(size, 5)), discrete

    def predict(self, observation, state, episode_start, deterministic):
        found = np.tanh(observation @ self.weights)
        return (np.argmax(found, axis=-1) * 7 if self.discrete else found), None


@pytest.mark.parametrize("discrete", [True, False])
def test_policies_of_shares_are_equivariant(discrete):
    scene, rng = make_scene(None, "fast", 0.5), np.random.default_rng(1)
    table = shares_of_pairs(5, (1.0, 0.6)) if discrete else None
    policy = ReducedPolicy(Numbers(196, discrete), symmetry.Symmetry.of(scene, "continuous"), table)
    seen = rng.normal(size=(50, 196)).astype(np.float32)
    assert_equivariant(policy, seen, symmetry.memory_mirror(scene.actuator), atol=1e-4)


def test_pulses_per_metre_are_those_of_the_path():
    assert pulses_per_metre([0.76 * 0.7185 * 300.0]) == pytest.approx(300.0, rel=1e-6)


def test_an_unknown_training_is_refused():
    with pytest.raises(ValueError, match="Unknown training 'faster'"):
        Options(trainings=("faster",))
