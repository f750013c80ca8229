"""The reward: a sum of named terms."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import require_number
from seastar_gym.scene.serial import register_part


@register_part
@dataclass(frozen=True)
class RewardWeights:
    """Weights of the reward's terms, none negative.

    progress: Per metre by which the way to go, through the circle of the current waypoint, became shorter [1/m]; one
        stroke of the best gaits, about 5 mm, earns about 1.
    waypoint: Per waypoint reached.
    effort: Price of every heated limb and stroke.
    """

    progress: float = 200.0
    waypoint: float = 1.0
    effort: float = 0.01

    def __post_init__(self) -> None:
        for weight in fields(self):
            require_number(f"RewardWeights.{weight.name}", getattr(self, weight.name), "1", zero_allowed=True)


def reward_terms(
    weights: RewardWeights,
    progress: NDArray[np.float64],
    waypoints_reached: NDArray[np.int64],
    limbs_heated: NDArray[np.int64],
) -> dict[str, NDArray[np.float64]]:
    """The terms by name, each of shape (n_robots,); `progress` in [m]."""
    return {
        "reward_progress": weights.progress * progress,
        "reward_waypoint": weights.waypoint * waypoints_reached.astype(np.float64),
        "reward_effort": -weights.effort * limbs_heated.astype(np.float64),
    }
