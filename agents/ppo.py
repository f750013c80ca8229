"""PPO on the native batch: its hyperparameters, its training environment, and learners on disk.

A saved learner is Stable-Baselines3's own zip file with three more entries, which hold no pickles: `policy.json` says
what the policy expects (observation layout, scene, action mode, symmetry), `learner.safetensors` has the network, the
optimiser and the random generators, `learner.json` the settings and counters. `load` and `resume` read these three, and
unpickle nothing. `PPO.load` of Stable-Baselines3 reads the file, too, and unpickles its own part: only from people you
trust. Policies without their learner stand in policy.py.
"""

import io
import json
import os
import random
import zipfile
import zlib
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any, get_args

import gymnasium as gym
import numpy as np
import safetensors.torch
import torch
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.utils import LinearSchedule

from agents.files import write_atomically
from agents.policy import Description, LearnedPolicy, Weights, reason_of
from agents.vec_env import BatchVecEnv
from seastar_gym import RewardWeights
from seastar_gym.envs.commands import Actions
from seastar_gym.envs.symmetry import VectorSymmetryReduction
from seastar_gym.envs.task import Path as SwimPath
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_choice, require_count, require_finite, shown
from seastar_gym.scene.numerics import Fidelity

DESCRIPTION, LEARNER, FACTS = "policy.json", "learner.safetensors", "learner.json"
FORMAT = 1
"""Version of what a saved learner goes on from."""


@dataclass(frozen=True)
class Hyperparameters:
    """What PPO learns with, and why.

    Numbers: mean strokes on held-out random paths after 98,304 strokes of training (`python -m
    studies.learning.ablations`), 161 with these values; all trainings there choose among all 243 commands. They are
    means of three seeds that differ by up to 2 strokes, so smaller differences say nothing.
    """

    actions: Actions = "pairs"
    """One categorical over the 21 commands that heat no limb or a pair. Over all 243 ("joint") it is as good on
    held-out paths, but later, and its seeds differ by more round the pentagon. With one distribution per limb ("limbs")
    it stays at 182: the fastest swim alternates between two pairs of limbs, which independent limbs do not find."""
    symmetry: bool = True
    """Waypoints turned and mirrored into one sector: every stroke teaches ten directions at once. Without, it is
    at 167."""
    num_envs: int = 128
    """Robots side by side. Small rollouts, so frequent updates: 512 robots, with batches four times as large, are at
    178. Fewer would keep the simulator's lanes and threads less busy."""
    rollout: int = 16
    """Strokes of every robot between updates: three times the horizon 1/(1 - discount)."""
    batch_size: int = 512
    """A quarter of a rollout."""
    epochs: int = 6
    """Passes over a rollout."""
    learning_rate: float = 1e-3
    """At first; it falls linearly to zero, so that the last policy is a settled one."""
    discount: float = 0.8
    """Per stroke. What a stroke does to the swimming is over after a few: 0.5 ends where 0.8 does. 0.95 stays at 165,
    because the noise of twenty strokes hides the worth of one."""
    gae_lambda: float = 0.9
    """Little depends on it with so short a horizon."""
    clip_range: float = 0.2
    """PPO's customary one."""
    entropy: float = 0.0
    """Weight of the entropy bonus. Exploration lasts long enough without: 0.01 gains nothing (162)."""
    hidden: tuple[int, ...] = (128, 128)
    """Widths of the hidden layers, of policy and value each. 256 gain no more than a seed does (160)."""
    max_episode_steps: int = 400
    """Time limit of a training episode [strokes]: a random path takes about 160."""
    reward: RewardWeights = RewardWeights()
    """Progress dominates: a stroke of the best gaits earns about 1, and a heated limb costs 0.01."""

    def __post_init__(self) -> None:
        require_choice("actions", self.actions, get_args(Actions))
        for name in ("num_envs", "rollout", "batch_size", "epochs", "max_episode_steps"):
            require_count(name, getattr(self, name), 1, 2**31)
        for name in ("learning_rate", "discount", "gae_lambda", "clip_range", "entropy"):
            require_finite(name, getattr(self, name), "1")
        if not isinstance(self.symmetry, bool) or not isinstance(self.reward, RewardWeights):
            raise ValueError(f"symmetry must be True or False, and reward RewardWeights, not {self.symmetry!r}.")
        strokes = int(self.num_envs) * int(self.rollout)
        if strokes % int(self.batch_size):
            raise ValueError(
                f"batch_size must divide the {strokes} strokes of a rollout of all robots, {self.batch_size} does not."
            )
        if not (0.0 <= self.discount < 1.0 and 0.0 <= self.gae_lambda <= 1.0):
            raise ValueError("discount must be in [0, 1) and gae_lambda in [0, 1].")
        if not (self.learning_rate > 0.0 and self.clip_range > 0.0 and self.entropy >= 0.0):
            raise ValueError("learning_rate and clip_range must be positive, entropy not negative.")
        if not isinstance(self.hidden, tuple) or not self.hidden:
            raise ValueError(f"hidden must be widths of at least 1, not {shown(self.hidden)}.")
        for width in self.hidden:
            require_count("a width in hidden", width, 1, 2**20)


def make_training_env(
    hyperparameters: Hyperparameters,
    path: SwimPath,
    random_heading: bool,
    fidelity: Fidelity | None = None,
    scene: Scene | None = None,
    threads: int | None = None,
) -> BatchVecEnv:
    """The native batch as Stable-Baselines3 wants it, with symmetry reduction if asked for."""
    env: gym.vector.VectorEnv[Any, Any, Any] = gym.make_vec(
        "SeastarSwim-v0",
        num_envs=hyperparameters.num_envs,
        vectorization_mode="vector_entry_point",
        max_episode_steps=hyperparameters.max_episode_steps,
        path=path,
        random_heading=random_heading,
        actions=hyperparameters.actions,
        fidelity=fidelity,
        scene=scene,
        reward=hyperparameters.reward,
        autoreset_mode=AutoresetMode.SAME_STEP,
        threads=threads,
    )
    return BatchVecEnv(VectorSymmetryReduction(env) if hyperparameters.symmetry else env)


def make_model(
    env: BatchVecEnv,
    hyperparameters: Hyperparameters,
    seed: int,
    device: str = "cpu",
    tensorboard_log: str | os.PathLike[str] | None = None,
) -> PPO:
    """A new learner on this environment."""
    require_device(device)
    return PPO(
        "MlpPolicy",
        env,
        n_steps=hyperparameters.rollout,
        batch_size=hyperparameters.batch_size,
        n_epochs=hyperparameters.epochs,
        learning_rate=LinearSchedule(hyperparameters.learning_rate, 0.0, 1.0),
        gamma=hyperparameters.discount,
        gae_lambda=hyperparameters.gae_lambda,
        clip_range=hyperparameters.clip_range,
        ent_coef=hyperparameters.entropy,
        policy_kwargs={"net_arch": list(hyperparameters.hidden)},
        tensorboard_log=None if tensorboard_log is None else os.fspath(tensorboard_log),
        seed=seed,
        device=device,
    )


def require_device(device: str) -> None:
    """ValueError for a device that is not there, where Stable-Baselines3 would quietly take the processor."""
    if device not in ("cpu", "cuda", "auto"):
        raise ValueError(f"device must be 'cpu', 'cuda' or 'auto', not {device!r}.")
    if device == "cuda" and not torch.cuda.is_available():
        raise ValueError("There is no CUDA device that torch can use: take device cpu or auto.")


# --- what is learned -------------------------------------------------------------------------------------------------


def describe(env: BatchVecEnv, hidden: tuple[int, ...]) -> Description:
    """What a policy with these hidden layers expects that learns here."""
    batch: Any = env.env.unwrapped
    return Description(batch.actions, env.env_is_wrapped(VectorSymmetryReduction)[0], batch.scene, hidden)


def policy_of(model: PPO) -> LearnedPolicy:
    """What a learner on a `BatchVecEnv` has learned so far."""
    env = model.get_env()
    if not isinstance(env, BatchVecEnv):
        raise ValueError(f"Only a learner on a BatchVecEnv says what its policy expects, not one on {env}.")
    description = describe(env, tuple(model.policy_kwargs["net_arch"]))
    return LearnedPolicy(description, _actor(model.policy.state_dict()))


def _actor(weights: Mapping[str, torch.Tensor]) -> Weights:
    """The policy's part of Stable-Baselines3's network, as `LearnedPolicy` names it."""
    hidden = sorted({int(name.split(".")[2]) for name in weights if name.startswith("mlp_extractor.policy_net.")})
    layers = [*(f"mlp_extractor.policy_net.{number}" for number in hidden), "action_net"]
    return {
        f"{layer}.{kind}": weights[f"{name}.{kind}"].detach().cpu().numpy().copy()
        for layer, name in enumerate(layers)
        for kind in ("weight", "bias")
    }


# --- saving ----------------------------------------------------------------------------------------------------------


def save(model: PPO, path: str | os.PathLike[str]) -> None:
    """Save a learner, all at once: whoever looks at `path` finds the old file or the new one, never half a file."""
    buffer = io.BytesIO()
    model.save(buffer)
    with zipfile.ZipFile(buffer, "a") as archive:
        description = policy_of(model).description
        archive.writestr(DESCRIPTION, description.to_json(strokes_trained=model.num_timesteps))
        archive.writestr(LEARNER, safetensors.torch.save({**_tensors(model), **_generators(model)}))
        archive.writestr(FACTS, json.dumps(_facts(model)))
    write_atomically(path, buffer.getvalue())


def _tensors(model: PPO) -> dict[str, torch.Tensor]:
    """Every number that is learned: the network's, and the optimiser's moments of each."""
    network = {f"network.{name}": tensor for name, tensor in model.policy.state_dict().items()}
    moments = {
        f"optimiser.{index}.{name}": tensor
        for index, state in model.policy.optimizer.state_dict()["state"].items()
        for name, tensor in state.items()
    }
    return {name: tensor.detach().cpu().contiguous() for name, tensor in (network | moments).items()}


def _generators(model: PPO) -> dict[str, torch.Tensor]:
    """The global generators of torch, numpy and Python; what is no word of theirs is among the facts."""
    _, numpy_words, *_ = np.random.get_state(legacy=True)  # noqa: NPY002
    words = {
        "torch": torch.get_rng_state(),
        "numpy": torch.from_numpy(np.asarray(numpy_words, np.int64)),
        "python": torch.tensor(random.getstate()[1]),
    }
    if model.device.type == "cuda":
        words["cuda"] = torch.cuda.get_rng_state(model.device)
    return {f"generator.{name}": tensor for name, tensor in words.items()}


def _facts(model: PPO) -> dict[str, Any]:
    """What a learner goes on from besides its tensors, as JSON has it."""
    _, _, *numpy_rest = np.random.get_state(legacy=True)  # noqa: NPY002
    return {
        "format": FORMAT,
        "settings": asdict(_hyperparameters(model)),
        "seed": model.seed,
        "strokes": model.num_timesteps,
        "updates": model._n_updates,
        "episodes": list(model.ep_info_buffer or ()),
        "successes": list(model.ep_success_buffer or ()),
        "numpy": numpy_rest,
        "python": random.getstate()[2],
    }


def _hyperparameters(model: PPO) -> Hyperparameters:
    """Those that a learner learns with; what its environment is made with keeps its defaults."""
    assert callable(model.clip_range)
    return Hyperparameters(
        num_envs=model.n_envs,
        rollout=model.n_steps,
        batch_size=model.batch_size,
        epochs=model.n_epochs,
        learning_rate=model.lr_schedule(1.0),
        discount=model.gamma,
        gae_lambda=model.gae_lambda,
        clip_range=model.clip_range(1.0),
        entropy=model.ent_coef,
        hidden=tuple(model.policy_kwargs["net_arch"]),
    )


# --- loading ---------------------------------------------------------------------------------------------------------


def load(path: str | os.PathLike[str]) -> LearnedPolicy:
    """The policy in a file that `save` wrote. FileNotFoundError or ValueError, with one sentence, if there is none."""
    with _opened(path) as archive:
        description = Description.from_json(archive.read(DESCRIPTION).decode())
        network = _part(safetensors.torch.load(archive.read(LEARNER)), "network")
        return LearnedPolicy(description, _actor(network))


def resume(path: str | os.PathLike[str], env: BatchVecEnv, device: str = "cpu") -> PPO:
    """The learner in a file that `save` wrote, as it was: weights, optimiser, stroke count and random states.

    The environment's episodes begin anew, with seeds that were not used before. Nothing is unpickled.
    """
    with _opened(path) as archive:
        description = Description.from_json(archive.read(DESCRIPTION).decode())
        tensors = safetensors.torch.load(archive.read(LEARNER))
        facts = json.loads(archive.read(FACTS))
        network = _part(tensors, "network")
        LearnedPolicy(description, _actor(network))  # its widths are those of tensors that are there
    ours = describe(env, description.hidden)
    if description != ours:
        raise ValueError(f"{os.fspath(path)} was trained for {description}, not for {ours}.")
    require_device(device)
    with _one_sentence(path):
        require_count("seed", facts["seed"], 0, 2**32 - 1)
        settings = facts["settings"] | {"hidden": description.hidden, "reward": RewardWeights()}
        model = make_model(env, Hyperparameters(**settings), facts["seed"], device)
        model.policy.load_state_dict(network)
        _restore_optimiser(model, _part(tensors, "optimiser"))
        _restore_counters(model, facts)
        env.seed(facts["seed"] + model.num_timesteps)
        _restore_generators(model, _part(tensors, "generator"), facts)
    return model


def _part(tensors: Mapping[str, torch.Tensor], kind: str) -> dict[str, torch.Tensor]:
    """The tensors of one kind, without it in their names."""
    return {name.removeprefix(f"{kind}."): one for name, one in tensors.items() if name.startswith(f"{kind}.")}


def _restore_optimiser(model: PPO, moments: Mapping[str, torch.Tensor]) -> None:
    parameters = list(model.policy.parameters())
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, tensor in moments.items():
        index, _, moment = name.partition(".")
        if tensor.shape not in ((), parameters[int(index)].shape):
            raise ValueError(f"its optimiser has {name} of shape {tuple(tensor.shape)}")
        state.setdefault(int(index), {})[moment] = tensor
    groups = model.policy.optimizer.state_dict()["param_groups"]
    model.policy.optimizer.load_state_dict({"state": state, "param_groups": groups})


def _restore_counters(model: PPO, facts: Mapping[str, Any]) -> None:
    if facts["format"] != FORMAT:
        raise ValueError(f"the learner's format is {facts['format']}, this version knows {FORMAT}")
    for name in ("strokes", "updates"):
        require_count(name, facts[name], 0, 2**53)
    model.num_timesteps, model._n_updates = facts["strokes"], facts["updates"]
    size = model._stats_window_size
    model.ep_info_buffer = deque(({name: float(one[name]) for name in "rlt"} for one in facts["episodes"]), size)
    model.ep_success_buffer = deque(map(float, facts["successes"]), size)


def _restore_generators(model: PPO, words: Mapping[str, torch.Tensor], facts: Mapping[str, Any]) -> None:
    """Set the global generators; a place beyond numpy's words would be read from foreign memory, unchecked."""
    position, has_gauss, cached_gaussian = facts["numpy"]
    require_count("the position in numpy's generator", position, 0, 624)
    numpy_words = words["numpy"].numpy().astype(np.uint32)
    np.random.set_state(("MT19937", numpy_words, position, has_gauss, cached_gaussian))  # noqa: NPY002
    random.setstate((3, tuple(words["python"].tolist()), facts["python"]))
    torch.set_rng_state(words["torch"])
    if model.device.type == "cuda" and "cuda" in words:
        torch.cuda.set_rng_state(words["cuda"], model.device)


@contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[zipfile.ZipFile]:
    if not os.path.isfile(path):
        raise FileNotFoundError(f"There is no trained policy at {os.fspath(path)}.")
    with _one_sentence(path), zipfile.ZipFile(path) as archive:
        yield archive


@contextmanager
def _one_sentence(path: str | os.PathLike[str]) -> Iterator[None]:
    """Within it, whatever is wrong with the file's contents becomes a ValueError with one sentence."""
    try:
        yield
    except (zipfile.BadZipFile, EOFError, zlib.error, KeyError, safetensors.SafetensorError) as damaged:
        reason = str(damaged.args[0]).rstrip(".")
        raise ValueError(f"{os.fspath(path)} is damaged, or no policy saved by this project: {reason}.") from damaged
    except (AttributeError, IndexError, OverflowError, RuntimeError, TypeError, ValueError) as mismatch:
        raise ValueError(f"{os.fspath(path)} does not fit: {reason_of(mismatch)}.") from mismatch
