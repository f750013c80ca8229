"""A saved policy is all it takes to swim on, or to learn on; what is no such policy is refused with a sentence."""

import json
import os
import pickle
import random
import zipfile
from dataclasses import replace

import numpy as np
import pytest
import safetensors.torch
import torch
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy

from agents import learner_file
from agents.distillation import Teacher, distil
from agents.hyperparameters import Hyperparameters
from agents.learner_file import resume, save
from agents.ppo import make_model, make_training_env, policy_of
from agents.tasks.learning import imitate
from refusals import assert_refused
from seastar_gym import Numerics, Scene, Seastar, Water
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers import checkpoint
from seastar_gym.controllers.checkpoint import load
from seastar_gym.controllers.learned import pretrained
from seastar_gym.envs.symmetry import VectorFrameStack
from seastar_gym.evaluation.tasks import make_batch
from symmetries import assert_equivariant

FAST = Numerics.preset("fast")
SMALL = Hyperparameters(num_envs=8, rollout=8, batch_size=32, epochs=2, hidden=(16, 8), max_episode_time=10.0)
OTHER = Hyperparameters(
    actions="limbs", symmetry=False, num_envs=4, rollout=4, batch_size=16, epochs=1, hidden=(12,), max_episode_time=5.0
)
OTHER_SCENE = Scene(robot=Seastar(n_limbs=4, nodes_per_limb=4), fluid=Water(drag_coefficient=1.5), numerics=FAST)


def make_learner(hyperparameters=SMALL, scene=None, seed=0):
    env = make_training_env(
        hyperparameters, "random", random_heading=True, scene=Scene(numerics=FAST) if scene is None else scene
    )
    return make_model(env, hyperparameters, seed)


def observations_of(learner, n_strokes=3):
    """Raw observations of robots on their way, (n, size)."""
    batch = learner.get_env().env.unwrapped
    batch.reset(seed=11)
    batch.action_space.seed(12)
    for _ in range(n_strokes):
        observations, *_ = batch.step(batch.action_space.sample())
    return observations


@pytest.fixture(scope="module")
def learner():
    """Has learned a little."""
    learner = make_learner()
    return learner.learn(3 * 64)


@pytest.fixture
def file(learner, tmp_path):
    save(learner, tmp_path / "model.zip")
    return tmp_path / "model.zip"


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"num_envs": 0}, "num_envs must be a whole number from 1"),
        ({"batch_size": 7}, "batch_size must divide the 64 strokes"),
        ({"discount": 1.0}, r"discount must be in \[0, 1\)"),
        ({"learning_rate": float("nan")}, "learning_rate must be a finite number"),
        ({"clip_range": 0.0}, "learning_rate and clip_range must be positive"),
        ({"entropy": -0.1}, "entropy not negative"),
        ({"hidden": ()}, "hidden must be widths"),
    ],
)
def test_hyperparameters_that_cannot_be_are_refused(change, sentence):
    with pytest.raises(ValueError, match=sentence):
        replace(SMALL, **change)


# A policy on disk


@pytest.mark.parametrize("hyperparameters, scene", [(SMALL, None), (OTHER, OTHER_SCENE)])
def test_a_loaded_policy_acts_as_the_learner_did(hyperparameters, scene, tmp_path):
    learner = make_learner(hyperparameters, scene)
    learner.learn(hyperparameters.num_envs * hyperparameters.rollout)
    save(learner, tmp_path / "model.zip")
    policy = load(tmp_path / "model.zip")
    assert policy.actions == hyperparameters.actions
    assert policy.scene == (Scene(numerics=FAST) if scene is None else scene)
    with zipfile.ZipFile(tmp_path / "model.zip") as archive:
        facts = json.loads(archive.read(checkpoint.DESCRIPTION))
    assert facts["observation_layout"] == 2 and facts["strokes_trained"] == learner.num_timesteps
    told = (hyperparameters.actions, hyperparameters.symmetry, [*hyperparameters.hidden], FAST.scheme)
    assert (facts["actions"], facts["symmetry"], facts["hidden"], facts["scene"]["numerics"]["scheme"]) == told
    observations = observations_of(learner)
    actions, state = policy.predict(observations, deterministic=True)
    assert state is None
    expected, _ = policy_of(learner).predict(observations, deterministic=True)
    np.testing.assert_array_equal(actions, expected)
    if not hyperparameters.symmetry:
        np.testing.assert_array_equal(actions, learner.predict(observations, deterministic=True)[0])


def test_a_loaded_policy_is_equivariant_acts_alone_as_in_a_batch_and_explores_unless_told_not_to(learner, file):
    policy, observations = load(file), observations_of(learner)
    assert_equivariant(policy, observations)
    together, _ = policy.predict(observations, deterministic=True)
    alone = [policy.predict(observation, deterministic=True)[0] for observation in observations]
    np.testing.assert_array_equal(alone, together)
    assert np.shape(alone[0]) == ()
    assert len({int(policy.predict(observations[0])[0]) for _ in range(30)}) > 5
    assert len({int(policy.predict(observations[0], deterministic=True)[0]) for _ in range(30)}) == 1


def test_the_learner_and_its_policy_score_the_same(learner):
    """The reduced batch under the learner and the raw batch under its policy are one and the same experiment."""
    env = learner.get_env()
    raw = BatchVecEnv(env.env.env)
    scores = []
    for policy, its_env in ((learner, env), (policy_of(learner), raw)):
        its_env.seed(5)
        scores.append(evaluate_policy(policy, its_env, n_eval_episodes=8, return_episode_rewards=True))
    assert scores[0] == scores[1]


def test_loading_unpickles_nothing_of_a_file_that_stable_baselines_reads_as_its_own(learner, file, tmp_path):
    """Stable-Baselines3's pickles are not even looked at, neither to swim nor to learn on."""
    theirs = PPO.load(file)
    for name, tensor in learner.policy.state_dict().items():
        assert torch.equal(tensor, theirs.policy.state_dict()[name])
    without = tmp_path / "without.zip"
    with zipfile.ZipFile(file) as old, zipfile.ZipFile(without, "w") as new:
        for name in (checkpoint.DESCRIPTION, checkpoint.LEARNER, learner_file.FACTS):
            new.writestr(name, old.read(name))
        for name in set(old.namelist()) - set(new.namelist()):
            new.writestr(name, pickle.dumps(Bomb(tmp_path / "exploded")))
    assert load(without).actions == Hyperparameters().actions
    assert resume(without, make_learner().get_env()).num_timesteps == 3 * 64
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


# Saving


def test_saving_replaces_the_file_in_one_go(learner, file, monkeypatch):
    before = file.read_bytes()

    def fail(source, target):
        assert target == file and source.parent == file.parent
        assert zipfile.ZipFile(source).testzip() is None  # complete before it takes the place
        raise OSError("the disk is gone")

    with monkeypatch.context() as broken:
        broken.setattr(os, "replace", fail)
        with pytest.raises(OSError, match="the disk is gone"):
            save(learner, file)
    assert file.read_bytes() == before
    save(learner, file)
    assert [one.name for one in file.parent.iterdir()] == ["model.zip"]


# Files that are no policy

POLICY, FACTS, TENSORS = checkpoint.DESCRIPTION, learner_file.FACTS, checkpoint.LEARNER


def rewritten(file, change):
    """Rewrite the file after a change of its parts: the description, the learner's facts, and its tensors."""
    with zipfile.ZipFile(file) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    parts = {name: json.loads(entries.pop(name)) for name in (POLICY, FACTS)}
    parts[TENSORS] = safetensors.torch.load(entries.pop(TENSORS))
    change(parts)
    for name, part in parts.items():
        entries[name] = safetensors.torch.save(part) if name == TENSORS else json.dumps(part).encode()
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in entries.items():
            archive.writestr(name, data)


def assert_one_sentence(error, file):
    text = str(error.value)
    assert str(file) in text and "\n" not in text and text.endswith("."), text


@pytest.mark.parametrize("keep", [0, 10, 0.5, 0.99, None])
def test_a_file_that_is_missing_cut_or_changed_by_a_bit_is_said_to_be(file, tmp_path, keep):
    with pytest.raises(FileNotFoundError, match=r"There is no trained policy at .*nothing\.zip") as error:
        load(tmp_path / "nothing.zip")
    assert_one_sentence(error, tmp_path / "nothing.zip")
    data = bytearray(file.read_bytes())
    if keep is None:
        with zipfile.ZipFile(file) as archive:
            data[archive.getinfo(checkpoint.LEARNER).header_offset + 5000] ^= 1
    else:
        data = data[: keep if isinstance(keep, int) else int(keep * len(data))]
    file.write_bytes(bytes(data))
    with pytest.raises(ValueError, match="is damaged" if keep is not None else r"is damaged.*Bad CRC-32") as error:
        load(file)
    assert_one_sentence(error, file)


NO_LIMBS = Scene().to_dict() | {"robot": Scene().to_dict()["robot"] | {"n_limbs": 0}}


def resumed(file):
    return resume(file, make_learner().get_env())


def lacks(part):
    return lambda parts: parts.pop(part)


def says(**facts):
    return lambda parts: parts[POLICY].update(facts)


def told(**facts):
    return lambda parts: parts[FACTS].update(facts)


def has(**tensors):
    return lambda parts: parts[TENSORS].update({name.replace("__", "."): values for name, values in tensors.items()})


@pytest.mark.parametrize(
    "change, sentence",
    [
        (lacks(POLICY), "no policy saved by this project: There is no item"),
        (lacks(TENSORS), "no policy saved by this project: There is no item"),
        (says(observation_layout=1), "its observation_layout is 1, this version of seastar_gym knows 2"),
        (says(format=99), "its format is 99"),
        (says(actions="waves"), "actions must be one of"),
        (says(hidden=[16, 9]), "does not fit"),
        (says(scene=NO_LIMBS), "n_limbs must be a whole number from 1"),
        (says(scene={"robot": {"n_arms": 5}}), "does not fit"),
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
        (has(optimiser__0__exp_avg=torch.zeros(3)), "its optimiser has 0.exp_avg"),
        (has(optimiser__99__exp_avg=torch.zeros(3)), "does not fit"),
        (has(generator__numpy=torch.zeros(3)), "does not fit"),
        (has(generator__torch=torch.zeros(3)), "does not fit"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_sentence(file, change, sentence):
    """By who only swims by the policy, if it is the policy that does not fit."""
    rewritten(file, change)
    read = load if change.__qualname__.startswith(("lacks", "says")) else resumed
    with pytest.raises(ValueError, match=sentence) as error:
        read(file)
    assert_one_sentence(error, file)


@pytest.mark.parametrize("device, sentence", [("cuda", "no CUDA device"), ("tpu", "device must be"), (3, "not 3")])
def test_a_device_that_is_not_there_is_refused(device, sentence, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ValueError, match=sentence):
        make_model(make_learner().get_env(), SMALL, seed=0, device=device)


# Learning on


def numbers_of(learner):
    """Every number that the learner's future depends on, besides the environment's."""
    optimiser = learner.policy.optimizer.state_dict()["state"]
    moments = [optimiser[index][name] for index in sorted(optimiser) for name in sorted(optimiser[index])]
    return [number.detach().numpy() for number in [*learner.policy.state_dict().values(), *moments]]


def test_a_resumed_learner_is_where_it_was(tmp_path):
    learner = make_learner(seed=3).learn(2 * 64)
    save(learner, tmp_path / "model.zip")
    draws = torch.rand(5), np.random.random(5), random.random()  # noqa: NPY002
    resumed = resume(tmp_path / "model.zip", make_learner(seed=9).get_env())
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
    assert resumed.lr_schedule(1.0) == SMALL.learning_rate


def test_the_same_seed_and_the_same_file_train_the_same_policy(file):
    pairs = [make_learner(seed=seed).learn(128) for seed in (1, 1, 2)]
    pairs += [resume(file, make_learner().get_env()).learn(64, reset_num_timesteps=False) for _ in range(2)]
    first, second, other, resumed, again = map(numbers_of, pairs)
    for number, same in [*zip(first, second, strict=True), *zip(resumed, again, strict=True)]:
        np.testing.assert_array_equal(number, same)
    assert any(not np.array_equal(*pair) for pair in zip(first, other, strict=True))


def test_a_resumed_learner_meets_new_paths_and_another_environment_is_refused(file):
    env = make_learner(seed=0).get_env()
    env.seed(0)
    first = env.reset()
    resume(file, env)
    assert env._seeds == [192 + robot for robot in range(8)]
    assert not np.array_equal(env.reset(), first)
    others = make_learner(scene=Scene(numerics=Numerics.preset("chapter"))), make_learner(OTHER, OTHER_SCENE)
    words = r"was trained for .*Scene\(\).* not for .*Numerics\(\)", r"was trained for .*pairs.* not for .*limbs"
    for other, sentence in zip(others, words, strict=True):
        with pytest.raises(ValueError, match=sentence):
            resume(file, other.get_env())


# A student that sees little learns what a teacher that sees all would do, each in its own frame.


ID = "SeastarSwimSimToReal-v0"


def batch(n=16, id=ID, past=8):
    arguments = {"split": "train", "fidelity": "fast", "threads": 1, "autoreset_mode": AutoresetMode.SAME_STEP}
    return VectorFrameStack(make_batch(id, n, **arguments), past)


@pytest.fixture(scope="module")
def teacher():
    return pretrained("timed-0.2s")


def test_advice_is_the_teachers_own_action_whatever_the_student_turns(teacher):
    robots = batch()
    robots.reset(seed=0)
    guide = Teacher(teacher, robots.frame_stack.symmetry)
    for _ in range(8):
        state = robots.unwrapped.privileged_observations()
        theirs, _ = teacher.predict(state, deterministic=True)  # in the world
        advice = np.argmax(guide.logits(state, robots.elements), axis=1)  # as the student sees it
        np.testing.assert_array_equal(robots.frame_stack.symmetry.restore(advice, robots.elements), theirs)
        robots.step(advice)
    assert len(set(robots.elements.tolist())) > 4


def test_a_student_learns_and_the_same_seed_learns_the_same(teacher):
    """After six rounds it agrees with its teacher far more often than by chance, from the camera's pictures alone."""
    torch.set_num_threads(1)
    first, again = (distil(teacher, batch(64), 12_288, seed=1, hidden=(64,)) for _ in range(2))
    for name, values in first.weights.items():
        np.testing.assert_array_equal(again.weights[name], values)
    about = first.description
    assert about.past == 8 and about.task == "sim-to-real" and not about.shows_limbs and about.hidden == (64,)
    robots = batch(64)
    observations, _ = robots.reset(seed=7)
    symmetry, agreed = robots.frame_stack.symmetry, []
    guide = Teacher(teacher, symmetry)
    for _ in range(20):
        chosen = first.logits(observations)[:, 0].argmax(axis=1)
        advice = guide.logits(robots.unwrapped.privileged_observations(), robots.elements)
        agreed.append(advice.argmax(axis=1) == chosen)
        observations, *_ = robots.step(chosen)
    assert np.mean(agreed) > 0.2  # by chance 1 of 21


def test_who_cannot_teach_is_refused(teacher):
    pose = imitate(ID, 0, 4_096, "fast", 1)
    with assert_refused("A teacher is a policy with symmetry, without memory"):
        distil(pose, batch(), 100, 0)
    with assert_refused("The teacher does not see what this batch's robots would show"):
        distil(pretrained("strokes"), batch(), 100, 0)
    with assert_refused("batch must be a VectorFrameStack"):
        distil(teacher, batch().env, 100, 0)
    with assert_refused("decisions must be a whole number"):
        distil(teacher, batch(), 0, 0)
