"""PPO on the native batch: its hyperparameters, its training environment, and learners on disk.

A saved learner is Stable-Baselines3's own zip file with two more entries: `policy.json` says what the policy expects
(observation layout, scene, action mode, symmetry), `random_states.npz` holds what `resume` continues from. `load` reads
only `policy.json` and the network's weights, and unpickles nothing. What policies are and how they are kept without
their learner stands in policy.py.
"""

import io
import os
import pickle
import random
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.utils import LinearSchedule

from agents.policy import Description, LearnedPolicy, Weights, reason_of
from agents.vec_env import BatchVecEnv
from seastar_gym import RewardWeights
from seastar_gym.envs.commands import Actions
from seastar_gym.envs.symmetry import VectorSymmetryReduction
from seastar_gym.envs.task import Path as SwimPath
from seastar_gym.scene import Fidelity, Scene

DESCRIPTION, WEIGHTS, RANDOM_STATES = "policy.json", "policy.pth", "random_states.npz"

Loaded = TypeVar("Loaded")


@dataclass(frozen=True)
class Hyperparameters:
    """What PPO learns with, and why.

    Numbers: mean strokes on held-out random paths after 98,304 strokes of training, `python -m agents.ablations`, which
    come to 161 with these values, but for the commands: they are from trainings over all 243. Means of three seeds,
    which differ by up to 2, so smaller differences say nothing.
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
        for name in ("num_envs", "rollout", "batch_size", "epochs", "max_episode_steps"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}.")
        if self.num_envs * self.rollout % self.batch_size:
            raise ValueError(
                f"batch_size must divide the {self.num_envs * self.rollout} strokes of a rollout of all robots, "
                f"{self.batch_size} does not."
            )
        if not (0.0 <= self.discount < 1.0 and 0.0 <= self.gae_lambda <= 1.0):
            raise ValueError("discount must be in [0, 1) and gae_lambda in [0, 1].")
        if not (self.learning_rate > 0.0 and self.clip_range > 0.0 and self.entropy >= 0.0):
            raise ValueError("learning_rate and clip_range must be positive, entropy not negative.")
        if not self.hidden or min(self.hidden) < 1:
            raise ValueError(f"hidden must be widths of at least 1, not {self.hidden}.")


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
        archive.writestr(RANDOM_STATES, _random_states())
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    part.write_bytes(buffer.getvalue())
    os.replace(part, path)


def _random_states() -> bytes:
    """The global generators of torch, numpy and Python, as an .npz file."""
    _, keys, position, has_gauss, cached_gaussian = np.random.get_state(legacy=True)  # noqa: NPY002
    version, internal, gauss_next = random.getstate()
    buffer = io.BytesIO()
    np.savez(
        buffer,
        torch=torch.get_rng_state().numpy(),
        numpy_keys=keys,
        numpy_rest=np.array([position, has_gauss, cached_gaussian]),
        python=np.array(internal, dtype=np.uint64),
        python_rest=np.array([version, np.nan if gauss_next is None else gauss_next]),
    )
    return buffer.getvalue()


def _restore_random_states(data: bytes) -> None:
    with np.load(io.BytesIO(data), allow_pickle=False) as states:
        torch.set_rng_state(torch.from_numpy(states["torch"]))
        position, has_gauss, cached_gaussian = states["numpy_rest"].tolist()
        numpy_state = ("MT19937", states["numpy_keys"], int(position), int(has_gauss), cached_gaussian)
        np.random.set_state(numpy_state)  # noqa: NPY002
        version, gauss_next = states["python_rest"].tolist()
        random.setstate((int(version), tuple(states["python"].tolist()), None if np.isnan(gauss_next) else gauss_next))


# --- loading ---------------------------------------------------------------------------------------------------------


def load(path: str | os.PathLike[str]) -> LearnedPolicy:
    """The policy in a file that `save` wrote. FileNotFoundError or ValueError, with one sentence, if there is none."""

    def read(archive: zipfile.ZipFile) -> LearnedPolicy:
        description = Description.from_json(archive.read(DESCRIPTION))
        weights = torch.load(io.BytesIO(archive.read(WEIGHTS)), map_location="cpu", weights_only=True)
        return LearnedPolicy(description, _actor(weights))

    return _read(path, read)


def resume(path: str | os.PathLike[str], env: BatchVecEnv, device: str = "cpu") -> PPO:
    """The learner in a file that `save` wrote, as it was: weights, optimiser, stroke count and random states.

    The environment's episodes begin anew, with seeds that were not used before. Unpickles Stable-Baselines3's own
    data: resume only from files you trust.
    """

    def read(archive: zipfile.ZipFile) -> tuple[Description, bytes]:
        return Description.from_json(archive.read(DESCRIPTION)), archive.read(RANDOM_STATES)

    description, random_states = _read(path, read)
    ours = describe(env, description.hidden)
    if description != ours:
        raise ValueError(f"{os.fspath(path)} was trained for {description}, not for {ours}.")
    model = PPO.load(Path(path), env=env, device=device)
    assert model.seed is not None
    env.seed(model.seed + model.num_timesteps)
    _restore_random_states(random_states)
    return model


def _read(path: str | os.PathLike[str], read: Callable[[zipfile.ZipFile], Loaded]) -> Loaded:
    if not os.path.isfile(path):
        raise FileNotFoundError(f"There is no trained policy at {os.fspath(path)}.")
    try:
        with zipfile.ZipFile(path) as archive:
            return read(archive)
    except (zipfile.BadZipFile, EOFError, zlib.error, KeyError) as damaged:
        reason = str(damaged.args[0]).rstrip(".")
        raise ValueError(f"{os.fspath(path)} is damaged, or no policy saved by this project: {reason}.") from damaged
    except (ValueError, TypeError, RuntimeError, pickle.UnpicklingError) as mismatch:
        raise ValueError(f"{os.fspath(path)} does not fit: {reason_of(mismatch)}.") from mismatch
