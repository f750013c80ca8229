"""Minari datasets: written by one command, read back, learned from."""

import os
import runpy
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

minari = pytest.importorskip("minari")
pytest.importorskip("h5py")
pytest.importorskip("torch")

from refusals import assert_refused, assert_told  # noqa: E402
from seastar_gym.cli.main import main  # noqa: E402
from seastar_gym.controllers import pretrained  # noqa: E402
from seastar_gym.data.dataset import record, write  # noqa: E402

ROOT = Path(__file__).parents[2]
OFFLINE = runpy.run_path(str(ROOT / "examples" / "offline.py"), run_name="offline")
SWIM = "SeastarSwim-v0"
pytestmark = pytest.mark.filterwarnings("ignore")  # of Minari's own, and of the packages that it imports


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Datasets of three qualities, of one path for all robots."""
    place = tmp_path_factory.mktemp("data")
    before = os.environ.get("MINARI_DATASETS_PATH")
    arguments = ["--tasks", SWIM, "--episodes", "2", "--fidelity", "fast", "--out", str(place)]
    assert main(["data", *arguments]) == 0
    yield place
    if before is None:
        del os.environ["MINARI_DATASETS_PATH"]
    else:
        os.environ["MINARI_DATASETS_PATH"] = before


def returns(dataset):
    return [one.rewards.sum() for one in dataset.iterate_episodes()]


def test_one_command_writes_three_qualities(folder, capsys):
    names = [f"SeastarSwim/{quality}-v0" for quality in ("random", "greedy", "learned")]
    assert set(names) <= set(minari.list_local_datasets())
    random, greedy, learned = (minari.load_dataset(name) for name in names)
    assert [one.total_episodes for one in (random, greedy, learned)] == [2, 2, 2]
    assert np.mean(returns(random)) < np.mean(returns(greedy)) < np.mean(returns(learned))
    assert learned.storage.metadata["algorithm_name"] == "learned"
    assert "seastar data --tasks SeastarSwim-v0" in learned.storage.metadata["description"]


def test_what_is_read_back_is_what_was_swum(folder):
    """The environment that a dataset makes anew does the recorded episodes again, with their infos."""
    dataset = minari.load_dataset("SeastarSwim/learned-v0")
    env = dataset.recover_environment()
    for episode, metadata in zip(dataset.iterate_episodes(), dataset.storage.get_episode_metadata([0, 1]), strict=True):
        observation, info = env.reset(seed=int(metadata["seed"]))
        for step, action in enumerate(episode.actions):
            np.testing.assert_array_equal(episode.observations[step], observation)
            np.testing.assert_array_equal(episode.infos["hub_position"][step], info["hub_position"])
            observation, reward, terminated, truncated, info = env.step(action)
            assert reward == episode.rewards[step]
        assert episode.infos["is_success"][-1] and terminated and not truncated
        assert episode.terminations.tolist() == [False] * (len(episode) - 1) + [True]


def test_a_dataset_is_not_written_over(folder, capsys):
    arguments = ["--tasks", SWIM, "--agents", "random", "--episodes", "1", "--fidelity", "fast", "--out", str(folder)]
    assert main(["data", *arguments]) == 2
    assert "There is a dataset SeastarSwim/random-v0 already" in capsys.readouterr().err
    assert minari.load_dataset("SeastarSwim/random-v0").total_episodes == 2
    assert main(["data", *arguments[:2], "--agents", "again=random", *arguments[4:]]) == 0
    assert minari.load_dataset("SeastarSwim/again-v0").total_episodes == 1


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["--episodes", "0"], "--episodes must be"),
        (["--tasks", "Nothing-v0"], "There is no task 'Nothing-v0'"),
        (["--tasks", "SeastarPrey-v0", "--agents", "random", "--random-paths"], "SeastarPrey-v0 has no paths"),
        (["--agents", "nobody"], "Unknown scripted agent 'nobody'"),
        (["--tasks", "SeastarMiswired-v0", "--agents", "greedy"], "greedy is not recorded on SeastarMiswired-v0"),
    ],
)
def test_what_cannot_be_recorded_is_said_in_a_sentence(folder, arguments, words, capsys):
    assert main(["data", "--fidelity", "fast", "--out", str(folder), *arguments]) == 2
    assert_told(capsys, words)
    with assert_refused("There are no episodes for SeastarSwim/none-v0."):
        write([], "SeastarSwim/none-v0", SWIM, "nobody")


@pytest.fixture(scope="module")
def timed(folder):
    """A dataset of the bundled policy for decisions every 0.5 s."""
    how = {"actions": "pairs", "fidelity": "fast"}
    episodes = record("SeastarSwimTimed-v0", pretrained("timed-0.5s"), 2, **how)
    return write(episodes, "SeastarSwimTimed/learned-v0", "SeastarSwimTimed-v0", "learned", **how)


@pytest.mark.parametrize("learner", ["cloning", "cql"])
def test_offline_learners_do_what_was_recorded(timed, learner):
    """From a few hundred decisions of one policy, either learner takes most of them again; chance would take 5 %."""
    options = OFFLINE["Options"]("", learner, updates=300, batch_size=64)
    data = OFFLINE["decisions_of"](timed)
    network, losses = OFFLINE["learn"](data, 21, options)
    assert np.mean(losses[-20:]) < 0.5 * np.mean(losses[:20])
    agreed = (network(data.seen).argmax(1) == data.actions).float().mean()
    assert agreed > 0.7
    env = gym.wrappers.TimeLimit(timed.recover_environment(), 3)
    assert len(OFFLINE["returns_of"](network, env, 1)) == 1


def test_values_of_rewarded_actions_are_higher():
    """Two states and two actions, of which one is rewarded: CQL prefers it, cloning what was done more often."""
    torch = pytest.importorskip("torch")
    seen = torch.eye(2).repeat(50, 1)
    actions = (torch.arange(100) % 5 == 0).long()  # the second action is rare, and the rewarded one
    data = OFFLINE["Decisions"](seen, actions, 10.0 * actions.float(), seen, torch.zeros(100))
    chosen = {}
    for learner in ("cloning", "cql"):
        options = OFFLINE["Options"]("", learner, updates=400, batch_size=100, conservatism=0.1, hidden=16)
        network, _ = OFFLINE["learn"](data, 2, options)
        chosen[learner] = network(torch.eye(2)).argmax(1).tolist()
    assert chosen == {"cloning": [0, 0], "cql": [1, 1]}


def test_the_tasks_have_datasets_of_three_qualities_by_one_command(tmp_path, monkeypatch, capsys):
    from studies.command import main as make

    monkeypatch.setenv("MINARI_DATASETS_PATH", "")
    arguments = ["tasks", "--tasks", "SeastarPrey-v0", "--episodes", "2", "--out", str(tmp_path)]
    assert make(arguments) == make(arguments) == 0
    assert capsys.readouterr().out.count("is there already") == 3
    for quality in ("random", "greedy", "learned"):
        dataset = minari.load_dataset(f"SeastarPrey/{quality}-v0")
        assert dataset.total_episodes == 2 and dataset.total_steps == 400
        assert dataset.recover_environment().unwrapped.actions == "pairs"
