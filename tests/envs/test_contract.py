"""The docstrings of the environments, which users read as the contract, say what the code does."""

import inspect
import itertools
import json
import pickle
import re

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

import seastar_gym
from episodes import assert_same, assert_same_steps, swum
from refusals import assert_refused
from seastar_gym import (
    TASKS,
    Contact,
    DomainRandomization,
    FailBlind,
    HeadingTargets,
    Limited,
    Miswired,
    Normal,
    Numerics,
    ObstTrap,
    Prey,
    Prizes,
    RewardWeights,
    Scene,
    Seastar,
    Sight,
    SimToReal,
    SmaPulse,
    SmaWires,
    Station,
    SymmetryReduction,
    ThermalSma,
    Uniform,
)
from seastar_gym.accuracy.chapter import STROKES
from seastar_gym.accuracy.info import NAMES
from seastar_gym.envs.layout import HEADINGS, VELOCITY_SCALE, Layout
from seastar_gym.envs.options import SwimOptions, scene_at, with_options
from seastar_gym.envs.paths import PATHS
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.tasks.envs import CHALLENGES, SeastarTaskEnv, SeastarTaskVectorEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.serial import from_dict, to_dict

TYPES = {"float": float, "int": int, "bool": bool, "str": str}
CHALLENGED = (Miswired, Prey, Station, FailBlind, ObstTrap, Prizes, SimToReal)
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


def row_of(id: str, kind: type) -> list[str]:
    """Cells of the row of an id, behind it."""
    cells = re.search(rf"\| `{id}` +\|(.*)\|$", kind.__doc__, re.MULTILINE)[1].split("|")
    return [cell.strip().strip("`") for cell in cells]


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


@pytest.mark.parametrize("actuator, n", [(SmaWires(), 2), (ThermalSma(), 4), (Limited(SmaPulse(), 0.3), 1)])
def test_the_memory_of_actuators_is_that_of_the_table(actuator, n):
    (row,) = [line for line in section("Observation").splitlines() if f"`{type(actuator).__name__}`" in line]
    assert ("+, -" in row) == (n > 1)
    at = Layout.of(Scene(actuator=actuator))
    assert at.actuators == slice(182, 182 + 5 * n) and (n != 2 or f"has {at.size} numbers" in section("Observation"))
    assert f"{Layout.of(Scene(actuator=SmaWires()), entries=HEADINGS).size} with headings" in section("Observation")


def test_the_reward_has_the_terms_and_weights_of_the_table():
    weights = RewardWeights()
    documented = {row["term"]: float(row["default weight"].split()[0]) for row in table("Reward")}
    expected = {name: getattr(weights, name) for name in ("progress", "waypoint", "effort", "heading")}
    assert documented == {f"reward_{name}": weight for name, weight in expected.items()}
    assert f"within {weights.aim} of its radius" in section("Reward")


def test_info_has_the_names_and_types_of_the_table():
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


@pytest.mark.parametrize("one, batch", [(SeastarSwimEnv, SeastarSwimVectorEnv), (SeastarTaskEnv, SeastarTaskVectorEnv)])
def test_the_arguments_are_those_of_the_constructors(one, batch):
    assert arguments(one) == list(inspect.signature(one).parameters)
    missing = {"frames_per_stroke"}  # a batch draws the ends of strokes
    assert {*arguments(one), *arguments(batch)} - missing == set(inspect.signature(batch).parameters)


def test_every_named_path_is_documented():
    assert all(f'"{name}"' in section("Arguments") for name in PATHS)


OF_WAYPOINTS = "SeastarSwim-v0", "SeastarSwimContinuous-v0", "SeastarSwimHeading-v0", *seastar_gym.TIMED


@pytest.mark.parametrize("id", OF_WAYPOINTS)
def test_ids_are_those_of_the_table(id):
    period, actions, limit, decisions, actuator = row_of(id, SeastarSwimEnv)
    env, inner = gym.make(id), gym.make(id).unwrapped
    assert inner.decision_period == float(period) and f'"{inner.actions}"' == actions
    assert env.spec.max_episode_steps == int(decisions) == round(float(limit) / float(period))
    assert type(inner.scene.actuator).__name__ == actuator
    assert gym.make_vec(id, 2).decision_period == float(period)
    env.reset(seed=0)
    assert env.step(env.action_space.sample())[4]["time"] == float(period)


def test_the_timed_environments_decide_as_often_as_they_say():
    timed = {"SeastarSwimTimed-v0": 0.5, "SeastarSwimTimedModerate-v0": 0.2, "SeastarSwimTimedHard-v0": 0.1}
    assert timed == seastar_gym.TIMED


# Tasks


@pytest.mark.parametrize("id", TASK_IDS)
def test_a_task_has_the_numbers_of_the_table(id):
    task, period, actions, limit, threshold = row_of(id, SeastarTaskEnv)
    env = gym.make(id, fidelity="fast")
    inner = env.unwrapped
    assert CHALLENGES[task.strip('"')] == inner.challenge and f'"{inner.actions}"' == actions
    assert inner.decision_period == float(period) and env.spec.reward_threshold == float(threshold)
    assert env.spec.max_episode_steps == round(float(limit) / float(period))


@pytest.mark.parametrize("id", TASK_IDS)
def test_info_of_a_task_is_that_of_the_docstrings(id):
    env = gym.make(id, fidelity="fast")
    kind, found = type(env.unwrapped.challenge), env.reset(seed=0)[1]
    own = {row["name"]: row["type"] for row in table("Info", kind)}
    common = {row["name"] for row in table("Info")} - {
        "error_estimate",
        "energy_growth",
        "largest_overlap",
        "heading",
        "heading_error",
        "reward_heading",
    } | ({"energy_growth"} & {*found})
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


@pytest.mark.parametrize("kind", CHALLENGED)
def test_rewards_of_a_task_are_those_of_the_table(kind):
    env = SeastarTaskEnv(task=kind(), fidelity="fast")
    named = {row["term"] for row in table("Reward", kind) if row["term"]}
    assert named == {name for name in env.reset(seed=0)[1] if name.startswith("reward_")}


def places_of(at):
    """What is seen of the limbs' shape, of their numbers, of what the task shows, and the targets."""
    return at.stations_and_hub, at.actuators, at.further, at.waypoints


@pytest.mark.parametrize("kind", [kind for kind in CHALLENGED if kind not in (Prey, SimToReal)])
@pytest.mark.parametrize("column, period", [(0, 1.0), (1, 0.5)])
def test_the_observation_of_a_task_is_that_of_the_table(kind, column, period):
    env = SeastarTaskEnv(task=kind(), fidelity="fast", decision_period=period)
    task = env._task
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


@pytest.mark.parametrize("kind", CHALLENGED)
def test_arguments_of_a_challenge_are_those_of_the_docstring(kind):
    assert arguments(kind) == list(inspect.signature(kind).parameters)


def test_ids_are_declared_as_recorded():
    limits = {id: spec.max_episode_steps for id, spec in gym.registry.items() if id.startswith("SeastarSwim")}
    assert limits == {
        "SeastarSwim-v0": 400, "SeastarSwimContinuous-v0": 400, "SeastarSwimTimed-v0": 400,
        "SeastarSwimTimedModerate-v0": 1000, "SeastarSwimTimedHard-v0": 2000, "SeastarSwimHeading-v0": 600,
        "SeastarSwimSimToReal-v0": 1500,
    }  # fmt: skip
    assert gym.spec("SeastarSwimContinuous-v0").kwargs == {"actions": "continuous"}
    heading = gym.spec("SeastarSwimHeading-v0").kwargs
    assert heading["decision_period"] == 0.5 and heading["actions"] == "pairs"
    assert from_dict(heading["headings"], HeadingTargets) == HeadingTargets()
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


# The spec of an environment is written as JSON, and what is made from it is the same environment.


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
    "device": {"device": "scalar", "fidelity": "fast"},
    "decisions": {"decision_period": 0.2, "observe_actuators": False, "fidelity": "fast"},
    "continuous": {"actions": "continuous", "decision_period": np.float64(0.3), "fidelity": "fast"},
    "headings": {"headings": HeadingTargets((0.1, 1 / 3, 0.0, 1.0, 2.0)), "fidelity": "fast"},
    "one heading": {"headings": HeadingTargets(0.1, 1 / 3), "fidelity": "fast"},
    "sight": {
        "sight": Sight(1e2 / 3, Uniform(0.1, 1 / 3), dropout=0.1, sees=np.int64(3)),
        "decision_period": 0.5,
        "fidelity": "fast",
        "action_delay": Uniform(0.0, 1 / 3),
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
    for other in (gym.make(by_json(env.spec)), pickle.loads(pickle.dumps(env))):
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
