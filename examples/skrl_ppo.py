"""PPO of skrl on the native batch.

    python examples/skrl_ppo.py

skrl takes the observation that a step returns for that of the next stroke, so the batch has the autoreset mode
SAME_STEP.
"""

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import torch
import tyro
from gymnasium.vector import AutoresetMode
from skrl.agents.torch.ppo import PPO
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import CategoricalMixin, DeterministicMixin, Model
from skrl.trainers.torch import SequentialTrainer
from skrl.utils import set_seed
from torch import nn

import seastar_gym  # noqa: F401, registers the environments
from seastar_gym.envs.symmetry import VectorSymmetryReduction


@dataclass(frozen=True)
class Options:
    """PPO on random paths, with strokes of 1 s."""

    strokes: int = 98_304
    """Length of the training [strokes], all robots together."""
    num_envs: int = 128
    """Robots side by side."""
    rollout: int = 16
    """Strokes of every robot between updates."""
    mini_batches: int = 4
    """Minibatches of a rollout."""
    epochs: int = 6
    """Passes over a rollout in an update."""
    max_episode_steps: int = 400
    """Time limit of an episode [strokes]."""
    seed: int = 0
    """Seed of the network, the exploration and the paths."""


class Policy(CategoricalMixin, Model):
    """Distribution of the actions."""

    def __init__(self, **spaces: Any):
        Model.__init__(self, **spaces)
        CategoricalMixin.__init__(self)
        self.net = mlp(self.num_observations, self.num_actions)

    def compute(self, inputs: dict[str, Any], role: str) -> tuple[torch.Tensor, dict[str, Any]]:
        """Logits."""
        return self.net(inputs["observations"]), {}


class Value(DeterministicMixin, Model):
    """Values."""

    def __init__(self, **spaces: Any):
        Model.__init__(self, **spaces)
        DeterministicMixin.__init__(self)
        self.net = mlp(self.num_observations, 1)

    def compute(self, inputs: dict[str, Any], role: str) -> tuple[torch.Tensor, dict[str, Any]]:
        """Values."""
        return self.net(inputs["observations"]), {}


def mlp(inputs: int, outputs: int) -> nn.Sequential:
    """Network with two hidden layers."""
    return nn.Sequential(nn.Linear(inputs, 128), nn.Tanh(), nn.Linear(128, 128), nn.Tanh(), nn.Linear(128, outputs))


def train(options: Options) -> tuple[PPO, list[float]]:
    """Agent, and mean reward of every stroke of the batch."""
    torch.set_num_threads(1)
    set_seed(options.seed)
    batch = VectorSymmetryReduction(
        gym.make_vec(
            "SeastarSwim-v0",
            num_envs=options.num_envs,
            vectorization_mode="vector_entry_point",
            path="random",
            random_heading=True,
            actions="pairs",
            fidelity="fast",
            max_episode_steps=options.max_episode_steps,
            autoreset_mode=AutoresetMode.SAME_STEP,
        )
    )
    env = wrap_env(batch, wrapper="gymnasium", verbose=False)
    spaces = {"observation_space": env.observation_space, "action_space": env.action_space, "device": env.device}
    rewards: list[float] = []

    def watched(of_robots: torch.Tensor, timestep: int, timesteps: int) -> torch.Tensor:
        """Rewards as they are; their mean is kept."""
        rewards.append(float(of_robots.mean()))
        return of_robots

    agent = PPO(
        models={"policy": Policy(**spaces), "value": Value(**spaces)},
        memory=RandomMemory(memory_size=options.rollout, num_envs=options.num_envs, device=env.device),
        cfg={
            "rollouts": options.rollout,
            "mini_batches": options.mini_batches,
            "learning_epochs": options.epochs,
            "discount_factor": 0.8,
            "gae_lambda": 0.9,
            "learning_rate": 1e-3,
            "value_loss_scale": 0.5,
            "value_clip": 0.0,
            "rewards_shaper": watched,
            "experiment": {"write_interval": 0, "checkpoint_interval": 0},
        },
        **spaces,
    )
    steps = max(options.rollout, options.strokes // options.num_envs)
    settings = {"timesteps": steps, "headless": True, "disable_progressbar": True, "close_environment_at_exit": False}
    trainer = SequentialTrainer(env=env, agents=agent, cfg=settings)
    trainer.train()
    env.close()
    return agent, rewards


if __name__ == "__main__":
    _, found = train(tyro.cli(Options, description=__doc__))
    tenth = max(1, len(found) // 10)
    print(f"Mean reward of a stroke: {np.mean(found[:tenth]):.3f} at first, {np.mean(found[-tenth:]):.3f} at last.")
