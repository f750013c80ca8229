"""The docstrings of the environments, which users read as the contract, say what the code does."""

import inspect
import itertools
import json
import re

import gymnasium as gym
import numpy as np
import pytest

from declared import assert_declared_as_recorded
from seastar_gym import TASKS, Headings, Limited, Numerics, RewardWeights, Scene, SmaPulse, SmaWires, ThermalSma
from seastar_gym.envs.layout import HEADINGS, VELOCITY_SCALE, Layout
from seastar_gym.envs.options import SwimOptions, scene_at, with_options
from seastar_gym.envs.paths import PATHS
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.serial import from_dict

CONTRACT = inspect.getdoc(SeastarSwimEnv)
TYPES = {"float": float, "int": int, "bool": bool, "str": str}


def section(title: str, text: str = CONTRACT) -> str:
    """Text of the section whose title begins so."""
    return re.split(r"^## ", re.split(rf"^## {title}.*$", text, flags=re.MULTILINE)[1], flags=re.MULTILINE)[0]


def table(title: str) -> list[dict[str, str]]:
    """Rows of the section's table, by the titles of the columns."""
    lines = section(title).splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("|"))
    lines = list(itertools.takewhile(lambda line: line.startswith("|"), lines[first:]))
    head, _, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [dict(zip(head, row, strict=True)) for row in rows]


def arguments(text: str) -> list[str]:
    return re.findall(r"^(\w+): ", text, flags=re.MULTILINE)


@pytest.mark.parametrize("row", table("Action"), ids=lambda row: row["`actions`"])
def test_the_actions_are_those_of_the_table(row):
    env = SeastarSwimEnv(actions=row["`actions`"].strip("`").strip('"'))
    named = {name: getattr(gym.spaces, name) for name in ("Box", "Discrete", "MultiDiscrete")} | {"n": 5}
    assert env.action_space == eval(row["space"].strip("`"), named | {"float32": np.float32})
    if row["index"] != "-" and isinstance(env.action_space, gym.spaces.Box):
        assert row["range"] == "-1..1" and (env.action_space.low == -1.0).all() and (env.action_space.high == 1.0).all()
        return
    highest = env.action_space.nvec.max() - 1 if row["index"] != "-" else env.action_space.n - 1
    assert eval(row["range"].split("..")[1], {"n": 5}) == highest


def test_the_observation_is_that_of_the_table():
    rows, at = table("Observation"), Layout.of(Scene())
    documented = [slice(int(first), int(last) + 1) for first, last in (row["index"].split("..") for row in rows)]
    assert documented == [at.positions, at.velocities, at.hub_velocity, at.current_waypoint, at.next_waypoint]
    lengths = {"0.1 m": Scene().robot.limb_length, "0.025 m/s": VELOCITY_SCALE}
    assert [lengths[row["unit"]] for row in rows] == [0.1, 0.025, 0.025, 0.1, 0.1]
    space = SeastarSwimEnv().observation_space
    assert f"`{space}`" in section("Observation") and space.shape == (documented[-1].stop,)
    assert {row["range"] for row in rows} == {f"({space.low.min()}, {space.high.max()})"}


@pytest.mark.parametrize("actuator, n", [(SmaWires(), 2), (ThermalSma(), 4), (Limited(SmaPulse(), 0.3), 1)])
def test_the_memory_of_actuators_is_that_of_the_table(actuator, n):
    (row,) = [line for line in section("Observation").splitlines() if f"`{type(actuator).__name__}`" in line]
    assert ("+, -" in row) == (n > 1)
    at = Layout.of(Scene(actuator=actuator))
    assert at.actuators == slice(182, 182 + 5 * n) and (n != 2 or f"has {at.size} numbers" in section("Observation"))
    assert f"{Layout.of(Scene(actuator=SmaWires()), entries=HEADINGS).size} with headings" in section(
        "Observation"
    )


def test_the_reward_has_the_terms_and_weights_of_the_table():
    weights = RewardWeights()
    documented = {row["term"].strip("`"): float(row["default weight"].split()[0]) for row in table("Reward")}
    expected = {name: getattr(weights, name) for name in ("progress", "waypoint", "effort", "heading")}
    assert documented == {f"reward_{name}": weight for name, weight in expected.items()}
    assert f"within {weights.aim} of its radius" in section("Reward")


def test_info_has_the_names_and_types_of_the_table():
    env = SeastarSwimEnv(fidelity="fast", error_bars=True, headings=Headings())
    for info in (env.reset(seed=0)[1], env.step([0, 1, 0, 0, 2])[4]):
        documented = {row["name"].strip("`"): row["type"] for row in table("Info")}
        assert set(info) == set(documented)
        for name, kind in documented.items():
            if kind == "array (2,)":
                assert isinstance(info[name], np.ndarray) and info[name].shape == (2,)
            else:
                assert type(info[name]) is TYPES[kind], name


def test_the_arguments_are_those_of_the_constructors():
    of_one = list(inspect.signature(SeastarSwimEnv).parameters)
    assert arguments(section("Arguments")) == of_one
    of_batch = arguments(section("Arguments", inspect.getdoc(SeastarSwimVectorEnv)))
    missing = {"frames_per_stroke"}  # a batch draws the ends of strokes
    assert {*of_one, *of_batch} - missing == set(inspect.signature(SeastarSwimVectorEnv).parameters)


def test_every_named_path_is_documented():
    assert all(f'"{name}"' in section("Arguments") for name in PATHS)


def test_defaults_and_constants_are_declared_as_recorded():
    assert_declared_as_recorded("seastar_gym.envs")


def test_ids_are_declared_as_recorded():
    limits = {id: spec.max_episode_steps for id, spec in gym.registry.items() if id.startswith("SeastarSwim")}
    assert limits == {
        "SeastarSwim-v0": 400, "SeastarSwimContinuous-v0": 400, "SeastarSwimTimed-v0": 400,
        "SeastarSwimTimedModerate-v0": 1000, "SeastarSwimTimedHard-v0": 2000, "SeastarSwimHeading-v0": 600,
    }  # fmt: skip
    assert gym.spec("SeastarSwimContinuous-v0").kwargs == {"actions": "continuous"}
    heading = gym.spec("SeastarSwimHeading-v0").kwargs
    assert heading["decision_period"] == 0.5 and heading["actions"] == "pairs"
    assert from_dict(heading["headings"], Headings) == Headings()
    for id, (task, actions, period, limit, threshold) in TASKS.items():
        spec = gym.spec(id)
        assert spec.max_episode_steps == round(limit / period) and spec.reward_threshold == threshold
        assert spec.kwargs == {"task": task, "actions": actions, "decision_period": period}


def test_a_signature_names_the_shared_options_after_those_before_them():
    class Made:
        @with_options
        def __init__(self, first, *given, last=3, **options):
            pass

    names = list(inspect.signature(SwimOptions).parameters)
    found = inspect.signature(Made).parameters
    assert list(found) == ["first", *names, "last"]
    assert found["last"].kind is inspect.Parameter.KEYWORD_ONLY and found["path"].default == "pentagon"
    assert found["first"].kind is inspect.Parameter.POSITIONAL_OR_KEYWORD


def test_a_scene_of_a_file_has_its_own_numerics_or_those_of_the_fidelity(tmp_path):
    assert scene_at(None, "fast") is None
    (tmp_path / "plain.json").write_text(json.dumps(Scene().to_dict()))
    assert scene_at(tmp_path / "plain.json", "fast") == Scene.preset("fast")
    own = Scene(numerics=Numerics("sdirk2", 5e-3))
    (tmp_path / "own.json").write_text(json.dumps(own.to_dict()))
    assert scene_at(tmp_path / "own.json", "fast").numerics == own.numerics
