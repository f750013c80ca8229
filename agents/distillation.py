"""A policy that sees little learns from one that sees all: imitation with a privileged teacher.

Robots swim by the student's actions, and the teacher, who sees their true state, says what it would have done. The
student learns the teacher's probabilities of actions by supervised learning on all that was swum, so that it meets its
own mistakes (DAgger: Ross, Gordon and Bagnell 2011; with a privileged teacher: Lee et al. 2020).
"""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray

from agents.ppo import actor, describe
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.symmetry import Symmetry, VectorFrameStack
from seastar_gym.envs.symmetry.symmetry import inverse
from seastar_gym.scene.checks import require_count, require_kind

PAST = 8
"""Past observations that a policy with memory sees."""
ENOUGH = 98_304
"""Length of an imitation [decisions], after which more gain nothing."""
ROUND = 32
"""Decisions of every robot between two fits."""
PASSES, BATCH = 4, 1024
"""Passes over the data of a fit, and decisions of a minibatch."""
LEARNING_RATE = 1e-3
"""Learning rate of Adam at the beginning, which falls linearly to a hundredth."""


class Teacher:
    """Policy without memory that sees the true state of the robots of a batch.

    student: Symmetry of who learns from it, by the same actions.
    """

    def __init__(self, policy: LearnedPolicy, student: Symmetry):
        require_kind("policy", policy, LearnedPolicy, "a LearnedPolicy")
        about = policy.description
        if about.past or about.actions != student.actions:
            raise ValueError(f'A teacher is a policy without memory, and with actions="{student.actions}".')
        self.policy, self.student = policy, student
        self.distributions = about.distributions

    def logits(self, state: NDArray[np.float32], elements: NDArray[np.intp]) -> NDArray[np.float32]:
        """Logits of the student's actions, shape (n, *distributions).

        state: Privileged observations, shape (n, size). elements: Those by which the student sees its robots turned.
        """
        own, turned = self.policy.reduction, np.zeros(len(state), np.intp)
        if own is not None:
            state, turned = own.reduce(state)
        flat = self.policy.logits(state).reshape(len(state), -1)
        if own is not None:
            flat = own.carry_masks(flat, inverse(turned, own.group))
        return self.student.carry_masks(flat, elements).reshape(-1, *self.distributions)


def distil(
    teacher: LearnedPolicy,
    batch: VectorFrameStack,
    decisions: int,
    seed: int,
    hidden: tuple[int, ...] = (128, 128),
    on_decisions: Callable[[int], object] = lambda decisions: None,
) -> LearnedPolicy:
    """Policy that has learned from a teacher in a batch in autoreset mode SAME_STEP, which is closed then.

    decisions: Length of the training, all robots together. seed: Of the network, the exploration and the episodes.
    hidden: Widths of the hidden layers. on_decisions: Called with the number of decisions that have been learned from.
    """
    require_kind("batch", batch, VectorFrameStack, "a VectorFrameStack")
    require_count("decisions", decisions, 1, 10**8)
    inner, guide = batch.unwrapped, Teacher(teacher, batch.frame_stack.symmetry)
    if teacher.description.layout != Layout.of(inner.scene):  # type: ignore[attr-defined]
        raise ValueError("The teacher does not see what this batch's robots would show without a Sight.")
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    network = _network((batch.frame_stack.size, *hidden, math.prod(guide.distributions)))
    adam = torch.optim.Adam(network.parameters())
    rounds = max(1, decisions // (ROUND * batch.num_envs))
    seen, told = list[torch.Tensor](), list[torch.Tensor]()
    observations, _ = batch.reset(seed=seed)
    for number in range(rounds):
        for _ in range(ROUND):
            advice = guide.logits(inner.privileged_observations(), batch.elements)  # type: ignore[attr-defined]
            seen.append(torch.from_numpy(observations))
            told.append(torch.softmax(torch.from_numpy(advice), dim=-1))
            logits = advice if number == 0 else network(seen[-1]).detach().numpy().reshape(advice.shape)
            explored = logits + number % 2 * rng.gumbel(size=logits.shape)  # every other round draws its actions
            actions = np.argmax(explored, axis=-1)
            observations, *_ = batch.step(actions if guide.policy.actions == "limbs" else actions[:, 0])
        for group in adam.param_groups:
            group["lr"] = LEARNING_RATE * (1.0 - 0.99 * number / rounds)
        _fit(network, adam, torch.cat(seen), torch.cat(told))
        on_decisions(len(seen) * batch.num_envs)
    about = describe(BatchVecEnv(batch), hidden)
    batch.close()
    names = {f"mlp_extractor.policy_net.{name}": value for name, value in network[:-1].state_dict().items()}
    last = {f"action_net.{name}": value for name, value in network[-1].state_dict().items()}
    return LearnedPolicy(about, actor({**names, **last}))


def _network(widths: tuple[int, ...]) -> torch.nn.Sequential:
    """Linear layers with tanh between them."""
    layers = list[torch.nn.Module]()
    for inputs, outputs in pairwise(widths):
        layers += [torch.nn.Linear(inputs, outputs), torch.nn.Tanh()]
    return torch.nn.Sequential(*layers[:-1])


def _fit(network: torch.nn.Module, adam: torch.optim.Adam, seen: torch.Tensor, told: torch.Tensor) -> None:
    """Bring the network's probabilities nearer to those that it was told, shape (n, distributions, choices)."""
    for _ in range(PASSES):
        for rows in torch.randperm(len(seen)).split(BATCH):
            wanted = told[rows].flatten(0, 1)
            loss = torch.nn.functional.cross_entropy(network(seen[rows]).reshape(wanted.shape), wanted)
            adam.zero_grad()
            loss.backward()
            adam.step()
