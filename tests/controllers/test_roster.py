"""Agents by name: one line adds one, and the command lines tell all names."""

import pytest

from declared import assert_declared_as_recorded
from seastar_gym import Scene, Seastar
from seastar_gym.cli.main import main
from seastar_gym.controllers.roster import AGENTS, load_agent, load_agents
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
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert ", ".join(AGENTS) in text and ", ".join(GAITS) in text
    assert "usage: seastar evaluate" in text and ", ".join(PATHS) in text


def test_defaults_and_constants_are_declared_as_recorded():
    assert_declared_as_recorded("seastar_gym.controllers")
