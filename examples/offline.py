"""Behaviour cloning, and conservative Q-learning (CQL, Kumar et al. 2020), on a Minari dataset.

    seastar data --tasks SeastarSwim-v0 --agents greedy --random-paths --fidelity fast --out data
    MINARI_DATASETS_PATH=data python examples/offline.py SeastarSwim/greedy-v0 --learner cql

Both learn a number for every action from what was recorded, without a simulator: cloning the logits of the recorded
actions, CQL their values. CQL is a deep Q-learner that also lowers the values of actions that were not taken.
"""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

import minari
import numpy as np
import torch
import tyro
from torch import nn


@dataclass(frozen=True)
class Options:
    """Learn from a dataset, then swim."""

    dataset: Annotated[str, tyro.conf.Positional]
    """Id of the dataset."""
    learner: Literal["cloning", "cql"] = "cloning"
    """Whose algorithm."""
    updates: int = 5_000
    """Gradient steps."""
    batch_size: int = 256
    """Decisions in a gradient step."""
    learning_rate: float = 1e-3
    """Learning rate."""
    hidden: int = 128
    """Width of the two hidden layers."""
    discount: float = 0.8
    """Discount per decision, of CQL."""
    conservatism: float = 1.0
    """Weight of the conservative term, of CQL."""
    episodes: int = 10
    """Episodes that are swum at the end."""
    seed: int = 0
    """Seed of the network and of the batches."""


class Decisions(NamedTuple):
    """All recorded decisions: what was seen, done, earned and seen then, and whether the episode could go on."""

    seen: torch.Tensor
    actions: torch.Tensor
    rewards: torch.Tensor
    after: torch.Tensor
    going_on: torch.Tensor


def decisions_of(dataset: Any) -> Decisions:
    """Decisions of a dataset with one discrete action."""
    parts = [
        (one.observations[:-1], one.actions, one.rewards, one.observations[1:], ~one.terminations)
        for one in dataset.iterate_episodes()
    ]
    seen, actions, rewards, after, going_on = (np.concatenate(part) for part in zip(*parts, strict=True))
    floats = (torch.from_numpy(part.astype(np.float32)) for part in (seen, rewards, after, going_on))
    seen, rewards, after, going_on = floats
    return Decisions(seen, torch.from_numpy(actions.astype(np.int64)), rewards, after, going_on)


def network_for(data: Decisions, n_actions: int, hidden: int) -> nn.Sequential:
    """Network with a number for every action; it scales what it sees as the data are."""
    scale = Scale(data.seen.mean(0), data.seen.std(0) + 1e-6)
    inputs = data.seen.shape[1]
    layers = [nn.Linear(inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(), nn.Linear(hidden, n_actions)]
    return nn.Sequential(scale, *layers)


class Scale(nn.Module):
    """Numbers less their mean, over their standard deviation."""

    def __init__(self, mean: torch.Tensor, deviation: torch.Tensor):
        super().__init__()
        self.register_buffer("mean", mean)
        self.register_buffer("deviation", deviation)

    def forward(self, numbers: torch.Tensor) -> torch.Tensor:
        """Scaled numbers."""
        return (numbers - self.mean) / self.deviation


def cloning_loss(network: nn.Module, target: nn.Module, batch: Decisions, options: Options) -> torch.Tensor:
    """Cross entropy of the recorded actions."""
    return nn.functional.cross_entropy(network(batch.seen), batch.actions)


def cql_loss(network: nn.Module, target: nn.Module, batch: Decisions, options: Options) -> torch.Tensor:
    """Temporal difference error of double Q-learning, and by how much values stand above those of recorded actions."""
    values = network(batch.seen)
    of_actions = values.gather(1, batch.actions[:, None])[:, 0]
    with torch.no_grad():
        best = network(batch.after).argmax(1, keepdim=True)
        later = target(batch.after).gather(1, best)[:, 0]
        wanted = batch.rewards + options.discount * batch.going_on * later
    gap = (values.logsumexp(1) - of_actions).mean()
    return nn.functional.smooth_l1_loss(of_actions, wanted) + options.conservatism * gap


LOSSES = {"cloning": cloning_loss, "cql": cql_loss}


def learn(data: Decisions, n_actions: int, options: Options) -> tuple[nn.Module, list[float]]:
    """Network that has learned, and the loss of every update."""
    torch.set_num_threads(1)
    torch.manual_seed(options.seed)
    network, target = (network_for(data, n_actions, options.hidden) for _ in range(2))
    target.load_state_dict(network.state_dict())
    optimizer = torch.optim.Adam(network.parameters(), lr=options.learning_rate)
    losses = []
    for _ in range(options.updates):
        rows = torch.randint(len(data.seen), (options.batch_size,))
        loss = LOSSES[options.learner](network, target, Decisions(*(part[rows] for part in data)), options)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        with torch.no_grad():
            for slow, fast in zip(target.parameters(), network.parameters(), strict=True):
                slow.lerp_(fast, 0.005)
        losses.append(float(loss.detach()))
    return network, losses


def returns_of(network: nn.Module, env: Any, n_episodes: int, seed: int = 1000) -> list[float]:
    """Returns of episodes in which the action with the largest number is taken."""
    found = []
    for episode in range(n_episodes):
        observation, _ = env.reset(seed=seed + episode)
        over, total = False, 0.0
        while not over:
            with torch.no_grad():
                action = int(network(torch.from_numpy(observation)[None]).argmax())
            observation, reward, terminated, truncated, _ = env.step(action)
            over, total = terminated or truncated, total + float(reward)
        found.append(total)
    return found


if __name__ == "__main__":
    chosen = tyro.cli(Options, description=__doc__)
    dataset = minari.load_dataset(chosen.dataset)
    data, env = decisions_of(dataset), dataset.recover_environment()
    network, losses = learn(data, int(env.action_space.n), chosen)
    recorded = np.mean([one.rewards.sum() for one in dataset.iterate_episodes()])
    swum = np.mean(returns_of(network, env, chosen.episodes)) if chosen.episodes else float("nan")
    print(f"Loss {losses[0]:.3f} at first, {losses[-1]:.3f} at last.")
    print(f"Mean return {swum:.1f}; of the dataset {recorded:.1f}.")
