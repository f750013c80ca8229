"""Gradients of swims in PyTorch: commands with which the hub ends as far from its start as it can.

    python examples/torch_gradients.py

`Swim` is a function like any other of PyTorch's: what its commands depend on, such as the weights of a network, gets
its gradient, too.
"""

from typing import Any

import torch

from seastar_gym import Scene
from seastar_gym.gradients import record


class Swim(torch.autograd.Function):
    """From commands, shape (n, n_limbs), to positions of the hub [m], shape (n + 1, 2)."""

    @staticmethod
    def forward(ctx: Any, commands: torch.Tensor, scene: Scene) -> torch.Tensor:
        ctx.record = record(scene, commands.detach().numpy())
        return torch.from_numpy(ctx.record.swim.hub.copy())

    @staticmethod
    def backward(ctx: Any, *slopes: torch.Tensor) -> tuple[torch.Tensor, None]:
        found = ctx.record.gradient({"hub": slopes[0].numpy()}, ["commands"])
        return torch.from_numpy(found["commands"]), None


def swim_far(scene: Scene, strokes: int = 3, steps: int = 20, seed: int = 0) -> list[float]:
    """Distances that are swum [mm], from random small commands to those after the last step of Adam."""
    torch.manual_seed(seed)
    free = (0.3 * torch.randn(strokes, scene.robot.n_limbs, dtype=torch.float64)).requires_grad_()
    optimizer, distances = torch.optim.Adam([free], lr=0.1), []
    for _ in range(steps):
        hub = Swim.apply(torch.tanh(free), scene)
        distance = (hub[-1] - hub[0]).norm()
        optimizer.zero_grad()
        (-distance).backward()
        optimizer.step()
        distances.append(1e3 * distance.item())
    return distances


if __name__ == "__main__":
    print(" ".join(f"{distance:.2f}" for distance in swim_far(Scene())), "mm")
