"""PPO in one file, in the manner of CleanRL, on the native batch: read it from top to bottom.

    python examples/single_file_ppo.py --out policy.safetensors
    seastar evaluate --agents policy.safetensors pentagon --fidelity fast

The batch writes observations, rewards and flags straight into the learner's memory (`out=Buffers(...)`). Defaults are
the project's hyperparameters, `agents/ppo.py` has the measurements behind them.
"""

import time
from dataclasses import dataclass
from pathlib import Path

import gymnasium as gym
import numpy as np
import torch
import tyro
from torch import nn
from torch.distributions import Categorical

import seastar_gym  # noqa: F401, registers the environments
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import LearnedPolicy, save
from seastar_gym.envs.symmetry import Symmetry
from seastar_gym.envs.vector import Buffers


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
    learning_rate: float = 1e-3
    """Learning rate at the beginning; it falls linearly to zero."""
    discount: float = 0.8
    """Discount per stroke."""
    gae_lambda: float = 0.9
    """Decay of the generalised advantage estimate."""
    clip_range: float = 0.2
    """Clip range of the probability ratio."""
    hidden: int = 128
    """Width of the two hidden layers."""
    seed: int = 0
    """Seed of the network, the exploration and the paths."""
    num_threads: int | None = None
    """Threads of the simulator; by default one for every processor."""
    out: Path | None = None
    """File of the policy (.safetensors)."""


class Agent(nn.Module):
    """Policy and value network."""

    def __init__(self, size: int, n_actions: int, hidden: int):
        super().__init__()
        self.actor, self.critic = mlp(size, hidden, n_actions, 0.01), mlp(size, hidden, 1, 1.0)

    def value(self, observations: torch.Tensor) -> torch.Tensor:
        """Values, shape (n,)."""
        return self.critic(observations).squeeze(-1)

    def choices(self, observations: torch.Tensor) -> Categorical:
        """Distributions of actions."""
        return Categorical(logits=self.actor(observations), validate_args=False)


def mlp(inputs: int, hidden: int, outputs: int, gain: float) -> nn.Sequential:
    """Network with two hidden layers. gain: Of the last layer's weights."""
    layers = [nn.Linear(inputs, hidden), nn.Linear(hidden, hidden), nn.Linear(hidden, outputs)]
    for layer, scale in zip(layers, (2**0.5, 2**0.5, gain), strict=True):
        nn.init.orthogonal_(layer.weight, scale)
        nn.init.zeros_(layer.bias)
    first, second, last = layers
    return nn.Sequential(first, nn.Tanh(), second, nn.Tanh(), last)


def train(options: Options, quiet: bool = False) -> LearnedPolicy:
    """Policy after a training."""
    torch.set_num_threads(1)  # two are slower on so small a network
    torch.manual_seed(options.seed)
    envs = gym.make_vec(
        "SeastarSwim-v0", num_envs=options.num_envs, vectorization_mode="vector_entry_point", path="random",
        random_heading=True, actions="pairs", fidelity="fast", autoreset_mode="SameStep", threads=options.num_threads,
    )  # fmt: skip
    scene, n, steps = envs.scene, options.num_envs, options.rollout
    symmetry = Symmetry.of(scene, actions="pairs")
    size, n_actions = envs.single_observation_space.shape[0], int(envs.single_action_space.n)
    agent = Agent(size, n_actions, options.hidden)
    optimizer = torch.optim.Adam(agent.parameters(), lr=options.learning_rate, eps=1e-5)

    # The memory. Its rows are the buffers that the batch writes into, and torch sees the same numbers.
    observations = np.zeros((steps + 1, n, size), np.float32)
    rewards, values = np.zeros((steps, n), np.float32), torch.zeros((steps + 1, n))
    terminated, truncated = np.zeros((steps, n), bool), np.zeros((steps, n), bool)
    actions, log_probs = torch.zeros((steps, n), dtype=torch.long), torch.zeros((steps, n))

    # Symmetry: every observation is turned and mirrored until its waypoint is in one sector, and the action back.
    observations[0], elements = symmetry.reduce(envs.reset(seed=options.seed)[0])
    updates = max(1, options.strokes // (n * steps))
    began, returns, finished = time.perf_counter(), np.zeros(n), []
    for update in range(updates):
        optimizer.param_groups[0]["lr"] = options.learning_rate * (1.0 - update / updates)
        with torch.no_grad():
            for step in range(steps):
                seen = torch.from_numpy(observations[step])
                choices = agent.choices(seen)
                actions[step] = choices.sample()
                log_probs[step], values[step] = choices.log_prob(actions[step]), agent.value(seen)
                row = Buffers(observations[step + 1], rewards[step], terminated[step], truncated[step])
                *_, info = envs.step(symmetry.restore(actions[step].numpy(), elements), out=row)
                observations[step + 1], elements = symmetry.reduce(row.observations)
                returns += rewards[step]
                over = terminated[step] | truncated[step]
                finished = [*finished, *returns[over]][-100:]
                returns[over] = 0.0
                cut = np.flatnonzero(truncated[step] & ~terminated[step])
                if len(cut):  # an episode out of time would have gone on: its last state has a value
                    last, _ = symmetry.reduce(np.stack(list(info["final_obs"][cut])))
                    rewards[step, cut] += options.discount * agent.value(torch.from_numpy(last)).numpy()
            values[steps] = agent.value(torch.from_numpy(observations[steps]))
        advantages = advantages_of(rewards, terminated | truncated, values, options)
        memory = torch.from_numpy(observations[:steps]), actions, log_probs, advantages, advantages + values[:steps]
        improve(agent, optimizer, memory, options)
        observations[0] = observations[steps]
        if not quiet and (update % 8 == 7 or update == updates - 1):
            strokes, seconds = (update + 1) * n * steps, time.perf_counter() - began
            mean = f"mean return {np.mean(finished):.1f}" if finished else "no episode is over yet"
            print(f"{strokes} strokes, {strokes / seconds:.0f} per second, {mean}", flush=True)
    envs.close()
    return LearnedPolicy(Description("pairs", True, scene, (options.hidden, options.hidden)), weights_of(agent))


def advantages_of(rewards: np.ndarray, over: np.ndarray, values: torch.Tensor, options: Options) -> torch.Tensor:
    """Generalised advantage estimates of all steps, shape (steps, n)."""
    found, advantage, going_on = torch.zeros_like(values[:-1]), 0.0, torch.from_numpy(~over).float()
    for step in reversed(range(len(found))):
        following = options.discount * going_on[step]
        error = torch.from_numpy(rewards[step]) + following * values[step + 1] - values[step]
        found[step] = advantage = error + options.gae_lambda * following * advantage
    return found


def improve(agent: Agent, optimizer: torch.optim.Adam, memory: tuple[torch.Tensor, ...], options: Options) -> None:
    """Several passes over a rollout. memory: Observations, actions, their log-probabilities, advantages and targets."""
    seen, actions, log_probs, advantages, targets = (part.flatten(0, 1) for part in memory)
    for _ in range(options.epochs):
        for batch in torch.randperm(len(seen)).split(options.batch_size):
            ratio = (agent.choices(seen[batch]).log_prob(actions[batch]) - log_probs[batch]).exp()
            gain = (advantages[batch] - advantages[batch].mean()) / (advantages[batch].std() + 1e-8)
            clipped = ratio.clamp(1.0 - options.clip_range, 1.0 + options.clip_range)
            policy_loss = -torch.min(gain * ratio, gain * clipped).mean()
            value_loss = nn.functional.mse_loss(agent.value(seen[batch]), targets[batch])
            optimizer.zero_grad()
            (policy_loss + 0.5 * value_loss).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


def weights_of(agent: Agent) -> dict[str, np.ndarray]:
    """The policy as plain numbers, which `seastar` swims with numpy alone."""
    linear = [layer for layer in agent.actor if isinstance(layer, nn.Linear)]
    named = ((f"{k}.{name}", part) for k, layer in enumerate(linear) for name, part in layer.named_parameters())
    return {name: part.detach().numpy() for name, part in named}


if __name__ == "__main__":
    chosen = tyro.cli(Options, description=__doc__)
    policy = train(chosen)
    if chosen.out is not None:
        save(policy, chosen.out, strokes=chosen.strokes, seed=chosen.seed)
        print(f"Policy: {chosen.out}")
