"""A model of plain Stable-Baselines3 and a function of one's own swim in every evaluation; others are refused."""

import csv
import pickle
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import A2C, DQN, PPO

from refusals import assert_refused, assert_told
from seastar_gym import Numerics, Scene, Seastar
from seastar_gym.cli.evaluate import main
from seastar_gym.controllers.contract import actions_of
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.registry import load_agents
from seastar_gym.controllers.third_party import load_model
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.evaluation.many import swim_many
from seastar_gym.evaluation.swim import swim

FAST = Scene(numerics=Numerics.preset("fast"))
LEARNERS = {
    "limbs": (PPO, {"n_steps": 8, "batch_size": 8, "n_epochs": 1}),
    "pairs": (DQN, {"learning_starts": 4, "buffer_size": 100, "batch_size": 4}),
    "joint": (A2C, {"n_steps": 4}),
}


def train(actions, scene=FAST):
    """A model of Stable-Baselines3 that has learned for a few strokes, on the plain environment."""
    kind, arguments = LEARNERS[actions]
    env = gym.make("SeastarSwim-v0", actions=actions, scene=scene, max_episode_steps=5)
    return kind("MlpPolicy", env, policy_kwargs={"net_arch": [8]}, seed=0, device="cpu", **arguments).learn(16)


@pytest.fixture(scope="module", params=LEARNERS)
def trained(request, tmp_path_factory):
    """A model, the action mode that it is for, and the file that it was saved in."""
    model, file = train(request.param), tmp_path_factory.mktemp("models") / "model.zip"
    model.save(file)
    return model, request.param, file


# Models of Stable-Baselines3


def test_a_model_acts_as_it_did_when_it_was_saved(trained):
    model, actions, file = trained
    (policy,) = load_agents([str(file)]).values()
    assert actions_of(policy, 5) == actions
    observations = np.random.default_rng(0).normal(size=(50, 186)).astype(np.float32)
    acted, expected = (one.predict(observations, deterministic=True)[0] for one in (policy, model))
    np.testing.assert_array_equal(acted, expected)
    alone = [policy.predict(observation, deterministic=True)[0] for observation in observations]
    np.testing.assert_array_equal(alone, expected)


def test_a_model_swims_alone_as_in_a_batch(trained):
    model, actions, file = trained
    policy = load_model(file)
    one = swim("mine", policy, SeastarSwimEnv(actions=actions, scene=FAST), max_strokes=4)
    many = swim_many("mine", model, "pentagon", 2, FAST, max_strokes=4, threads=1)
    for done in many:
        np.testing.assert_allclose(done.hub, one.hub, atol=1e-12)


def test_a_model_is_given_to_the_command_lines(trained, tmp_path, capsys):
    file, out = trained[2], tmp_path / "out"
    command = ["--agents", str(file), "--fidelity", "fast"]
    assert main([*command, "--seconds", "2", "--out", str(out)]) == 0
    assert "model" in capsys.readouterr().out and (out / "evaluation.csv").is_file()


@pytest.fixture
def short_trials(monkeypatch):
    """Trials on one path."""
    monkeypatch.setattr("seastar_gym.evaluation.trials.NOMINAL", ("line",))


def rows_of_trials(agent, file):
    command = ["--agents", agent, "--sets", "nominal", "--fidelity", "fast", "--out", str(file)]
    command += ["--num-threads", "1", "--seconds", "3"]
    assert main(command) == 0
    with file.open(newline="", encoding="utf-8") as stream:
        return [row["agent"] for row in csv.DictReader(stream)]


def test_a_model_is_given_to_the_trials(trained, short_trials, tmp_path):
    assert rows_of_trials(str(trained[2]), tmp_path / "trials.csv") == ["model"]


def test_help_says_what_may_be_executed(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "module:function" in text and "load only files that you trust" in text


def test_the_documentation_says_what_may_be_executed():
    text = " ".join((Path(__file__).parents[2] / "docs" / "controllers.md").read_text(encoding="utf-8").split())
    assert "module:function" in text and "load only files that you trust" in text


@pytest.mark.parametrize("actions", LEARNERS)
def test_a_model_of_another_robot_is_refused_before_the_first_stroke(actions):
    policy = train(actions, Scene(Seastar(n_limbs=4, nodes_per_limb=4), numerics=FAST.numerics)).policy
    env = SeastarSwimEnv(actions=actions, scene=FAST)
    with assert_refused("sees observations of shape (150,), the environment's have (186,)"):
        swim("mine", policy, env, max_strokes=1)
    with assert_refused("acts in"):
        swim_many("mine", policy, "line", 2, FAST, threads=1)


def test_a_model_for_another_action_mode_is_refused_before_the_first_stroke(trained):
    other = {"limbs": "joint", "pairs": "limbs", "joint": "pairs"}[trained[1]]
    with assert_refused("The policy acts in", f'actions="{other}"'):
        swim("mine", trained[0], SeastarSwimEnv(actions=other, scene=FAST), max_strokes=1)


def zipped(file, **entries):
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in entries.items():
            archive.writestr(name.replace("_", "."), data)
    return str(file)


@pytest.mark.parametrize(
    "entries",
    [
        {"data": b"{}", "policy_pth": b""},
        {"data": b"null", "policy_pth": b"no pickle"},
        {"data": b"\xff", "policy_pth": b"\x80\x04}\x94."},
        {"data": b'{"policy_class": 3}', "policy_pth": b""},
        {"data": b""},
        {"something": b"else"},
    ],
)
def test_a_zip_that_is_no_model_is_refused_in_a_sentence(entries, tmp_path):
    with assert_refused("model.zip"):
        load_agents([zipped(tmp_path / "model.zip", **entries)])


def test_a_damaged_model_is_refused_in_a_sentence(trained, tmp_path):
    with zipfile.ZipFile(trained[2]) as archive:
        entries = {name: archive.read(name) for name in ("data", "policy.pth")}
    for name, data in (("data", entries["data"][:-20]), ("policy.pth", entries["policy.pth"][:-200]), ("data", b"{}")):
        changed = {**entries, name: data}
        file = zipped(tmp_path / "model.zip", data=changed["data"], policy_pth=changed["policy.pth"])
        with assert_refused("is damaged, or no model of Stable-Baselines3"):
            load_agents([file])


class Bomb:
    def __reduce__(self):
        return pytest.fail, ("it was unpickled",)


def test_a_model_of_this_project_is_not_unpickled(tmp_path):
    """It says what it is in policy.json: pickles instead of its weights are not run."""
    description, bomb = Description("pairs", False, FAST, (4,)).to_json(), pickle.dumps(Bomb(), protocol=2)
    file = zipped(tmp_path / "model.zip", data=b"{}", policy_pth=bomb, policy_json=description)
    with assert_refused("model.zip"):
        load_agents([file])


def test_weights_that_are_not_finite_are_refused(tmp_path):
    model = train("joint")
    next(model.policy.parameters()).data[0] = float("nan")
    model.save(tmp_path / "model.zip")
    with assert_refused("has weights that are not finite"):
        load_agents([str(tmp_path / "model.zip")])


@pytest.mark.parametrize("name", ["policy.pth", "model.pkl", "runs/policy.pt"])
def test_pickles_are_no_policies(name):
    with assert_refused("A policy is in a file named .safetensors"):
        load_agents([name])


# Functions


@pytest.fixture
def own(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parent)
    return "own_agents:Towards"


def test_a_function_gets_the_environment_and_its_policy_swims_in_every_evaluation(own, short_trials, tmp_path):
    (policy,) = load_agents([own], fidelity="fast").values()
    assert policy.actions == "pairs" and policy.scene == Scene.preset("fast")
    (done,) = evaluate({"own": policy}, [[0.05, 0.0]], fidelity="fast", max_strokes=3)
    assert done.strokes == 3 and (done.limbs_heated == 2).all()
    assert rows_of_trials(own, tmp_path / "trials.csv") == [own]


def test_a_model_that_a_function_returns_keeps_its_action_mode(monkeypatch, trained):
    model, actions, _ = trained
    module = SimpleNamespace(make=lambda env: model)
    monkeypatch.setitem(sys.modules, "a_module", module)
    (policy,) = load_agents(["a_module:make"]).values()
    assert actions_of(policy, 5) == actions
    (done,) = evaluate({"own": policy}, [[0.05, 0.0]], fidelity="fast", max_strokes=2)
    assert done.strokes == 2


@pytest.mark.parametrize(
    "name, words",
    [
        ("no_such_module:make", "No module named 'no_such_module'"),
        ("own_agents:missing", "the module own_agents has no function missing"),
        ("own_agents:number", "the module own_agents has no function number"),
        ("own_agents:nothing", "is a int, which has no predict"),
    ],
)
def test_a_function_that_makes_no_policy_is_refused(own, name, words, capsys):
    with assert_refused(words):
        load_agents([name])
    assert main(["--agents", name]) == 2
    assert_told(capsys, words)
