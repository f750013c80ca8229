"""PPO of TorchRL on the native batch.

    python examples/torchrl_ppo.py

TorchRL resets robots itself, so the batch has the autoreset mode DISABLED; `GymWrapper` then asks for resets of those
whose episode is over, all in one call.
"""

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import torch
import tyro
from gymnasium.vector import AutoresetMode
from tensordict.nn import TensorDictModule
from torch.distributions import Categorical
from torchrl.collectors import Collector
from torchrl.envs import GymWrapper
from torchrl.modules import MLP, ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

import seastar_gym  # noqa: F401, registers the environments


@dataclass(frozen=True)
class Options:
    """PPO on random paths, with strokes of 1 s."""

    strokes: int = 98_304
    """Length of the training [strokes], all robots together."""
    num_envs: int = 128
    """Robots side by side."""
    rollout: int = 16
    """Strokes of every robot between updates."""
    batch_size: int = 512
    """Strokes in a minibatch."""
    epochs: int = 6
    """Passes over a rollout in an update."""
    max_episode_steps: int = 400
    """Time limit of an episode [strokes]."""
    seed: int = 0
    """Seed of the network, the exploration and the paths."""


def make_env(options: Options) -> Any:
    """The native batch as an environment of TorchRL."""
    batch = gym.make_vec(
        "SeastarSwim-v0",
        num_envs=options.num_envs,
        vectorization_mode="vector_entry_point",
        path="random",
        random_heading=True,
        actions="pairs",
        fidelity="fast",
        max_episode_steps=options.max_episode_steps,
        autoreset_mode=AutoresetMode.DISABLED,
    )
    return GymWrapper(batch, categorical_action_encoding=True)


def train(options: Options) -> tuple[Any, list[float]]:
    """Policy, and mean reward of every rollout."""
    torch.set_num_threads(1)
    torch.manual_seed(options.seed)
    env = make_env(options)
    env.set_seed(options.seed)
    n_actions = int(env.action_spec.space.n)
    actor = ProbabilisticActor(
        TensorDictModule(
            MLP(out_features=n_actions, num_cells=[128, 128], activation_class=torch.nn.Tanh),
            in_keys=["observation"],
            out_keys=["logits"],
        ),
        in_keys=["logits"],
        distribution_class=Categorical,
        return_log_prob=True,
    )
    critic = ValueOperator(
        MLP(out_features=1, num_cells=[128, 128], activation_class=torch.nn.Tanh), in_keys=["observation"]
    )
    first = env.reset()
    actor(first), critic(first)  # the sizes of the networks' inputs are those of the first observation
    advantage = GAE(gamma=0.8, lmbda=0.9, value_network=critic)
    loss_of = ClipPPOLoss(actor, critic, clip_epsilon=0.2, entropy_bonus=False, normalize_advantage=True)
    optimizer = torch.optim.Adam(loss_of.parameters(), lr=1e-3)
    frames = options.num_envs * options.rollout
    collector = Collector(
        env,
        actor,
        frames_per_batch=frames,
        total_frames=max(options.strokes, frames),
        auto_register_policy_transforms=False,  # the policy has no memory to be reset
    )
    rewards = []
    for rollout in collector:
        with torch.no_grad():
            advantage(rollout)
        flat = rollout.reshape(-1)
        for _ in range(options.epochs):
            for batch in torch.randperm(len(flat)).split(options.batch_size):
                losses = loss_of(flat[batch])
                optimizer.zero_grad()
                (losses["loss_objective"] + losses["loss_critic"]).backward()
                torch.nn.utils.clip_grad_norm_(loss_of.parameters(), 0.5)
                optimizer.step()
        rewards.append(float(rollout["next", "reward"].mean()))
    collector.shutdown()
    return actor, rewards


if __name__ == "__main__":
    _, found = train(tyro.cli(Options, description=__doc__))
    print(f"Mean reward of a stroke: {found[0]:.3f} in the first rollout, {found[-1]:.3f} in the last.")
