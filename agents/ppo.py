"""PPO on the native batch: the training environment, the learner, and the policy that it has learned."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import torch
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.utils import LinearSchedule

from agents.coasting import with_coasting
from agents.hyperparameters import Hyperparameters
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers import checkpoint
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import LearnedPolicy, Weights
from seastar_gym.controllers.registry import task_of
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.symmetry import VectorFrameStack, VectorSymmetryReduction, observed_mirror
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.envs.waypoints import Path as SwimPath
from seastar_gym.scene.checks import require_count, require_kind, shown
from seastar_gym.scene.numerics import Fidelity


def make_training_env(
    hyperparameters: Hyperparameters,
    path: SwimPath,
    random_heading: bool,
    fidelity: Fidelity | None = None,
    threads: int | None = None,
    **options: Any,
) -> BatchVecEnv:
    """Native batch for Stable-Baselines3, with symmetry reduction if the hyperparameters ask for it.

    options: Further options of the batch, see `make_training_batch`.
    """
    env = make_training_batch(hyperparameters, path, random_heading, fidelity, threads, **options)
    if hyperparameters.coasting:
        env = with_coasting(env, hyperparameters.reward)
    return BatchVecEnv(VectorSymmetryReduction(env) if hyperparameters.symmetry else env)


def make_training_batch(
    hyperparameters: Hyperparameters,
    path: SwimPath,
    random_heading: bool,
    fidelity: Fidelity | None = None,
    threads: int | None = None,
    **options: Any,
) -> gym.vector.VectorEnv[Any, Any, Any]:
    """Native batch of a training, in autoreset mode SAME_STEP.

    options: `num_envs` and options of the environment, see `SwimOptions`; those of the hyperparameters unless named.
    """
    require_kind("hyperparameters", hyperparameters, Hyperparameters, "Hyperparameters")
    arguments = {"num_envs": hyperparameters.num_envs, **hyperparameters.options, **options}
    return gym.make_vec(
        "SeastarSwim-v0",
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
        threads=threads,
        path=path,
        random_heading=random_heading,
        fidelity=fidelity,
        waypoint_radius=WAYPOINT_RADIUS,
        **arguments,
    )


def make_model(
    env: BatchVecEnv,
    hyperparameters: Hyperparameters,
    seed: int,
    device: str = "cpu",
    tensorboard_log: str | os.PathLike[str] | None = None,
) -> PPO:
    """New learner on an environment."""
    require_kind("env", env, BatchVecEnv, "a BatchVecEnv, as make_training_env gives it")
    require_kind("hyperparameters", hyperparameters, Hyperparameters, "Hyperparameters")
    require_count("seed", seed, 0, 2**32 - 1)
    require_device(device)
    return PPO(
        "MlpPolicy",
        env,
        n_steps=hyperparameters.rollout,
        batch_size=hyperparameters.batch_size,
        n_epochs=hyperparameters.epochs,
        learning_rate=LinearSchedule(hyperparameters.learning_rate, 0.0, 1.0),
        gamma=hyperparameters.discount_per_decision,
        gae_lambda=hyperparameters.gae_lambda,
        clip_range=hyperparameters.clip_range,
        ent_coef=hyperparameters.entropy,
        policy_kwargs={"net_arch": list(hyperparameters.hidden)},
        tensorboard_log=None if tensorboard_log is None else os.fspath(tensorboard_log),
        seed=int(seed),
        device=device,
    )


def require_device(device: str) -> None:
    """ValueError for a device that is not there; Stable-Baselines3 would quietly take the processor."""
    if not isinstance(device, str) or device not in ("cpu", "cuda", "auto"):
        raise ValueError(f"device must be 'cpu', 'cuda' or 'auto', not {shown(device)}.")
    if device == "cuda" and not torch.cuda.is_available():
        raise ValueError("There is no CUDA device that torch can use: take device cpu or auto.")


def describe(env: BatchVecEnv, hidden: tuple[int, ...]) -> Description:
    """Description of a policy with these widths of hidden layers that learns in an environment."""
    batch: Any = env.env.unwrapped
    memory = next((layer for layer in env.layers() if isinstance(layer, VectorFrameStack)), None)
    symmetry = memory is not None or env.env_is_wrapped(VectorSymmetryReduction)[0]
    about = Description(batch.actions, symmetry, batch.scene, hidden, batch.decision_period)
    past = 0 if memory is None else memory.frame_stack.past
    at = batch.layout
    about = about._replace(
        past=past, entries=at.entries, shows_limbs=at.shows_limbs, stations=at.stations, sight=batch.sight,
        action_delay=batch.action_delay,
    )  # fmt: skip
    if isinstance(batch.task, AlongPath):
        return about._replace(path=batch.path if isinstance(batch.path, str) else None)
    return about._replace(task=task_of(batch), limb_mirror=observed_mirror(batch))


def policy_of(model: PPO) -> LearnedPolicy:
    """Policy that a learner on a `BatchVecEnv` has learned so far."""
    require_kind("model", model, PPO, "a PPO of Stable-Baselines3")
    env = model.get_env()
    if not isinstance(env, BatchVecEnv):
        raise ValueError(f"Only a learner on a BatchVecEnv says what its policy expects, not one on {env}.")
    description = describe(env, tuple(model.policy_kwargs["net_arch"]))
    return LearnedPolicy(description, actor(model.policy.state_dict()))


def actor(weights: Mapping[str, torch.Tensor]) -> Weights:
    """Weights of the policy in Stable-Baselines3's network, under the names of `LearnedPolicy`."""
    return checkpoint.actor({name: tensor.detach().cpu().numpy().copy() for name, tensor in weights.items()})
