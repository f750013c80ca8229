"""The spec of an environment is written as JSON, and what is made from it is the same environment."""

import inspect
import json

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

from episodes import assert_same, assert_same_steps, swum
from refusals import assert_refused
from seastar_gym import (
    DomainRandomization,
HeadingTargets,
    Limited,
    Normal,
    Numerics,
    RewardWeights,
    Scene,
    Seastar,
    Sight,
    SmaPulse,
    SymmetryReduction,
    Uniform,
)
from seastar_gym.accuracy.chapter import STROKES
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.scene.serial import to_dict

ID = "SeastarSwim-v0"
SCENE = Scene(Seastar(nodes_per_limb=4), actuator=SmaPulse(0.5), numerics=Numerics.preset("fast"))
ARGUMENTS = {
    "nothing": {"fidelity": "fast"},
    "scene": {"scene": SCENE},
    "stateful scene": {"scene": Scene(actuator=Limited(SmaPulse(), 0.5, 3.0)), "fidelity": "fast"},
    "waypoints": {"path": np.array([[0.01, 0.1 / 3], [0.1, 0.0]]), "scene": SCENE},
    "waypoints in single precision": {"path": ((np.float32(0.1), 0), (1 / 3, np.float64(0.1))), "scene": SCENE},
    "actions": {"actions": "pairs", "path": "random", "random_heading": np.bool_(True), "scene": SCENE},
    "reward": {"reward": RewardWeights(100 / 3, 2, 0.0), "waypoint_radius": np.float64(0.1 / 3), "scene": SCENE},
    "randomization": {
        "randomization": DomainRandomization({"robot.density": Normal(1e3, 10 / 3), "fluid.density": Uniform(9, 99)}),
        "scene": SCENE,
    },
    "error_bars": {"error_bars": True, "scene": SCENE},
    "device": {"device": "scalar", "scene": SCENE},
    "decisions": {"decision_period": 0.2, "observe_actuators": False, "fidelity": "fast"},
    "continuous": {"actions": "continuous", "decision_period": np.float64(0.3), "fidelity": "fast"},
    "headings": {"headings": HeadingTargets((0.1, 1 / 3, 0.0, 1.0, 2.0)), "fidelity": "fast"},
    "one heading": {"headings": HeadingTargets(0.1, 1 / 3), "fidelity": "fast"},
    "sight": {
        "sight": Sight(1e2 / 3, Uniform(0.1, 1 / 3), dropout=0.1, sees=np.int64(3)), "decision_period": 0.5,
        "fidelity": "fast", "action_delay": Uniform(0.0, 1 / 3),
    },
    "a delay": {"sight": Sight(), "action_delay": np.float64(1.0), "fidelity": "fast"},
    "plain": {
        "sight": to_dict(Sight(delay=Uniform(0.1, 1 / 3))),
        "headings": to_dict(HeadingTargets("random")),
        "scene": SCENE.to_dict(),
        "reward": to_dict(RewardWeights(1.0)),
        "randomization": to_dict(DomainRandomization({"fluid.density": Uniform(900.0, 1000.0)})),
    },
}


def by_json(spec: EnvSpec) -> EnvSpec:
    """The spec by way of text, whose names a library may have sorted."""
    return EnvSpec.from_json(json.dumps(json.loads(spec.to_json()), sort_keys=True))


@pytest.mark.parametrize("arguments", ARGUMENTS)
def test_an_environment_comes_back_from_its_spec(arguments):
    env = gym.make(ID, **ARGUMENTS[arguments])
    spec = by_json(env.spec)
    assert spec == env.spec
    other = gym.make(spec)
    assert other.spec == env.spec and other.unwrapped.scene == env.unwrapped.scene
    assert_same(swum(env, 3), swum(other, 3))


@pytest.mark.parametrize("arguments", ["scene", "waypoints", "reward", "randomization", "sight", "plain"])
def test_a_native_batch_comes_back_from_its_spec(arguments):
    more = {"num_envs": 3, "autoreset_mode": AutoresetMode.SAME_STEP, "threads": 1, "max_episode_steps": 2}
    batch = gym.make_vec(ID, **more, **ARGUMENTS[arguments])
    other = gym.make_vec(by_json(batch.spec))
    assert other.num_envs == 3 and other.autoreset_mode is AutoresetMode.SAME_STEP
    assert other.spec == batch.spec
    np.testing.assert_array_equal(batch.reset(seed=3)[0], other.reset(seed=3)[0])
    batch.action_space.seed(4)
    for _ in range(3):
        actions = batch.action_space.sample()
        assert_same_steps(batch.step(actions), other.step(actions))


def test_a_batch_of_gymnasiums_own_comes_back_where_it_was_told_in_plain_form():
    batch = gym.make_vec(ID, 2, vectorization_mode="sync", scene=SCENE.to_dict())
    other = gym.make_vec(by_json(batch.spec))
    np.testing.assert_array_equal(batch.reset(seed=3)[0], other.reset(seed=3)[0])


def test_wrappers_come_back_too():
    env = SymmetryReduction(gym.make(ID, scene=SCENE, actions="pairs"))
    other = gym.make(by_json(env.spec))
    assert isinstance(other, SymmetryReduction)
    assert_same(swum(env, 3), swum(other, 3))


def test_a_spec_can_be_copied_changed_and_made_again():
    env = gym.make(ID, scene=SCENE)
    other = gym.make(env.spec, actions="pairs")
    assert other.unwrapped.actions == "pairs" and other.unwrapped.scene == SCENE
    assert SeastarSwimEnv().spec is None


class Own(SmaPulse):
    """An actuator that has no plain form."""


def test_a_spec_that_could_not_be_read_back_refuses_to_be_written_and_still_makes_environments():
    env = gym.make(ID, scene=Scene(actuator=Own(), numerics=Numerics.preset("fast")))
    with assert_refused("Scene.actuator is a Own", "seastar_gym.register_part"):
        env.spec.to_json()
    assert gym.make(env.spec).unwrapped.scene == env.unwrapped.scene


@pytest.mark.parametrize(
    "arguments, words",
    [
        ({"scene": {}}, "plain Scene is a dict with a version"),
        ({"scene": to_dict(RewardWeights())}, "plain RewardWeights, not a Scene"),
        ({"scene": {**SCENE.to_dict(), "version": 2}}, "version 2"),
        ({"scene": 3}, "scene must be a Scene"),
        ({"reward": {"progress": 1.0}}, "plain RewardWeights is a dict with a version"),
        ({"randomization": {"robot.density": [900, 1000]}}, "plain DomainRandomization is a dict with a version"),
    ],
)
@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
def test_plain_arguments_that_are_none_are_refused(make, arguments, words):
    with assert_refused(words):
        make(ID, **arguments)


def test_the_arguments_of_the_tables_are_those_of_the_environment():
    """A new argument is not forgotten."""
    told = {name for arguments in ARGUMENTS.values() for name in arguments}
    drawing = {"render_mode", "frames_per_stroke", "certificate"}  # a certificate has tests of its own
    assert told | drawing == set(inspect.signature(SeastarSwimEnv).parameters)


def test_a_certificate_by_its_path_is_a_text_in_the_spec(tmp_path):
    file = tmp_path / "strokes.json"
    file.write_bytes(STROKES.read_bytes())
    env = gym.make(ID, fidelity="fast", certificate=file)
    assert json.loads(env.spec.to_json())["kwargs"]["certificate"] == str(file)
