"""A policy in its two files swims as its learner did; what does not fit is refused with a sentence."""

import hashlib
import json
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import safetensors.numpy
import torch

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model, make_training_env, policy_of
from every_part import ACTUATORS, PARTS
from seastar_gym import (
    Miswired,
    Numerics,
    Prey,
    Scene,
    Seastar,
    SmaPulse,
    SmaWires,
    Water,
)
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import BUNDLED, LearnedPolicy, load, save
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.swim import swim
from symmetries import assert_equivariant, symmetry_for

ROOT = Path(__file__).resolve().parents[2]
FAST = Numerics.preset("fast")
SMALL = Hyperparameters(num_envs=8, rollout=8, batch_size=32, epochs=2, hidden=(16, 8), max_episode_time=10.0)
FOUR_LIMBS = Scene(robot=Seastar(n_limbs=4, nodes_per_limb=4), numerics=FAST)


def random_policy(description, seed=0):
    rng = np.random.default_rng(seed)
    shapes = description.shapes().items()
    return LearnedPolicy(description, {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes})


@pytest.fixture
def policy():
    return random_policy(Description("joint", True, Scene(numerics=FAST), (16, 8)))


@pytest.fixture
def file(policy, tmp_path):
    save(policy, tmp_path / "policy.safetensors", seed=7)
    return tmp_path / "policy.safetensors"


def observations(scene=Scene(), n=2000, seed=0):
    size = Layout.of(scene).size
    return np.random.default_rng(seed).normal(size=(n, size)).astype(np.float32)


# The network


@pytest.mark.parametrize("actions", ["joint", "pairs", "limbs"])
@pytest.mark.parametrize("reduced", [True, False])
@pytest.mark.parametrize("scene", [Scene(numerics=FAST), FOUR_LIMBS])
def test_a_saved_policy_acts_as_stable_baselines_does(actions, reduced, scene, tmp_path):
    hyperparameters = replace(SMALL, actions=actions, symmetry=reduced)
    learner = make_model(make_training_env(hyperparameters, "random", True, scene=scene), hyperparameters, seed=0)
    learner.learn(64)
    save(policy_of(learner), tmp_path / "policy.safetensors")
    policy, n_limbs = load(tmp_path / "policy.safetensors"), scene.robot.n_limbs
    seen = observations(scene)
    shown, elements = symmetry_for(n_limbs).reduce(seen) if reduced else (seen, np.zeros(len(seen), int))
    chosen = learner.predict(shown, deterministic=True)[0]
    actual, state = policy.predict(seen, deterministic=True)
    best, second = np.moveaxis(np.sort(policy.logits(shown), axis=-1)[..., :-3:-1], -1, 0)
    clear = (best - second > 1e-6).all(axis=-1)  # elsewhere rounding decides
    assert clear.mean() > 0.95
    np.testing.assert_array_equal(actual[clear], symmetry_for(n_limbs, mode=actions).restore(chosen, elements)[clear])
    assert state is None


def test_its_logits_are_those_of_torch(policy):
    linear = [torch.nn.Linear(186, 16), torch.nn.Linear(16, 8), torch.nn.Linear(8, 243)]
    network = torch.nn.Sequential(linear[0], torch.nn.Tanh(), linear[1], torch.nn.Tanh(), linear[2])
    for number, layer in enumerate(linear):
        layer.weight.data[:] = torch.from_numpy(policy.weights[f"{number}.weight"])
        layer.bias.data[:] = torch.from_numpy(policy.weights[f"{number}.bias"])
    seen = observations(n=10)
    expected = network(torch.from_numpy(seen)).detach().numpy()
    np.testing.assert_allclose(policy.logits(seen)[:, 0], expected, rtol=1e-4, atol=1e-4)


def test_random_actions_follow_the_logits():
    """Over many draws, as often as their probability says."""
    description = Description("pairs", False, FOUR_LIMBS, (4,))
    policy = random_policy(description)
    seen = np.repeat(observations(FOUR_LIMBS, n=1), 20_000, axis=0) * np.float32(0.3)
    logits = policy.logits(seen[0])[0]
    probabilities = np.exp(logits - logits.max()) / np.exp(logits - logits.max()).sum()
    drawn, _ = policy.predict(seen)
    frequencies = np.bincount(drawn, minlength=len(command_table("pairs", 4))) / len(drawn)
    np.testing.assert_allclose(frequencies, probabilities, atol=0.02)


def test_any_network_behind_the_symmetry_is_equivariant(policy):
    assert_equivariant(policy, observations(n=200))


# On disk


def test_weights_and_description_survive_the_disk_to_the_last_bit(policy, file):
    again = load(file)
    assert again.description == policy.description
    assert again.training == {"seed": 7}
    for name, array in policy.weights.items():
        np.testing.assert_array_equal(again.weights[name], array)


@pytest.mark.parametrize(
    "scene", [{"actuator": one} for one in ACTUATORS.values()] + [*PARTS.values()], ids=[*ACTUATORS, *PARTS]
)
def test_a_policy_of_any_scene_can_be_loaded_again(scene, tmp_path):
    policy = random_policy(Description("pairs", False, Scene(**scene), (3,)))
    assert Description.from_json(policy.description.to_json().encode()) == policy.description
    save(policy, tmp_path / "policy.safetensors")
    assert load(tmp_path / "policy.safetensors").description == policy.description


def test_a_policy_that_could_not_be_loaded_again_is_refused_when_it_is_saved(tmp_path):
    class Own(SmaPulse):
        """Not the package's."""

    policy = random_policy(Description("pairs", False, Scene(actuator=Own()), (3,)))
    with pytest.raises(ValueError, match=r"Scene\.actuator is a Own, .*register_part"):
        save(policy, tmp_path / "policy.safetensors")
    assert not [*tmp_path.iterdir()]


def test_the_weights_can_be_read_by_anyone(policy, file):
    """The file is plain safetensors; there is nothing to unpickle in it."""
    weights = safetensors.numpy.load_file(file)
    assert {name: array.shape for name, array in weights.items()} == policy.description.shapes()
    facts = json.loads(file.with_suffix(".json").read_text())
    assert (facts["observation_size"], facts["actions"], facts["hidden"]) == (186, "joint", [16, 8])


def assert_refused(file, sentence):
    with pytest.raises((ValueError, FileNotFoundError), match=sentence) as error:
        load(file)
    text = str(error.value)
    assert str(file) in text and "\n" not in text and text.endswith("."), text


@pytest.mark.parametrize("missing", [".safetensors", ".json"])
def test_a_missing_file_is_named(file, missing):
    file.with_suffix(missing).unlink()
    assert_refused(file, rf"There is no trained policy at .*policy\{missing} is missing")


def test_another_kind_of_file_is_refused(tmp_path):
    assert_refused(tmp_path / "model.pkl", "A policy is in a file named .safetensors")


@pytest.mark.parametrize("keep", [0, 7, 0.5, 0.999])
def test_cut_weights_are_said_to_be_damaged(file, keep):
    data = file.read_bytes()
    file.write_bytes(data[: keep if isinstance(keep, int) else int(keep * len(data))])
    assert_refused(file, "is damaged, or no policy of this version: the weights are not those")


def test_a_flipped_bit_is_found(file):
    data = bytearray(file.read_bytes())
    data[-100] ^= 1
    file.write_bytes(bytes(data))
    assert_refused(file, "is damaged.*the weights are not those that its .json file describes")


NO_LIMBS = Scene().to_dict() | {"robot": Scene().to_dict()["robot"] | {"n_limbs": 0}}


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"observation_layout": 1}, "its observation_layout is 1, this version of seastar_gym knows 2"),
        ({"format": 99}, "its format is 99"),
        ({"actions": "waves"}, "actions must be one of"),
        ({"hidden": [16, 9]}, r"its weights have the shapes .*\(16, 186\)"),
        ({"hidden": "wide"}, "is damaged"),
        ({"scene": NO_LIMBS}, "n_limbs must be a whole number from 1"),
        ({"scene": {"robot": {"n_arms": 5}}}, "a dict with a version"),
        ({"symmetry": "False"}, "symmetry must be true or false, not 'False'"),
        ({"symmetry": None}, "symmetry must be true or false, not None"),
        ({"actions": None}, "actions must be one of"),
        ({"actions": ["joint"]}, r"actions must be one of .*, not \['joint'\]"),
        ({"format": True}, "its format is True"),
        ({"format": 2.5}, "its format is 2.5"),
        ({"observation_layout": [1]}, r"its observation_layout is \[1\]"),
        ({"hidden": None}, "hidden must be a list of widths, not None"),
        ({"hidden": [16, "8"]}, "a width of its hidden layers must be a whole number"),
        ({"hidden": [0]}, "a width of its hidden layers must be a whole number"),
        ({"hidden": [10**300]}, "a width of its hidden layers must be a whole number"),
        ({"hidden": []}, "its weights have the shapes"),
        ({"scene": None}, "a dict with a version.*, not None"),
        ({"training": None}, "its training is a NoneType"),
        ({"training": {"progress": [[1, 2]]}}, "the progress of its training must be rows of three numbers"),
        ({"training": {"progress": [[1, 2, 10**400]]}}, "the progress of its training must be rows of three numbers"),
        ({"training": {"progress": {"a": 1}}}, "the progress of its training must be rows of three numbers"),
        ({"training": {"commands": [3]}}, "the commands of its training must be texts"),
        ({"sha256": 3}, "the weights are not those"),
        ({"task": "chess"}, "its task must be one of"),
        ({"task": [1]}, "its task must be one of"),
        *(({"past": past}, "its past must be a whole number") for past in (-1, 10**9, True, False)),
        ({"past": 8, "symmetry": False}, "a policy without symmetry has no past"),
        ({"limb_mirror": 3}, "its limb_mirror must be a list of pairs"),
        ({"limb_mirror": [[0, 2]]}, "not an index and a sign"),
        ({"limb_mirror": [[5, 1]]}, "an index of its limb_mirror must be a whole number"),
        ({"limb_mirror": [[1, 1], [1, 1]]}, "its limb_mirror is no mirror, which undoes itself"),
        ({"limb_mirror": [[1, 1], [0, -1]]}, "its limb_mirror is no mirror, which undoes itself"),
        *(
            ({"entries": entries}, "entries must be a tuple of")
            for entries in (None, 3, "scalar", ["spin"], [["scalar"]])
        ),
        *(({"stations": stations}, "stations must be a whole number") for stations in (None, 0, 10)),
        *(({"shows_limbs": shows}, "shows_limbs must be True or False") for shows in (None, 1)),
    ],
)
def test_what_does_not_fit_is_said_in_one_sentence(file, change, sentence):
    facts = json.loads(file.with_suffix(".json").read_text())
    file.with_suffix(".json").write_text(json.dumps(facts | change))
    assert_refused(file, sentence)


@pytest.mark.parametrize("weight", [np.nan, np.inf, -np.inf])
def test_weights_that_are_not_finite_are_refused(policy, file, weight):
    policy.weights["1.bias"][3] = weight
    save(policy, file)
    assert_refused(file, "its weights are not all finite numbers of single precision")


def test_weights_of_another_precision_are_refused(policy, file):
    weights = {name: array.astype(np.float64) for name, array in policy.weights.items()}
    rewrite(file, safetensors.numpy.save(weights))
    assert_refused(file, "its weights are not all finite numbers of single precision")


def rewrite(file, data: bytes) -> None:
    """Other weights, and a description that says that they are the ones."""
    file.write_bytes(data)
    facts = json.loads(file.with_suffix(".json").read_text())
    file.with_suffix(".json").write_text(json.dumps(facts | {"sha256": hashlib.sha256(data).hexdigest()}))


@pytest.mark.parametrize(
    "text, sentence",
    [
        *((text, "is damaged, or no policy of this version")
          for text in (b"", b"{", b"[]", b"3", b"{}", b'{"sha256": null}', b"\0")),
        (b"null", "its description is a NoneType"),
        (b"\xff\xfe{}", "'utf-8' codec can't decode"),
        ("{}".encode("utf-16"), "'utf-8' codec can't decode"),
        (b"[" * 100_000, "is damaged"),
        (b'{"a":' * 100_000, "nested too deeply"),
        (b'{"format": 1e999}', "1e999 is no finite number"),
        (b'{"format": NaN}', "NaN is no finite number"),
        (b'{"format": ' + b"9" * 5000 + b"}", "is damaged"),
        (b'{"format": 2, "format": 1}', "does not say 'sha256'"),
    ],
)  # fmt: skip
def test_json_that_no_description_can_be_is_refused(file, text, sentence):
    file.with_suffix(".json").write_bytes(text)
    assert_refused(file, sentence)


def test_a_pickle_or_a_zip_that_is_named_like_a_policy_is_refused_unread(policy, file, tmp_path):
    class Bomb:
        def __reduce__(self):
            return print, ("boom",)

    torch.save({"0.weight": Bomb()}, tmp_path / "policy.pth")
    with pytest.raises(ValueError, match=r"is in a file named \.safetensors, not in .*policy\.pth\.$"):
        load(tmp_path / "policy.pth")
    rewrite(file, (tmp_path / "policy.pth").read_bytes())  # a zip of pickles
    assert_refused(file, "is damaged")
    rewrite(file, pickle.dumps(Bomb()))
    assert_refused(file, "is damaged")


N_DAMAGED = 200


@pytest.mark.parametrize("suffix", [".json", ".safetensors", "the weights of the description"])
def test_damaged_files_of_the_policy_in_the_box_load_or_are_refused_in_a_sentence(suffix, tmp_path):
    """Bytes flipped, cut out, doubled or cut off, with a fixed seed."""
    rng, file = np.random.default_rng(0), tmp_path / "policy.safetensors"
    shipped = {one: BUNDLED.with_suffix(one).read_bytes() for one in (".json", ".safetensors")}
    refused = 0
    for _ in range(N_DAMAGED):
        for one, data in shipped.items():
            file.with_suffix(one).write_bytes(data)
        if suffix in shipped:
            file.with_suffix(suffix).write_bytes(damaged(shipped[suffix], rng))
        else:
            rewrite(file, damaged(shipped[".safetensors"], rng, n_first=1000))  # its header, too
        try:
            loaded = load(file)
        except ValueError as refusal:
            text = str(refusal)
            assert text.startswith(str(file)) and text.endswith(".") and "\n" not in text, text
            refused += 1
        else:
            assert loaded.predict(np.zeros(186, np.float32), deterministic=True)[0] in range(21)
    assert refused > N_DAMAGED // 4


def damaged(data: bytes, rng: np.random.Generator, n_first: int | None = None) -> bytes:
    """The bytes with a few changes, half of them among the first ones."""
    out = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        end = len(out) if n_first is None or rng.random() < 0.5 else n_first
        place = int(rng.integers(max(1, min(end, len(out)))))
        match rng.integers(5):
            case 0:
                out[place] ^= 1 << int(rng.integers(8))
            case 1:
                out[place] = int(rng.integers(256))
            case 2:
                del out[place : place + int(rng.integers(1, 20))]
            case 3:
                out[place:place] = out[place : place + int(rng.integers(1, 20))]
            case 4 if rng.random() < 0.3:
                del out[place:]
    return bytes(out) or b"\0"


# Of a task, with memory


WIRES = Scene(actuator=SmaWires(), numerics=FAST)
TASK = Description(
    "joint", True, WIRES, (8,), 0.5, "miswired", ((0, -1),), ("vector", "pseudoscalar"), shows_limbs=True, past=2
)


def test_a_policy_with_memory_sees_the_past_in_the_limbs_of_the_present():
    policy, rng = random_policy(TASK), np.random.default_rng(1)
    first, second, third = rng.normal(size=(3, 4, TASK.observation_size)).astype(np.float32)
    state, past = None, np.stack([first, first], axis=1)
    for present, later in ((first, [first, first]), (second, [second, first]), (third, [third, second])):
        action, state = policy.predict(present, state, deterministic=True)
        shown, elements = TASK.frame_stack.stacked(present, past)
        chosen = policy.logits(shown).argmax(axis=-1)[..., 0]
        np.testing.assert_array_equal(action, TASK.reduction.restore(chosen, elements))
        past = np.stack(later, axis=1)
        np.testing.assert_array_equal(state[0], past)
    begun, kept = policy.predict(first, state, np.array([True, False, False, True]), True)
    np.testing.assert_array_equal(kept[0][[0, 3]], np.stack([first, first], axis=1)[[0, 3]])
    np.testing.assert_array_equal(kept[0][1:3], np.stack([first, third], axis=1)[1:3])
    np.testing.assert_array_equal(begun[0], policy.predict(first[0], deterministic=True)[0])
    for wrong in (state[0], (state[0][:2],), (state[0].astype(int),), (state[0], state[0]), ([1.0],)):
        with pytest.raises(ValueError, match=r"past observations of shape \(4, 2, 194\)\.$"):
            policy.predict(first, wrong)


def test_a_description_of_a_task_survives_its_text_and_shapes_the_network():
    assert Description.from_json(TASK.to_json()) == TASK
    marked = TASK._replace(stations=3)
    assert Description.from_json(marked.to_json()) == marked and marked.observation_size == TASK.observation_size - 120
    size = 182 + 5 + 3 + 4
    assert TASK.observation_size == size and TASK.input_size == size + 2 * (10 + size - 180)
    assert TASK.shapes()["0.weight"] == (8, TASK.input_size) and TASK.distributions == (1, 243)
    bare = Description("limbs", False, Scene(), ())
    assert (bare.reduction, bare.frame_stack, bare.input_size) == (None, None, 186)
    assert bare.shapes() == {"0.weight": (15, 186), "0.bias": (15,)}


@pytest.mark.parametrize(
    "change, words",
    [
        ({"limb_mirror": ((0, 1, 1),)}, "its limb_mirror has"),
        ({"limb_mirror": ((0, 2),)}, "its limb_mirror has"),
        ({"limb_mirror": ((0, 1.0),)}, "its limb_mirror has"),
        ({"limb_mirror": ((1, 1),)}, "an index of its limb_mirror must be a whole number from 0 to 0"),
        ({"limb_mirror": ((1, 1), (1, 1))}, "is no mirror, which undoes itself"),
        ({"limb_mirror": ((1, 1), (0, -1))}, "is no mirror, which undoes itself"),
        ({"limb_mirror": [(0, 1)]}, "its limb_mirror"),
        ({"limb_mirror": ((0, 1),) * 1001}, "must be a list of pairs"),
        ({"limb_mirror": 3}, "must be a list of pairs, not 3"),
        ({"entries": ("colour",)}, "must be a tuple of scalar, pseudoscalar, vector"),
        ({"shows_limbs": 1}, "shows_limbs must be True or False"),
        ({"stations": 10}, "stations must be a whole number from 1 to 9"),
        ({"task": "chess"}, "its task must be one of miswired, prey"),
        ({"past": 1001}, "its past must be a whole number from 0 to 1000"),
        ({"symmetry": False}, "without symmetry has no past"),
        ({"decision_period": -0.5}, "decision_period"),
        ({"hidden": [8]}, "hidden must be a tuple of widths"),
    ],
)
def test_what_no_policy_of_a_task_can_be_is_refused(change, words):
    with pytest.raises(ValueError, match=r"\.$") as refusal:
        TASK._replace(**change).check()
    assert words.lower() in str(refusal.value).lower()
    TASK._replace(limb_mirror=((1, -1), (0, -1)), entries=("scalar",) * 1000, past=1000).check()


def test_a_policy_of_a_task_fits_that_task_with_any_numbers():
    policy, n_seen = random_policy(TASK), TASK.observation_size
    policy.require_fit(TASK.scene, "joint", n_seen, Miswired(0.1))
    for challenge, other in ((None, "waypoints"), (Prey(), "prey"), (Prey(wanted=1), "Prey")):
        with pytest.raises(ValueError, match=rf"trained for the task miswired, the environment's is {other}\.$"):
            policy.require_fit(TASK.scene, "joint", n_seen, challenge)
    with pytest.raises(ValueError, match=rf"sees {n_seen} numbers of miswired, the environment shows 3: another task"):
        policy.require_fit(TASK.scene, "joint", 3, Miswired())
    with pytest.raises(ValueError, match=r"sees 186 numbers of waypoints, the environment shows 3: another task"):
        random_policy(Description("joint", True, Scene(numerics=FAST), (8,))).require_fit(Scene(), "joint", 3)


# In an environment


@pytest.mark.parametrize(
    "robot, actions, sentence",
    [
        (Seastar(n_limbs=4), "joint", r"robot of 5 limbs, the environment's has 4\."),
        (Seastar(n_limbs=9, nodes_per_limb=6), "pairs", r"environment's has 9\."),
        (Seastar(), "limbs", r'answers with actions="joint", the environment takes actions="limbs"\.'),
    ],
)
def test_an_environment_that_does_not_fit_is_refused_before_the_first_stroke(policy, robot, actions, sentence):
    env = SeastarSwimEnv(actions=actions, scene=Scene(robot=robot, numerics=FAST))
    with pytest.raises(ValueError, match=sentence):
        swim("learned", policy, env, max_strokes=1)


def test_an_observation_of_another_robot_is_refused(policy):
    with pytest.raises(ValueError, match=r"robot of 5 limbs: it sees 186 numbers, not .* shape \(150,\)"):
        policy.predict(np.zeros(150, np.float32))


def test_another_scene_is_told_but_other_numerics_are_not(policy):
    assert policy.differences(Scene(numerics=Numerics.preset("reference"))) == ""
    other = Scene(robot=Seastar(youngs_modulus=2e6), fluid=Water(drag_coefficient=1.5))
    assert policy.differences(other) == (
        "trained in another scene, with fluid.drag_coefficient 1.0 (here 1.5), "
        "robot.youngs_modulus 1000000.0 (here 2000000.0)."
    )
    assert "fluid.density 1000.0 (here None)" in policy.differences(Scene(fluid=None))


# The bundled policy


def test_the_policy_in_the_box_says_how_it_was_made():
    shipped = load()
    facts = json.loads(BUNDLED.with_suffix(".json").read_text(encoding="utf-8"))
    assert Scene.from_dict(facts["scene"]) == shipped.scene
    trained_at = Scene.preset("balanced")  # before it was given numerical damping
    assert shipped.scene == replace(trained_at, numerics=replace(trained_at.numerics, damping=0.0))
    assert shipped.training["strokes"] > 0 and isinstance(shipped.training["seed"], int)
    assert shipped.training["commands"][0].startswith("python train.py")
    assert {"seastar_gym", "numpy", "torch", "stable_baselines3"} <= set(shipped.training["versions"])
    assert BUNDLED.stat().st_size < 1_000_000


def test_the_policy_in_the_box_beats_the_script_round_the_pentagon():
    shipped = load()
    env = gym.make("SeastarSwim-v0", actions=shipped.actions, scene=shipped.scene).unwrapped
    done = swim("learned", shipped, env, max_strokes=300)
    assert done.finished
    assert done.strokes < 200 < 241


@pytest.mark.parametrize("nodes_per_limb", [7, 19])
def test_the_policy_in_the_box_swims_with_any_nodes_per_limb(nodes_per_limb):
    shipped = load()
    scene = Scene(Seastar(nodes_per_limb=nodes_per_limb), numerics=FAST)
    done = swim("learned", shipped, SeastarSwimEnv(actions=shipped.actions, scene=scene), max_strokes=300)
    assert done.finished and done.strokes < 200


def test_it_needs_neither_torch_nor_stable_baselines():
    code = "import sys; from seastar_gym.controllers.learned import load; load(); print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert set(answer.stdout.split()).isdisjoint({"torch", "stable_baselines3", "pickle5", "matplotlib"})
