"""Agents by name, and what controllers refuse in a sentence."""

import json
import json.decoder
import os
import pickle
import subprocess
import sys
import zipfile
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

import seastar_gym
from later import Later
from refusals import assert_refused
from seastar_gym import Numerics, Scene, Seastar, SmaWires
from seastar_gym.controllers import registry as third_party
from seastar_gym.controllers.contract import actions_of, observed, require_fit, require_policy, starts
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import BUNDLED, bundled_file, by_name, load, of_task, pretrained
from seastar_gym.controllers.open_loop import OpenLoopPolicy, RandomPolicy, scripted
from seastar_gym.controllers.registry import AGENTS, call_function, default_agents, files_of, load_agent, load_agents
from seastar_gym.controllers.search import GreedyPolicy, Planner
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import SymmetryReduction
from seastar_gym.evaluation.swim import swim, swim_many

stable_baselines3 = Later("stable_baselines3")

FAST = Scene(numerics=Numerics.preset("fast"))
FOUR = Scene(Seastar(4))
TWO = Scene(Seastar(limb_length=np.array([0.1, 0.09])))


def agent(**attributes):
    """Policy with attributes of its own."""
    return SimpleNamespace(predict=lambda *_: None, **attributes)


def env(actions):
    return SeastarSwimEnv(actions=actions, scene=FAST)


def fitting(policy, **more):
    """Whether a policy can drive the chapter's robot."""
    return require_fit(policy, FAST, "pairs", **more)


def a2c():
    """A small model of Stable-Baselines3."""
    return stable_baselines3.A2C("MlpPolicy", env("joint"), policy_kwargs={"net_arch": [8]}, device="cpu")


def gait(state):
    """Decision of a gait with a state that no call gave."""
    return scripted("pentagon").predict(np.zeros((2, 186), np.float32), state)


def planned(moves):
    return Planner(decision_period=0.05, moves=moves)


REFUSED = [
    (lambda: require_policy(3), "must have predict(observation, ...)"),
    (lambda: require_policy(RandomPolicy), "must have predict(observation, ...)"),
    (lambda: actions_of(agent(action_space=Discrete(7)), 5), "is no action mode of a robot of 5"),
    (lambda: fitting(agent(decision_period=0.5)), "decides every 0.5 s, the environment every 1 s"),
    (lambda: fitting(agent(decision_period=1.0), decision_period=0.5), "the environment every 0.5 s"),
    (lambda: fitting(agent(observation_space=Box(-1.0, 1.0, (7,)))), "of shape (7,), the environment's"),
    (lambda: fitting(agent(observation_space=Box(-1.0, 1.0, (186,))), n_seen=191), "the environment's have (191,)"),
    (lambda: fitting(agent(action_space=Discrete(243))), 'environment with actions="pairs"'),
    (lambda: observed(np.zeros(3), 4), "with 4 numbers or more, not (3,)"),
    (lambda: starts([True] * 3, 2), "episode_start must be flags of shape (2,)"),
    (lambda: GreedyPolicy(TWO), "scene must be that of one robot."),
    (lambda: planned(np.zeros((1, 20, 4))), "moves must be numbers of shape"),
    (lambda: planned(np.zeros((0, 20, 5))), "moves must have shape"),
    (lambda: planned(np.full((1, 20, 5), 1.5)), "moves must be shares of a pulse from -1 to 1"),
    (lambda: planned(np.full((1, 20, 5), np.nan)), "moves must be finite numbers"),
    (lambda: load_agents(["rest", "rest"]), "The agent 'rest' is named twice."),
    (lambda: load_agents(["pentagon"], scene=FOUR), "are for five limbs, not 4"),
    (lambda: load_agents(["gallop"]), "Others are learned, greedy, planner, gait-planner"),
    *((lambda name=name: load_agents([name]), "A policy is in a file named .safetensors")
      for name in ("policy.pth", "model.pkl", "runs/policy.pt")),
    *((lambda name=name: scripted(name), "pentagon, straight, rest, lagged, thrifty, wave, lagged-pentagon, random")
      for name in ("pentagram", "", "2+", "2+,5+", "2-,5-", "a+,b-", "1+,2-,3+")),
    *((lambda name=name: scripted(name), "two different limbs from 1 to 5") for name in ("1+,1-", "1+,6-", "0+,1-")),
    *((lambda name=name: scripted(name, n_limbs=4, decision_period=0.5), "are for five limbs, not 4.")
      for name in ("pentagon", "wave", "lagged-pentagon")),
    *((lambda gait=gait: scripted(gait[0], decision_period=gait[1]), "decision") for gait in (
        ("lagged", None), ("lagged", 1.0), ("wave", 0.5), ("pentagon", 0.3), ("lagged-pentagon", 0.7))),
    (lambda: OpenLoopPolicy(np.ones((1, 5)), "pairs"), 'no action with actions="pairs"'),
    (lambda: OpenLoopPolicy(np.full((1, 5), 0.5), "limbs"), 'no action with actions="limbs"'),
    (lambda: swim("a", agent(action_space=Discrete(243)), env("pairs"), max_strokes=1), 'actions="pairs"'),
    (lambda: swim_many("a", agent(observation_space=Box(-1.0, 1.0, (7,))), "line", 2, FAST), "of shape (7,), the"),
    *((lambda made=made: gait(made), "decisions made of shape (2,).") for made in (
        *((one,) for one in (np.zeros(2), [0, 0], np.zeros(3, int), np.zeros(1, int), np.zeros((2, 1), int))),
        np.zeros(2, int), (np.zeros(2, int),) * 2)),
    (lambda: bundled_file(-1.0), "decision_period"),
    (lambda: bundled_file(None, task=3), "task"),
    *((lambda name=name: pretrained(name), "There is no bundled policy|take one of strokes, timed-0.2s, timed-0.5s, ")
      for name in ("timed-0.3s", 0.2)),
    *((lambda name=name: files_of(name), "no file has the module")
      for name in ("nowhere_at_all:make", "sys:exit", "nowhere.at_all:make")),
]  # fmt: skip
"""What is refused, and words of the sentence."""


def test_what_no_controller_could_use_is_refused_in_a_sentence(subtests):
    for call, words in REFUSED:
        with subtests.test(words), assert_refused(*words.split("|")):
            call()


# Agents by name: one line adds one.


def test_agents_are_made_for_their_scene_and_swim(monkeypatch):
    scenes = []

    def mine(scene, decision_period, task):
        assert decision_period is None and task is None
        scenes.append(scene)
        return scripted("rest")

    monkeypatch.setitem(AGENTS, "mine", mine)
    monkeypatch.syspath_prepend(Path(__file__).parent)
    agents = load_agents(["mine", "own_agents:Towards"], fidelity="fast")
    assert list(agents) == ["mine", "own_agents:Towards"]
    assert [type(scene) for scene in scenes] == [Scene] and scenes[0] == Scene.preset("fast")
    assert agents["own_agents:Towards"].scene == Scene.preset("fast")
    model = a2c()
    monkeypatch.setitem(sys.modules, "a_module", SimpleNamespace(make=lambda env: model))
    assert actions_of(load_agents(["a_module:make"])["a_module:make"], 5) == "joint"
    env = SeastarSwimEnv(fidelity="fast", scene=Scene(Seastar(4)))
    action, _ = load_agent("rest", env).predict(env.reset(seed=0)[0])
    assert env.action_space.contains(action) and not env.step(action)[4]["limbs_heated"]
    assert default_agents(Scene()) == ("learned", "pentagon") and default_agents(FOUR) == ("greedy", "straight")


def test_policies_have_names_and_files(monkeypatch):
    strokes, timed, own = bundled_file(None), bundled_file(0.5), Path("runs/mine.safetensors")
    of_miswired = BUNDLED.parent / "tasks" / "miswired-0.5s.safetensors"
    for name, period, expected in (
        ("learned", None, [strokes, strokes.with_suffix(".json")]),
        ("learned", 0.5, [timed, timed.with_suffix(".json")]),
        ("timed-0.2s", None, [bundled_file(0.2), bundled_file(0.2).with_suffix(".json")]),
        (str(own), None, [own, own.with_suffix(".json")]),
        ("model.zip", None, [Path("model.zip")]),
        ("runs/mine", None, [Path("runs/mine")]),
        ("json.decoder:JSONDecoder", None, [Path(json.decoder.__file__)]),
        *((name, None, []) for name in ("greedy", "planner", "straight", "4+,1-")),
    ):  # fmt: skip
        assert files_of(name, period) == expected
    names = [bundled_file(period).name for period in (None, 0.5, 0.1)]
    assert names == ["strokes.safetensors", "timed-0.5s.safetensors", "timed-0.1s.safetensors"]
    assert bundled_file(0.5, task="miswired") == of_task("miswired", 0.5) == of_miswired
    assert of_task("miswired", None).name == "miswired.safetensors"
    assert bundled_file(0.25, task="miswired").name == "timed-0.25s.safetensors"  # of waypoints, where there is none
    for name, file in by_name().items():
        assert Description.from_facts(json.loads(file.with_suffix(".json").read_text())).scene == pretrained(name).scene
    assert pretrained().decision_period == 1.0
    assert load_agents(["timed-0.2s"], decision_period=0.2)["timed-0.2s"].decision_period == 0.2
    monkeypatch.setattr("seastar_gym.controllers.registry.is_model", lambda file: False)
    monkeypatch.setattr("seastar_gym.controllers.learned.load", lambda file: file)
    named = load_agents(["best.zip", "runs/last.safetensors", "runs/best.zip"])
    files = {"best": "best.zip", "last": "runs/last.safetensors", "runs/best": "runs/best.zip"}
    assert named == {label: Path(file) for label, file in files.items()}


# Zips: models of Stable-Baselines3, which are unpickled, and those of this project, which are not.


class Bomb:
    def __reduce__(self):
        return pytest.fail, ("it was unpickled",)


def zipped(folder, **entries):
    with zipfile.ZipFile(folder / "model.zip", "w") as archive:
        for name, data in entries.items():
            archive.writestr(name.replace("_", "."), data)
    return folder / "model.zip"


ABOUT = Description("pairs", False, FAST, (4, 3)).to_json()
ZIPS = [
    ({"data": b"{}", "policy_pth": b""}, True),
    ({"data": b"null", "policy_pth": b"no pickle"}, True),
    ({"data": b"\xff", "policy_pth": b"\x80\x04}\x94."}, True),
    ({"data": b'{"policy_class": 3}', "policy_pth": b""}, True),
    ({"data": b""}, False),
    ({"policy_pth": b""}, False),
    ({"something": b"else"}, False),
    ({"data": b"{}", "policy_pth": pickle.dumps(Bomb(), protocol=2), "policy_json": ABOUT}, False),
]
"""Entries of zips that are no models, and whether they look like others' ones."""


@pytest.mark.parametrize("entries, is_others", ZIPS)
def test_a_zip_that_is_no_model_is_refused_in_a_sentence_and_ours_is_not_unpickled(entries, is_others, tmp_path):
    file = zipped(tmp_path, **entries)
    assert third_party.is_model(file) == is_others
    with assert_refused("model.zip"):
        load_agents([str(file)])
    for damage, error in ((lambda: file.write_bytes(b"no zip"), ValueError), (file.unlink, FileNotFoundError)):
        damage()
        assert not third_party.is_model(file)
        with pytest.raises(error, match=r"model\.zip.*\.$"):
            load(file)


@pytest.mark.parametrize("wrap", [lambda env: env, SymmetryReduction], ids=["plain", "reduced"])
def test_a_model_says_how_often_it_decides(wrap, tmp_path):
    """Its observations have the same shape at any period."""

    def wires(period):
        return SeastarSwimEnv(scene=Scene(actuator=SmaWires(), numerics=FAST.numerics), decision_period=period)

    learned = stable_baselines3.A2C("MlpPolicy", wrap(wires(0.5)), policy_kwargs={"net_arch": [8]}, device="cpu")
    learned.save(tmp_path / "model.zip")
    refused = assert_refused("decides every 0.5 s, the environment every 0.2 s")
    for period, fits in ((0.5, nullcontext()), (0.2, refused)):
        with fits:
            swim("mine", load_agent(str(tmp_path / "model.zip"), wires(period)), wires(period), max_strokes=1)


def test_a_damaged_model_is_refused_in_a_sentence(tmp_path):
    model = a2c()
    model.save(tmp_path / "whole.zip")
    with zipfile.ZipFile(tmp_path / "whole.zip") as archive:
        data, policy = archive.read("data"), archive.read("policy.pth")
    for entries in ((data[:-20], policy), (data, policy[:-200]), (b"{}", policy)):
        with assert_refused("is damaged, or no model of Stable-Baselines3"):
            load_agents([str(zipped(tmp_path, data=entries[0], policy_pth=entries[1]))])
    next(model.policy.parameters()).data[0] = float("nan")
    model.save(tmp_path / "model.zip")
    with assert_refused("has weights that are not finite"):
        load_agents([str(tmp_path / "model.zip")])


# Agents of a user's own module: found in the current folder, and asked for one robot at a time


MINE = """
import numpy as np

class Mine:
    actions = "pairs"

    def __init__(self):
        self.decisions = 0

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert observation.ndim == 1
        self.decisions += 1
        return np.int64((self.decisions + 7 * (observation[0] > 0)) % 21), state

def make(env):
    return Mine()
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    Path("mine_of_one.py").write_text(MINE)
    yield tmp_path
    sys.modules.pop("mine_of_one", None)


def test_a_robot_in_company_swims_as_alone(here):
    policy = call_function("mine_of_one:make", None)
    first, second = (swim_many("mine", policy, "random", 3, FAST, max_strokes=6, threads=1) for _ in range(2))
    for one, again in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.cross_track_errors, again.cross_track_errors)
    observation = np.random.default_rng(0).standard_normal((3, 40)).astype(np.float32)
    state = None
    for decision in range(1, 5):
        actions, state = policy.predict(observation, state, np.full(3, decision == 1))
        assert actions.tolist() == [(decision + 7 * (row[0] > 0)) % 21 for row in observation]


def test_a_batched_policy_gets_all_observations_of_one_robot_too(here):
    code = MINE.replace("ndim == 1", "ndim == 2").replace("np.int64((", "(np.zeros(len(observation), int) + (")
    Path("mine_of_one.py").write_text(code.replace('actions = "pairs"', 'actions, batched = "pairs", True').replace(
        "observation[0] > 0", "observation[:, 0] > 0"
    ))  # fmt: skip
    policy = call_function("mine_of_one:make", None)
    observation = np.ones((2, 40), np.float32)
    one, many = (policy.predict(seen, None, None)[0] for seen in (observation[0], observation))
    assert np.shape(one) == () and np.shape(many) == (2,)


@pytest.mark.parametrize("words", [("evaluate", "--task", "SeastarSwim-v0", "--seeds", "2", "--decisions", "3"),
                                   ("evaluate", "--seconds", "3")])  # fmt: skip
def test_a_fresh_process_finds_it_in_the_current_folder(here, words):
    env = {**os.environ, "PYTHONPATH": str(Path(seastar_gym.__file__).parents[1])}
    line = [sys.executable, "-P", "-m", "seastar_gym.cli", *words, "--agents", "mine_of_one:make"]
    done = subprocess.run(line, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "mine_of_one:make" in done.stdout
