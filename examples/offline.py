"""Records a Minari dataset of an agent's swims, with Minari's own collector, and clones the agent from it.

    MINARI_DATASETS_PATH=data python examples/offline.py SeastarSwim/greedy-v0 --agent greedy --episodes 20

The task is the id that the dataset is named after. A dataset that is there is not recorded again. Episodes have seeds
0, 1, ... and their infos, so each can be repeated to the last bit by `minari.load_dataset(..).recover_environment()`.
"""

import argparse
from typing import Any

import gymnasium as gym
import minari
import numpy as np
import torch
from torch import nn

import seastar_gym  # noqa: F401, registers the environments
from seastar_gym.controllers import load_agent


def record(dataset_id: str, agent: str, n_episodes: int, **arguments: Any) -> Any:
    """New dataset of an agent, named as in `seastar swim`. arguments: Of the environment, such as path and fidelity."""
    make = gym.make(f"{dataset_id.partition('/')[0]}-v0", actions="pairs", **arguments)
    policy = load_agent(agent, make.unwrapped)
    env = minari.DataCollector(make, record_infos=True)
    for seed in range(n_episodes):
        observation, _ = env.reset(seed=seed)
        state, is_first, is_over = None, True, False
        while not is_over:
            first = np.array([is_first])
            action, state = policy.predict(observation, state, first, deterministic=True)
            observation, _, terminated, truncated, _ = env.step(action)
            is_first, is_over = False, terminated or truncated
    return env.create_dataset(dataset_id, algorithm_name=agent, requirements=["seastar-gym"])


def decisions_of(dataset: Any) -> tuple[torch.Tensor, torch.Tensor]:
    """All recorded observations and the actions that followed."""
    pairs = [(one.observations[:-1], one.actions) for one in dataset.iterate_episodes()]
    seen, actions = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return torch.from_numpy(seen.astype(np.float32)), torch.from_numpy(actions.astype(np.int64))


def clone(seen: torch.Tensor, actions: torch.Tensor, updates: int, hidden: int = 128) -> nn.Module:
    """Network whose largest number is that of the recorded action (behaviour cloning)."""
    torch.set_num_threads(1)  # more are slower on so small a network
    torch.manual_seed(0)
    network = nn.Sequential(nn.Linear(seen.shape[1], hidden), nn.Tanh(), nn.Linear(hidden, int(actions.max()) + 1))
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    for _ in range(updates):
        rows = torch.randint(len(seen), (256,))
        loss = nn.functional.cross_entropy(network(seen[rows]), actions[rows])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return network


def main() -> None:
    """Record where there is no such dataset, learn, and say how often the clone does what was done."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="TASK/NAME-v0")
    parser.add_argument("--agent", default="learned", help="whose swims are recorded")
    parser.add_argument("--episodes", type=int, default=20, help="number of episodes")
    parser.add_argument("--updates", type=int, default=2000, help="gradient steps")
    options = parser.parse_args()
    if options.dataset in minari.list_local_datasets():
        dataset = minari.load_dataset(options.dataset)
    else:
        dataset = record(options.dataset, options.agent, options.episodes, fidelity="fast")
    seen, actions = decisions_of(dataset)
    network = clone(seen, actions, options.updates)
    agreed = (network(seen).argmax(1) == actions).float().mean()
    print(f"{dataset.total_episodes} episodes of {dataset.total_steps} decisions; the clone does {agreed:.0%} of them.")


if __name__ == "__main__":
    main()
