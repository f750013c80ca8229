"""Agents by name: one line adds one, and the command lines tell all names."""

import json
import json.decoder
from pathlib import Path

import pytest
from gymnasium.spaces import Discrete

from declared import assert_declared_as_recorded
from refusals import assert_refused
from seastar_gym import Scene, Seastar
from seastar_gym.cli.main import main
from seastar_gym.controllers.contract import actions_in, actions_of
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import BUNDLED, bundled_file, by_name, of_task, pretrained
from seastar_gym.controllers.registry import AGENTS, default_agents, files_of, load_agent, load_agents
from seastar_gym.controllers.scripted import GAITS, scripted
from seastar_gym.envs.paths import PATHS
from seastar_gym.envs.seastar_swim import SeastarSwimEnv


def test_an_agent_of_one_line_is_made_for_the_scene_of_the_fidelity(monkeypatch):
    scenes = []

    def mine(scene, decision_period, task):
        assert decision_period is None and task is None
        scenes.append(scene)
        return scripted("rest")

    monkeypatch.setitem(AGENTS, "mine", mine)
    assert list(load_agents(["mine", "rest"], fidelity="fast")) == ["mine", "rest"]
    assert [type(scene) for scene in scenes] == [Scene] and scenes[0] == Scene.preset("fast")


def test_an_agent_by_its_name_fits_the_environment():
    env = SeastarSwimEnv(fidelity="fast", scene=Scene(Seastar(4)))
    policy = load_agent("rest", env)
    action, _ = policy.predict(env.reset(seed=0)[0])
    assert env.action_space.contains(action) and not env.step(action)[4]["limbs_heated"]


def test_help_tells_the_names_of_all_agents(capsys):
    with pytest.raises(SystemExit):
        main(["evaluate", "--help"])
    text = " ".join(capsys.readouterr().out.replace("│", " ").split()).replace("- ", "-")  # names are parted at hyphens
    assert ", ".join(AGENTS) in text and ", ".join(GAITS) in text
    assert "usage: seastar evaluate" in text and ", ".join(PATHS) in text


def test_defaults_and_constants_are_declared_as_recorded():
    assert_declared_as_recorded("seastar_gym.controllers")


@pytest.mark.parametrize("n_limbs, names", [(5, ("learned", "pentagon")), (4, ("greedy", "straight"))])
def test_agents_by_default_fit_the_robot(n_limbs, names):
    assert default_agents(Scene(Seastar(n_limbs))) == names


def test_what_a_policy_is_made_of_has_files():
    box = bundled_file(None)
    assert files_of("learned") == [box, box.with_suffix(".json")]
    assert files_of("learned", 0.5) == [bundled_file(0.5), bundled_file(0.5).with_suffix(".json")]
    assert files_of("runs/mine.safetensors") == [Path("runs/mine.safetensors"), Path("runs/mine.json")]
    assert files_of("model.zip") == [Path("model.zip")] and files_of("runs/mine") == [Path("runs/mine")]
    named = bundled_file(0.2)
    assert files_of("timed-0.2s") == [named, named.with_suffix(".json")]
    assert load_agents(["timed-0.2s"], decision_period=0.2)["timed-0.2s"].decision_period == 0.2
    assert [files_of(name) for name in ("greedy", "planner", "straight", "4+,1-")] == [[]] * 4
    assert files_of("json.decoder:JSONDecoder") == [Path(json.decoder.__file__)]
    for nothing in ("nowhere_at_all:make", "sys:exit", "nowhere.at_all:make"):
        with assert_refused("no file has the module"):
            files_of(nothing)


def test_the_policy_in_the_box_is_that_of_the_task_and_the_decisions():
    assert [bundled_file(period).name for period in (None, 0.5, 0.1)] == [
        "strokes.safetensors", "timed-0.5s.safetensors", "timed-0.1s.safetensors",
    ]  # fmt: skip
    of_miswired = BUNDLED.parent / "tasks" / "miswired-0.5s.safetensors"
    assert bundled_file(0.5, task="miswired") == of_task("miswired", 0.5) == of_miswired
    assert of_task("miswired", None).name == "miswired.safetensors"
    assert bundled_file(0.25, task="miswired").name == "timed-0.25s.safetensors"  # of waypoints, where there is none
    for wrong in ({"decision_period": -1.0}, {"decision_period": None, "task": 3}):
        with assert_refused([*wrong][-1]):
            bundled_file(**wrong)


def test_a_bundled_policy_has_a_name():
    for name, file in by_name().items():
        assert Description.from_facts(json.loads(file.with_suffix(".json").read_text())).scene == pretrained(name).scene
    assert pretrained().decision_period == 1.0 and pretrained("timed-0.2s").decision_period == 0.2
    with pytest.warns(DeprecationWarning, match="The policy seastar-0.2s is called timed-0.2s now"):
        assert pretrained("seastar-0.2s").decision_period == 0.2
    for wrong in ("timed-0.3s", 0.2):
        with assert_refused("There is no bundled policy", "take one of strokes, timed-0.2s, timed-0.5s, fail-blind"):
            pretrained(wrong)


def test_a_policy_says_its_action_mode_or_takes_that_of_the_environment():
    class Silent:
        action_space = None

    class InPairs:
        action_space = Discrete(21)

    class Named:
        actions = "joint"

    assert [actions_in(policy(), "continuous", 5) for policy in (Silent, InPairs, Named)] == [
        "continuous", "pairs", "joint",
    ]  # fmt: skip
    assert actions_of(Silent(), 5) == "limbs" and actions_of(InPairs(), 5) == "pairs"


def test_a_gait_that_does_not_fit_says_so_and_an_unknown_one_what_there_is():
    with assert_refused("are for five limbs, not 4"):
        load_agents(["pentagon"], scene=Scene(Seastar(4)))
    with assert_refused("Unknown scripted agent 'gallop'", "Others are learned, greedy, planner, gait-planner"):
        load_agents(["gallop"])


def test_an_agent_is_named_once():
    with assert_refused("The agent 'rest' is named twice."):
        load_agents(["rest", "rest"])
