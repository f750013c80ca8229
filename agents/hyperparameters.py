"""Hyperparameters of PPO, each with the measurement that chose it."""

import operator
from dataclasses import dataclass
from typing import Any, get_args

from seastar_gym.envs.commands import Discrete
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.scene.checks import (
    require_choice,
    require_count,
    require_finite,
    require_flag,
    require_kind,
    require_number,
    shown,
)

MOST_STROKES, MOST_WEIGHTS = 2**24, 2**26
"""Strokes of a rollout of all robots, and weights of a network: with more, memory ends before the first update."""


@dataclass(frozen=True)
class Hyperparameters:
    """Hyperparameters of PPO and of its training environment.

    Scores are mean strokes on held-out random paths after 98,304 strokes of training, where policies choose from all
    243 commands (`python -m studies.learning.ablations` at commit 9cd3be4): 174.5, and 172.6 over pairs, the default.
    They are means over three seeds that differ by up to 4 strokes, so smaller differences say nothing.
    """

    actions: Discrete = "pairs"
    """Action mode. "pairs" has one distribution over the 21 commands that heat no limb or two. "joint", over all 243,
    is as good on held-out paths, but learns later, and its seeds differ by more round the pentagon. "limbs", with one
    distribution per limb, scores 197: the fastest swim alternates between two pairs of limbs, which independent limbs
    do not find."""
    symmetry: bool = True
    """Whether waypoints are turned and mirrored into one sector, so that every stroke teaches ten directions at once.
    Without it, the score is 181."""
    num_envs: int = 128
    """Number of robots side by side. With few of them, updates are frequent: 512 robots, with batches four times as
    large, score 205. Fewer than 128 would keep the simulator's lanes and threads less busy."""
    rollout: int = 16
    """Strokes of every robot between updates: three times the horizon 1/(1 - discount)."""
    batch_size: int = 512
    """Strokes in a minibatch: a quarter of a rollout."""
    epochs: int = 6
    """Passes over a rollout in an update."""
    learning_rate: float = 1e-3
    """Learning rate at the beginning. It falls linearly to zero, so that the last policy is a settled one."""
    decision_period: float | None = None
    """Time between decisions [s]. None means a stroke, of 1 s; with another, robots have wires."""
    discount: float = 0.8
    """Discount per second, or per stroke where decisions are strokes. The effect of a stroke on the swimming is over
    after a few more: 0.5 scores no worse than 0.8. 0.95 scores 181, because noise of twenty strokes hides the value of
    one."""
    gae_lambda: float = 0.9
    """Decay of the generalised advantage estimate. With so short a horizon it matters little."""
    clip_range: float = 0.2
    """Clip range of the probability ratio, with PPO's customary value."""
    entropy: float = 0.0
    """Weight of the entropy bonus. Exploration lasts long enough without it: 0.01 scores 173."""
    hidden: tuple[int, ...] = (128, 128)
    """Widths of the hidden layers, of the policy and of the value network each. 256 gains no more than a seed (172)."""
    max_episode_time: float = 400.0
    """Time limit of a training episode [s]. A random path takes about 170."""
    coasting: bool = False
    """Whether progress is measured by where the hub would come to rest, see `agents.coasting`. Worth it where decisions
    are shorter than a stroke, with a discount of 0.3: at 0.2 s, ten seeds take 77 s round the pentagon, not 83 s."""
    reward: RewardWeights = RewardWeights()
    """Weights of the reward's terms. Progress dominates: a stroke of the best gaits earns about 1, and a heated limb
    costs 0.01."""

    def __post_init__(self) -> None:
        require_choice("actions", self.actions, get_args(Discrete))
        for name in ("num_envs", "rollout", "batch_size", "epochs"):
            require_count(name, getattr(self, name), 1, 2**31)
        require_number("max_episode_time", self.max_episode_time, "s")
        if self.decision_period is not None:
            require_number("decision_period", self.decision_period, "s")
        for name in ("learning_rate", "discount", "gae_lambda", "clip_range", "entropy"):
            require_finite(name, getattr(self, name), "1")
        require_flag("symmetry", self.symmetry)
        require_flag("coasting", self.coasting)
        require_kind("reward", self.reward, RewardWeights, "RewardWeights")
        strokes = int(self.num_envs) * int(self.rollout)
        if strokes > MOST_STROKES:
            raise ValueError(f"num_envs times rollout must be at most {MOST_STROKES:,}, not {strokes:,}.")
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
        if sum(map(operator.mul, self.hidden, (*self.hidden[1:], 1_000))) > MOST_WEIGHTS:
            raise ValueError(f"hidden must be layers of {MOST_WEIGHTS:,} weights at most, not {shown(self.hidden)}.")

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of the training environment that are known here, see `SwimOptions`."""
        return {
            "actions": self.actions,
            "decision_period": self.decision_period,
            "max_episode_steps": self.max_episode_steps,
            "reward": self.reward,
        }

    @property
    def max_episode_steps(self) -> int:
        """Time limit of a training episode [decisions]."""
        return max(1, round(self.max_episode_time / self._seconds))

    @property
    def discount_per_decision(self) -> float:
        """Discount from one decision to the next."""
        return float(self.discount**self._seconds)

    @property
    def _seconds(self) -> float:
        """Time between decisions [s]."""
        return 1.0 if self.decision_period is None else self.decision_period
