"""The docstrings of the environments, which users read as the contract, say what the code does."""

import inspect
import itertools
import json
import re
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

import seastar_gym
from refusals import assert_refused
from seastar_gym import (
    Contact,
    FailBlind,
    HeadingTargets,
    Limited,
    Miswired,
    Numerics,
    ObstTrap,
    Prey,
    Prizes,
    RewardWeights,
    Scene,
    Seastar,
    SimToReal,
    SmaPulse,
    SmaWires,
    Station,
    ThermalSma,
)
from seastar_gym.accuracy.chapters import NAMES
from seastar_gym.envs.layout import HEADINGS, VELOCITY_SCALE, Layout
from seastar_gym.envs.options import scene_at
from seastar_gym.envs.paths import PATHS
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.tasks import name_of
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.scene.scene import load_scene

TYPES = {"float": float, "int": int, "bool": bool, "str": str}
OF_TASKS = (Miswired, Prey, Station, FailBlind, ObstTrap, Prizes, SimToReal)
TASK_IDS = tuple(seastar_gym.TASKS)


def section(title: str, kind: type = SeastarSwimEnv) -> str:
    """Text of the section of a docstring whose title begins so."""
    rest = re.split(rf"^## {title}.*$", inspect.getdoc(kind), flags=re.MULTILINE)[1]
    return re.split(r"^## ", rest, flags=re.MULTILINE)[0]


def table(title: str, kind: type = SeastarSwimEnv) -> list[dict[str, str]]:
    """Rows of the section's first table, by the titles of the columns."""
    lines = itertools.dropwhile(lambda line: not line.startswith("|"), section(title, kind).splitlines())
    rows = [line.strip("|").split("|") for line in itertools.takewhile(lambda line: line.startswith("|"), lines)]
    head, _, *rows = [[cell.strip().strip("`") for cell in row] for row in rows]
    return [dict(zip(head, row, strict=True)) for row in rows]


def arguments(kind: type) -> list[str]:
    """Names of the section of arguments, of which a line may have several."""
    lines = re.findall(r"^(\w+(?:, \w+)*): ", section("Arguments", kind), flags=re.MULTILINE)
    return [name for line in lines for name in line.split(", ")]


@pytest.mark.parametrize("row", table("Action"), ids=lambda row: row["actions"])
def test_the_actions_are_those_of_the_table(row):
    env = SeastarSwimEnv(actions=row["actions"].strip('"'))
    named = {name: getattr(gym.spaces, name) for name in ("Box", "Discrete", "MultiDiscrete")} | {"n": 5}
    assert env.action_space == eval(row["space"], named | {"float32": np.float32})
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
    for actuator, n in ((SmaWires(), 2), (ThermalSma(), 4), (Limited(SmaPulse(), 0.3), 1)):
        (row,) = [line for line in section("Observation").splitlines() if f"`{type(actuator).__name__}`" in line]
        at = Layout.of(Scene(actuator=actuator))
        assert ("+, -" in row) == (n > 1) and at.actuators == slice(182, 182 + 5 * n)
        assert n != 2 or f"has {at.size} numbers" in section("Observation")
    assert f"{Layout.of(Scene(actuator=SmaWires()), entries=HEADINGS).size} with headings" in section("Observation")


def test_the_reward_and_info_are_those_of_the_tables():
    weights = RewardWeights()
    documented = {row["term"]: float(row["default weight"].split()[0]) for row in table("Reward")}
    expected = {name: getattr(weights, name) for name in ("progress", "waypoint", "effort", "time", "heading")}
    assert documented == {f"reward_{name}": weight for name, weight in expected.items()}
    assert f"within {weights.aim} of its radius" in section("Reward")
    numerics = Numerics("implicit-midpoint", 5e-3, 1e-5)
    env = SeastarSwimEnv(scene=Scene(numerics=numerics, contact=Contact()), error_bars=True, headings=HeadingTargets())
    for info in (env.reset(seed=0)[1], env.step([0, 1, 0, 0, 2])[4]):
        documented = {row["name"]: row["type"] for row in table("Info")}
        assert set(info) == set(documented)
        for name, kind in documented.items():
            if kind == "array (2,)":
                assert isinstance(info[name], np.ndarray) and info[name].shape == (2,)
            else:
                assert type(info[name]) is TYPES[kind], name


def test_the_arguments_are_those_of_the_constructors():
    one, batch = SeastarSwimEnv, SeastarSwimVectorEnv
    assert arguments(one) == list(inspect.signature(one).parameters)
    both = {*inspect.signature(one).parameters, *inspect.signature(batch).parameters}
    assert {*arguments(one), *arguments(batch)} == both - {"arguments"}
    for wrong, nearest in {"paths": "path", "num_env": "num_envs"}.items():
        sentence = f"SeastarSwimVectorEnv has no argument '{wrong}': the nearest is '{nearest}'."
        with pytest.raises(TypeError, match=f"^{re.escape(sentence)}$"):
            batch(**{wrong: 2})
    with pytest.raises(TypeError, match=r"^SeastarSwimVectorEnv has no argument 'n_robots'"):
        batch(n_robots=2)
    assert all(f'"{name}"' in section("Arguments") for name in PATHS)


@pytest.mark.parametrize("id", seastar_gym.IDS)
def test_ids_are_those_of_the_table(id):
    cells = re.search(rf"\| `{id}` +\|(.*)\|$", SeastarSwimEnv.__doc__, re.MULTILINE)[1].split("|")
    task, period, actions, limit, decisions, threshold = [cell.strip(" `") for cell in cells]
    env, inner = gym.make(id, fidelity="fast"), gym.make(id, fidelity="fast").unwrapped
    assert inner.decision_period == float(period) and f'"{inner.actions}"' == actions
    assert env.spec.max_episode_steps == int(decisions) == round(float(limit) / float(period))
    assert env.spec.reward_threshold == (None if threshold == "-" else float(threshold))
    assert task == f'"{name_of(inner.task)}"' if id in TASK_IDS else task == "-" and isinstance(inner.task, AlongPath)
    assert type(inner.scene.actuator) is (SmaPulse if float(period) == 1.0 else SmaWires)
    assert gym.make_vec(id, 2).decision_period == float(period)
    env.reset(seed=0)
    assert env.step(env.action_space.sample())[4]["time"] == float(period)


# Tasks


@pytest.mark.parametrize("id", TASK_IDS)
def test_info_of_a_task_is_that_of_the_docstrings(id):
    env = gym.make(id, fidelity="fast")
    kind, found = type(env.unwrapped.task), env.reset(seed=0)[1]
    own = {row["name"]: row["type"] for row in table("Info", kind)}
    others = {"error_estimate", "energy_growth", "largest_overlap", "heading", "heading_error", "reward_heading"}
    common = {row["name"] for row in table("Info")} - others | ({"energy_growth"} & {*found})
    measured = {*NAMES}
    if env.unwrapped.decision_period < 1.0:
        common -= {"batch_real_time_factor"}  # speeds were measured of strokes
    assert {*own} <= {*found} and {*found} <= common | {*own}
    without = re.search(r"without (.*?);", " ".join(inspect.getdoc(kind).split()))
    missing = set(re.findall(r"`(\w+)`", without[1])) if without else set()
    if without and "measured errors" in without[1]:
        missing |= measured & common
    assert common - {*found} == missing
    for name, type_ in own.items():
        assert type_.startswith({np.ndarray: "array", int: "int", float: "float"}[type(found[name])]), name


@pytest.mark.parametrize("kind", OF_TASKS)
def test_arguments_and_rewards_of_a_task_are_those_of_the_docstring(kind):
    assert arguments(kind) == list(inspect.signature(kind).parameters)
    env = SeastarSwimEnv(actions="pairs", task=kind(), fidelity="fast")
    named = {row["term"] for row in table("Reward", kind) if row["term"]}
    assert named == {name for name in env.reset(seed=0)[1] if name.startswith("reward_")}


def places_of(at):
    """What is seen of the limbs' shape, of their numbers, of what the task shows, and the targets."""
    return at.stations_and_hub, at.actuators, at.further, at.waypoints


@pytest.mark.parametrize("kind", [kind for kind in OF_TASKS if kind not in (Prey, SimToReal)])
@pytest.mark.parametrize("column, period", [(0, 1.0), (1, 0.5)])
def test_the_observation_of_a_task_is_that_of_the_table(kind, column, period):
    env = SeastarSwimEnv(actions="pairs", task=kind(), fidelity="fast", decision_period=period)
    task = env.task
    sees_wires = period < 1.0 and env.observe_actuators
    at = Layout(5, task.observes_commands + 2 * sees_wires, task.entries, task.shows_limbs)
    cells = [[*row.values()] for row in table("Observation", kind)]
    places = [row[min(column, len(row) - 4)] for row in cells]
    documented = [tuple(map(int, place.split(".."))) for place in places if place]
    assert documented == [(place.start, place.stop - 1) for place in places_of(at) if place.start < place.stop]
    assert env.observation_space.shape == (at.size,)


def test_what_a_camera_sees_of_a_task_is_that_of_the_table():
    """A vector, a rate and an age stand in lines of their own there."""
    env = gym.make("SeastarSwimSimToReal-v0", fidelity="fast")
    rows = [row["index"].split("..") for row in table("Observation", SimToReal) if row["index"]]
    (wires, velocity, turn, age, ways), at = [[*map(int, row)] for row in rows], env.unwrapped.layout
    assert wires == [at.actuators.start, at.actuators.stop - 1] and [*velocity, *turn, *age] == [10, 11, 12, 13]
    assert at.further == slice(10, 14) and ways == [at.waypoints.start, at.waypoints.stop - 1]
    assert env.observation_space.shape == (at.size,)


def test_a_scene_of_a_file_has_the_fidelity_that_is_typed_otherwise_its_own_numerics(tmp_path):
    assert scene_at(None, "fast", "balanced") is None
    (tmp_path / "plain.json").write_text(json.dumps(Scene().to_dict()))
    assert scene_at(load_scene(tmp_path / "plain.json"), None, "fast") == Scene.preset("fast")
    own = Scene(Seastar(nodes_per_limb=9), numerics=Numerics("sdirk2", 5e-3))
    (tmp_path / "own.json").write_text(json.dumps(own.to_dict()))
    assert scene_at(load_scene(tmp_path / "own.json"), None, "fast") == own.at()
    assert scene_at(own, "reference", "fast") == Scene.preset("reference")
    held = replace(own, held_nodes=(8,))
    assert scene_at(held, "reference", "fast") == replace(held.at(), numerics=Numerics.preset("reference"))


# The spec of an environment is written as JSON, and what is made from it is the same environment.


ID = "SeastarSwim-v0"
SCENE = Scene(Seastar(nodes_per_limb=4), actuator=SmaPulse(0.5), numerics=Numerics.preset("fast"))


def test_specs_can_be_changed_and_that_of_gymnasiums_own_batch_is_read_where_it_is_plain():
    env = gym.make(ID, scene=SCENE)
    other = gym.make(env.spec, actions="pairs")
    assert other.unwrapped.actions == "pairs" and other.unwrapped.scene == SCENE
    assert SeastarSwimEnv().spec is None
    batch = gym.make_vec(ID, 2, vectorization_mode="sync", scene=SCENE.to_dict())
    again = gym.make_vec(EnvSpec.from_json(batch.spec.to_json()))
    np.testing.assert_array_equal(batch.reset(seed=3)[0], again.reset(seed=3)[0])


class Own(SmaPulse):
    """An actuator that has no plain form."""


def test_a_spec_that_could_not_be_read_back_refuses_to_be_written_and_still_makes_environments():
    env = gym.make(ID, scene=Scene(actuator=Own(), numerics=Numerics.preset("fast")))
    with assert_refused("Scene.actuator is a Own", "seastar_gym.register_part"):
        env.spec.to_json()
    assert gym.make(env.spec).unwrapped.scene == env.unwrapped.scene
