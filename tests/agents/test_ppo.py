"""A saved policy is all it takes to swim on, or to learn on; what is no such policy is refused with a sentence."""

import json
import os
import pickle
import random
import zipfile

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from later import Later
from refusals import assert_refused
from seastar_gym import Numerics, Scene, Seastar, Sight, SmaWires, Water
from seastar_gym.controllers import learned
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import LearnedPolicy, load, pretrained
from seastar_gym.envs.symmetry import VectorFrameStack
from seastar_gym.evaluation.rollout import make_batch

distillation = Later("agents.distillation")
learner_file = Later("agents.learner_file")
ppo = Later("agents.ppo")
torch = Later("torch")

FAST = Numerics.preset("fast")
SMALL = {"num_envs": 8, "rollout": 8, "batch_size": 32, "epochs": 2, "hidden": (16, 8), "max_episode_time": 10.0}
OTHER = {
    "actions": "limbs", "symmetry": False, "num_envs": 4, "rollout": 4, "batch_size": 16, "epochs": 1, "hidden": (12,),
    "max_episode_time": 5.0,
}  # fmt: skip
"""Hyperparameters."""
POLICY, FACTS, TENSORS = learned.DESCRIPTION, "learner.json", learned.LEARNER
"""Entries of a file: the description, the learner's facts, and its tensors."""
OTHER_SCENE = Scene(robot=Seastar(n_limbs=4, nodes_per_limb=4), fluid=Water(drag_coefficient=1.5), numerics=FAST)


def make_learner(given=SMALL, scene=None, seed=0):
    hyperparameters, scene = ppo.Hyperparameters(**given), Scene(numerics=FAST) if scene is None else scene
    env = ppo.make_training_env(hyperparameters, "random", random_heading=True, scene=scene)
    return ppo.make_model(env, hyperparameters, seed)


@pytest.fixture(scope="module")
def learner():
    """Has learned a little."""
    return make_learner().learn(3 * 64)


@pytest.fixture
def file(learner, tmp_path):
    learner_file.save(learner, tmp_path / "model.zip")
    return tmp_path / "model.zip"


# A policy on disk


@pytest.mark.parametrize("given, scene", [(SMALL, None), (OTHER, OTHER_SCENE)])
def test_a_loaded_policy_is_the_learner_s(given, scene, tmp_path):
    learner = make_learner(given, scene).learn(given["num_envs"] * given["rollout"])
    learner_file.save(learner, tmp_path / "model.zip")
    loaded, own = load(tmp_path / "model.zip"), ppo.policy_of(learner)
    assert loaded.description == own.description and loaded.actions == given.get("actions", "pairs")
    for name, weights in own.weights.items():
        np.testing.assert_array_equal(loaded.weights[name], weights)
    with zipfile.ZipFile(tmp_path / "model.zip") as archive:
        assert json.loads(archive.read(POLICY))["strokes_trained"] == learner.num_timesteps


def test_loading_unpickles_nothing_of_a_file_that_stable_baselines_reads_as_its_own(learner, file, tmp_path):
    """Stable-Baselines3's pickles are not even looked at, neither to swim nor to learn on."""
    from stable_baselines3 import PPO

    theirs = PPO.load(file)
    for name, tensor in learner.policy.state_dict().items():
        assert torch.equal(tensor, theirs.policy.state_dict()[name])
    without = tmp_path / "without.zip"
    with zipfile.ZipFile(file) as old, zipfile.ZipFile(without, "w") as new:
        for name in (POLICY, TENSORS, FACTS):
            new.writestr(name, old.read(name))
        for name in set(old.namelist()) - set(new.namelist()):
            new.writestr(name, pickle.dumps(Bomb(tmp_path / "exploded")))
    assert load(without).actions == "pairs"
    assert learner_file.resume(without, make_learner().get_env()).num_timesteps == 3 * 64
    assert not (tmp_path / "exploded").exists()
    with zipfile.ZipFile(without) as archive:
        pickle.loads(archive.read("data"))
    assert (tmp_path / "exploded").exists()


class Bomb:
    """Whoever unpickles it makes a folder."""

    def __init__(self, folder):
        self.folder = folder

    def __reduce__(self):
        return os.mkdir, (self.folder,)


# Files that are no policy


def rewritten(file, change):
    """Rewrite the file after a change of its parts: the description, the learner's facts, and its tensors."""
    from safetensors.torch import load, save

    with zipfile.ZipFile(file) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    parts = {name: json.loads(entries.pop(name)) for name in (POLICY, FACTS)}
    parts[TENSORS] = load(entries.pop(TENSORS))
    change(parts)
    for name, part in parts.items():
        entries[name] = save(part) if name == TENSORS else json.dumps(part).encode()
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in entries.items():
            archive.writestr(name, data)


def lacks(part):
    return lambda parts: parts.pop(part)


def says(**facts):
    return lambda parts: parts[POLICY].update(facts)


def told(**facts):
    return lambda parts: parts[FACTS].update(facts)


def has_zeros(name):
    return lambda parts: parts[TENSORS].update({name: torch.zeros(3)})


@pytest.mark.parametrize(
    "change, sentence",
    [
        (lacks(POLICY), "no policy saved by this project: There is no item"),
        (lacks(TENSORS), "no policy saved by this project: There is no item"),
        (says(format=99), "its format is 99"),
        (says(hidden=[16, 9]), "does not fit"),
        (lambda parts: parts[FACTS].pop("seed"), "damaged.*: seed"),
        (told(format=2), "the learner's format is 2, this version knows 1"),
        (told(seed="x"), "seed must be a whole number"),
        (told(strokes=-1), "strokes must be a whole number"),
        (told(numpy=[10**6, 0, 0.0]), "position in numpy's generator must be a whole"),
        (told(episodes=[1]), "does not fit"),
        (lambda parts: parts[FACTS]["settings"].update(rollout="many"), "does not fit"),
        (lambda parts: parts[FACTS]["settings"].update(patience=3), "does not fit"),
        (lambda parts: parts[TENSORS].pop("network.value_net.bias"), "Missing key"),
        (lambda parts: parts[TENSORS].pop("generator.torch"), "damaged.*: torch"),
        (has_zeros("optimiser.0.exp_avg"), "its optimiser has 0.exp_avg"),
        *((has_zeros(name), "does not fit") for name in ("optimiser.99.exp_avg", "generator.numpy", "generator.torch")),
    ],
)
def test_what_does_not_fit_is_refused_in_one_sentence(file, change, sentence):
    """By who only swims by the policy, if it is the policy that does not fit."""
    rewritten(file, change)
    only_swims = change.__qualname__.startswith(("lacks", "says"))
    with pytest.raises(ValueError, match=sentence) as error:
        load(file) if only_swims else learner_file.resume(file, make_learner().get_env())
    text = str(error.value)
    assert str(file) in text and "\n" not in text and text.endswith("."), text


# Learning on


def numbers_of(learner):
    """Every number that the learner's future depends on, besides the environment's."""
    optimiser = learner.policy.optimizer.state_dict()["state"]
    moments = [optimiser[index][name] for index in sorted(optimiser) for name in sorted(optimiser[index])]
    return [number.detach().numpy() for number in [*learner.policy.state_dict().values(), *moments]]


def test_a_resumed_learner_is_where_it_was(tmp_path):
    learner = make_learner(seed=3).learn(2 * 64)
    learner_file.save(learner, tmp_path / "model.zip")
    draws = torch.rand(5), np.random.random(5), random.random()  # noqa: NPY002
    resumed = learner_file.resume(tmp_path / "model.zip", make_learner(seed=9).get_env())
    again = torch.rand(5), np.random.random(5), random.random()  # noqa: NPY002
    for draw, its_draw in zip(draws, again, strict=True):
        np.testing.assert_array_equal(draw, its_draw)
    assert resumed.num_timesteps == learner.num_timesteps == 128
    assert resumed.seed == 3
    numbers, its_numbers = numbers_of(learner), numbers_of(resumed)
    assert len(numbers) == len(its_numbers) > 20
    for number, its_number in zip(numbers, its_numbers, strict=True):
        np.testing.assert_array_equal(number, its_number)
    for name in ("n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda", "ent_coef"):
        assert getattr(resumed, name) == getattr(learner, name)
    assert resumed._n_updates == learner._n_updates > 0
    assert list(resumed.ep_info_buffer) == list(learner.ep_info_buffer) != []
    resumed.learn(64, reset_num_timesteps=False)
    assert resumed.num_timesteps == 192
    assert resumed.lr_schedule(1.0) == ppo.Hyperparameters().learning_rate


def test_the_same_seed_and_the_same_file_train_the_same_policy(file):
    pairs = [make_learner(seed=seed).learn(128) for seed in (1, 1, 2)]
    for _ in range(2):
        pairs.append(learner_file.resume(file, make_learner().get_env()).learn(64, reset_num_timesteps=False))
    first, second, other, resumed, again = map(numbers_of, pairs)
    for number, same in [*zip(first, second, strict=True), *zip(resumed, again, strict=True)]:
        np.testing.assert_array_equal(number, same)
    assert any(not np.array_equal(*pair) for pair in zip(first, other, strict=True))


def test_a_resumed_learner_meets_new_paths_and_another_environment_is_refused(file):
    env = make_learner(seed=0).get_env()
    env.seed(0)
    first = env.reset()
    learner_file.resume(file, env)
    assert env._seeds == [192 + robot for robot in range(8)]
    assert not np.array_equal(env.reset(), first)
    others = make_learner(scene=Scene(numerics=Numerics.preset("chapter"))), make_learner(OTHER, OTHER_SCENE)
    words = r"was trained for .*Scene\(\).* not for .*Numerics\(\)", r"was trained for .*pairs.* not for .*limbs"
    for other, sentence in zip(others, words, strict=True):
        with pytest.raises(ValueError, match=sentence):
            learner_file.resume(file, other.get_env())


# A student that sees little learns what a teacher that sees all would do, each in its own frame.


ID = "SeastarSwimSimToReal-v0"


def batch(n=16, id=ID, past=8):
    arguments = {"split": "train", "fidelity": "fast", "threads": 1, "autoreset_mode": AutoresetMode.SAME_STEP}
    return VectorFrameStack(make_batch(id, n, **arguments), past)


@pytest.fixture(scope="module")
def teacher():
    return pretrained("timed-0.2s")


WIRES = Scene(actuator=SmaWires()).at("fast")


@pytest.mark.parametrize("turns", [True, False])
@pytest.mark.parametrize("symmetry", [True, False])
@pytest.mark.parametrize("actions", ["pairs", "joint", "limbs"])
def test_advice_is_the_teachers_own_action_whatever_the_student_turns(actions, symmetry, turns):
    about, rng = Description(actions, symmetry, WIRES, (8,), 0.2), np.random.default_rng(0)
    weights = {name: rng.normal(size=shape).astype(np.float32) for name, shape in about.shapes().items()}
    teacher, hyperparameters = LearnedPolicy(about, weights), ppo.Hyperparameters(actions=actions, decision_period=0.2)
    given = {"fidelity": "fast", "threads": 1, "num_envs": 16, "sight": Sight(delay=0.1)}
    robots = VectorFrameStack(ppo.make_training_batch(hyperparameters, "random", True, **given), 2, turns)
    robots.reset(seed=0)
    student, elements = robots.frame_stack.symmetry, set()
    for _ in range(8):
        state = robots.unwrapped.privileged_observations()
        theirs, _ = teacher.predict(state, deterministic=True)  # in the world
        logits = distillation.advice(teacher, student, state, robots.elements)
        advice = np.argmax(logits, axis=-1)  # as the student sees it
        advice = advice if actions == "limbs" else advice[:, 0]
        np.testing.assert_array_equal(robots.frame_stack.symmetry.restore(advice, robots.elements), theirs)
        elements |= set(robots.elements.tolist())
        robots.step(advice)
    assert len(elements) > 4 if turns else elements == {0}


def test_a_student_learns_and_the_same_seed_learns_the_same(teacher):
    """After six rounds it agrees with its teacher far more often than by chance, from the camera's pictures alone."""
    torch.set_num_threads(1)
    first, again = (distillation.distil(teacher, batch(64), 12_288, seed=1, hidden=(64,)) for _ in range(2))
    for name, values in first.weights.items():
        np.testing.assert_array_equal(again.weights[name], values)
    about = first.description
    assert about.past == 8 and about.task == "sim-to-real" and not about.shows_limbs and about.hidden == (64,)
    robots = batch(64)
    observations, _ = robots.reset(seed=7)
    symmetry, agreed = robots.frame_stack.symmetry, []
    for _ in range(20):
        chosen = first.logits(observations)[:, 0].argmax(axis=1)
        state = robots.unwrapped.privileged_observations()
        advice = distillation.advice(teacher, symmetry, state, robots.elements)[:, 0]
        agreed.append(advice.argmax(axis=1) == chosen)
        observations, *_ = robots.step(chosen)
    assert np.mean(agreed) > 0.2  # by chance 1 of 21


def test_who_cannot_teach_is_refused(teacher):
    for given, words in (
        ((pretrained("sim-to-real-0.2s"), batch(), 100), "A teacher is a policy without memory"),
        ((pretrained("strokes"), batch(), 100), "The teacher does not see what this batch's robots would show"),
        ((teacher, batch().env, 100), "batch must be a VectorFrameStack"),
        ((teacher, batch(), 0), "decisions must be a whole number"),
    ):
        with assert_refused(words):
            distillation.distil(*given, 0)
