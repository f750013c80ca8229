"""A policy in its two files swims as its learner did; what does not fit is refused with a sentence."""

import hashlib
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
import safetensors.numpy

from controllers.test_export import random_policy
from every_part import ACTUATORS, PARTS
from later import Later
from refusals import assert_refused
from seastar_gym import Numerics, Scene, Seastar, Sight, SmaPulse, SmaWires
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import BUNDLED, LearnedPolicy, camera_of, load, save
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.sight import told
from seastar_gym.envs.symmetry import VectorSymmetryReduction
from seastar_gym.evaluation.swim import swim
from symmetries import assert_equivariant, symmetry_for

adapter = Later("seastar_gym.adapters.stable_baselines3")
ppo = Later("agents.ppo")
torch = Later("torch")

FAST = Numerics.preset("fast")
SMALL = {"num_envs": 8, "rollout": 8, "batch_size": 32, "epochs": 2, "hidden": (16, 8), "max_episode_time": 10.0}
"""Hyperparameters."""
WIRES = Scene(actuator=SmaWires(), numerics=FAST)
TASK = Description(
    "joint", True, WIRES, (8,), 0.5, "miswired", ((0, -1),), ("vector", "pseudoscalar"), shows_limbs=True, past=2
)
FOUR_LIMBS = Scene(robot=Seastar(n_limbs=4, nodes_per_limb=4), numerics=FAST)


def observations(scene=Scene(), n=2000, seed=0):
    size = Layout.of(scene).size
    return np.random.default_rng(seed).normal(size=(n, size)).astype(np.float32)


# The network


@pytest.mark.parametrize("actions", ["joint", "pairs", "limbs"])
@pytest.mark.parametrize("reduced", [True, False])
@pytest.mark.parametrize("scene", [Scene(numerics=FAST), FOUR_LIMBS])
def test_a_saved_policy_acts_as_stable_baselines_does(actions, reduced, scene, tmp_path):
    hyperparameters = ppo.Hyperparameters(**SMALL, actions=actions, symmetry=reduced)
    env = ppo.make_training_env(hyperparameters, "random", True, scene=scene)
    learner = ppo.make_model(env, hyperparameters, seed=0).learn(64)
    save(ppo.policy_of(learner), tmp_path / "policy.safetensors")
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
    if reduced and n_limbs == 5:
        assert_equivariant(policy, seen[:200])


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


# On disk


@pytest.mark.parametrize(
    "scene", [{"actuator": one} for one in ACTUATORS.values()] + [*PARTS.values()], ids=[*ACTUATORS, *PARTS]
)
def test_a_policy_survives_the_disk_to_the_last_bit(scene, tmp_path):
    """In plain safetensors, which anyone can read: there is nothing to unpickle."""
    policy = random_policy(Description("pairs", False, Scene(**scene), (3,)))
    assert Description.from_json(policy.description.to_json().encode()) == policy.description
    save(policy, tmp_path / "policy.safetensors", seed=7)
    again, weights = load(tmp_path / "policy.safetensors"), safetensors.numpy.load_file(tmp_path / "policy.safetensors")
    facts = json.loads((tmp_path / "policy.json").read_text())
    assert facts["observation_size"] == policy.description.observation_size
    assert again.description == policy.description and again.training == {"seed": 7}
    assert {name: array.shape for name, array in weights.items()} == policy.description.shapes()
    for name, array in policy.weights.items():
        np.testing.assert_array_equal(again.weights[name], array)


def rewrite(file, data: bytes) -> None:
    """Other weights, and a description that says that they are the ones."""
    file.write_bytes(data)
    describe(file, {"sha256": hashlib.sha256(data).hexdigest()})


def describe(file, change):
    """Another description of the weights."""
    facts = json.loads(file.with_suffix(".json").read_text())
    file.with_suffix(".json").write_text(json.dumps(facts | change))


class Bomb:
    def __reduce__(self):
        return print, ("boom",)


def weigh(number):
    """Another number among the weights."""

    def change(file):
        policy = load(file)
        policy.weights["1.bias"][3] = number
        save(policy, file)

    return change


def widen(file):
    weights = {name: array.astype(np.float64) for name, array in load(file).weights.items()}
    rewrite(file, safetensors.numpy.save(weights))


def zip_pickles(file):
    torch.save({"0.weight": Bomb()}, file.with_suffix(".pth"))
    rewrite(file, file.with_suffix(".pth").read_bytes())


NOT_FINITE = "its weights are not all finite numbers of single precision"
CHANGED = [
    *(({"format": value}, f"its format is {value}") for value in (99, True, 2.5)),
    ({"observation_layout": 1}, "its observation_layout is 1, this version of seastar_gym knows 2"),
    ({"actions": "continuous"}, "actions must be one of"),
    *(({"hidden": widths}, "its weights have the shapes ") for widths in ([16, 9], [])),
    *(({"hidden": widths}, "a width of its hidden layers must be a whole number") for widths in ([0], [10**6 + 1])),
    ({"scene": {"robot": {"n_arms": 5}}}, "a dict with a version"),
    ({"decision_period": 0.5}, "decision_period"),
    ({"training": None}, "its training is a NoneType"),
    *(({"training": {"progress": rows}}, "the progress of its training must be rows of three numbers")
      for rows in ([[1, 2]], [[1, 2, 10**400]], {"a": 1})),
    ({"training": {"commands": [3]}}, "the commands of its training must be texts"),
    ({"sha256": 3}, "the weights are not those"),
    ({"limb_mirror": [[0, 1]] * 1001}, "its limb_mirror must be a list of pairs"),
    *(({"limb_mirror": [pair]}, "not an index and a sign") for pair in ([0, 2], [0, 1, 1], [0, 1.0])),
    ({"limb_mirror": [[5, 1]]}, "an index of its limb_mirror must be a whole number from 0 to 0"),
    *(({"limb_mirror": pairs}, "its limb_mirror is no mirror, which undoes itself")
      for pairs in ([[1, 1], [1, 1]], [[1, 1], [0, -1]])),
    *(({"entries": entries}, "entries must be a tuple of") for entries in ("scalar", [["scalar"]])),
]  # fmt: skip
"""Entries of the description, and words of the sentence."""
TEXTS = [
    *((text, "") for text in (b"", b"[]", b"{}", b'{"sha256": null}')),
    (b"\xff\xfe{}", "'utf-8' codec can't decode"),
    (b"null", "its description is a NoneType"),
    (b'{"a":' * 100_000, "nested too deeply"),
    *((b'{"format": %s}' % number, "is no finite number") for number in (b"1e999", b"NaN")),
    (b'{"format": 2, "format": 1}', "does not say 'sha256'"),
]
"""Texts of a description, and words of the sentence."""
DAMAGED = {
    **{f"{suffix} missing": (lambda file, suffix=suffix: file.with_suffix(suffix).unlink(),
       f"There is no trained policy at |policy{suffix} is missing") for suffix in (".safetensors", ".json")},
    "empty": (lambda file: file.write_bytes(b""), "the weights are not those that its .json file describes"),
    **{str(weight): (weigh(weight), NOT_FINITE) for weight in (np.nan, np.inf, -np.inf)},
    "doubles": (widen, NOT_FINITE), "a zip of pickles": (zip_pickles, ""),
    "a pickle": (lambda file: rewrite(file, pickle.dumps(Bomb())), ""),
    **{f"{change}"[:40] + f" {k}": (lambda file, change=change: describe(file, change), words)
       for k, (change, words) in enumerate(CHANGED)},
    **{f"{text[:20]} {k}": (lambda file, text=text: file.with_suffix(".json").write_bytes(text), words)
       for k, (text, words) in enumerate(TEXTS)},
}  # fmt: skip
"""What is done to the files of a policy, and words of the sentence."""


@pytest.mark.parametrize("change, words", DAMAGED.values(), ids=DAMAGED)
def test_files_that_are_no_policy_are_refused_unread_in_a_sentence(change, words, tmp_path):
    file = tmp_path / "policy.safetensors"
    save(random_policy(Description("joint", True, Scene(numerics=FAST), (16, 8))), file)
    change(file)
    with pytest.raises((ValueError, FileNotFoundError)) as refused:
        load(file)
    text = str(refused.value)
    kind = [] if isinstance(refused.value, FileNotFoundError) else ["is damaged, or no policy of this version"]
    assert all(word.lower() in text.lower() for word in (str(file), *kind, *words.split("|"))), text
    assert "\n" not in text and text.endswith("."), text


class Own(SmaPulse):
    """Not the package's."""


OF_OWN = Description("pairs", False, Scene(actuator=Own()), (3,))


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: load("model.pkl"), "A policy is in a file named .safetensors"),
        (lambda: load().predict(np.zeros(150, np.float32)), "robot of 5 limbs: it sees 186 numbers, not "),
        (lambda: LearnedPolicy(TASK, {"0.bias": [1.0]}), "weights must be arrays by name"),
        (lambda: save(random_policy(OF_OWN), "own.safetensors"), "Scene.actuator is a Own, "),
    ],
)
def test_what_no_policy_can_be_is_refused_and_not_written(call, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with assert_refused(words):
        call()
    assert not [*tmp_path.iterdir()]
    TASK._replace(limb_mirror=((1, -1), (0, -1)), entries=("scalar",) * 1000, past=1000).check()


SEEN = {
    "full sight": {},
    "the pose alone": {"sight": Sight(delay=0.1)},
    "a marker": {"sight": Sight(dropout=0.1, sees=1), "action_delay": 0.02},
}
"""Options of environments by words for what is seen in them."""


@pytest.mark.parametrize("given", SEEN)
@pytest.mark.parametrize("trained", SEEN)
def test_a_policy_knows_its_camera_and_swims_in_what_shows_the_same(trained, given, tmp_path):
    options = {"num_envs": 1, "scene": WIRES, "decision_period": 0.2}
    batch = ppo.make_training_batch(ppo.Hyperparameters(**SMALL), "line", True, **options, **SEEN[trained])
    about = ppo.describe(adapter.BatchVecEnv(VectorSymmetryReduction(batch)), (4,))
    save(random_policy(about), tmp_path / "policy.safetensors")
    policy = load(tmp_path / "policy.safetensors")
    assert camera_of(policy).get("sight") == SEEN[trained].get("sight") and policy.description.path == "line"
    env = SeastarSwimEnv("line", scene=WIRES, decision_period=0.2, actions="pairs", **SEEN[given])
    if trained == given:
        assert swim("trained", policy, env, max_strokes=1).strokes == 1
        return
    with assert_refused(f"trained for {told(policy.description.sight)}, and is given {told(env.sight)}"):
        swim("trained", policy, env, max_strokes=1)


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
    """The bytes with a few pieces left out, doubled, drawn anew or the last ones, half of them among the first ones."""
    for _ in range(rng.integers(1, 4)):
        end = len(data) if n_first is None or rng.random() < 0.5 else n_first
        place, length = int(rng.integers(max(1, min(end, len(data))))), int(rng.integers(1, 20))
        before, piece, after = data[:place], data[place : place + length], data[place + length :]
        data = before + [b"", 2 * piece, rng.bytes(1) + piece[1:], rng.bytes(length)][rng.integers(4)]
        data += b"" if rng.random() < 0.06 else after
    return data or b"\0"


# Of a task, with memory


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
        with assert_refused("past observations of shape (4, 2, 194)."):
            policy.predict(first, wrong)


# The bundled policy


@pytest.mark.parametrize("robot", [None, Seastar(nodes_per_limb=7), Seastar(nodes_per_limb=19)])
def test_the_policy_in_the_box_beats_the_script_round_the_pentagon_and_says_how_it_was_made(robot):
    """The script takes 241 strokes; with any nodes per limb."""
    shipped = load()
    scene = shipped.scene if robot is None else Scene(robot, numerics=FAST)
    done = swim("learned", shipped, SeastarSwimEnv(actions=shipped.actions, scene=scene), max_strokes=300)
    assert done.finished and done.strokes < 200
    trained_at = Scene.preset("balanced")  # before it was given numerical damping
    assert shipped.scene == replace(trained_at, numerics=replace(trained_at.numerics, damping=0.0))
    assert {"seastar_gym", "numpy", "torch", "stable_baselines3"} <= set(shipped.training["versions"])
    assert BUNDLED.stat().st_size < 1_000_000
