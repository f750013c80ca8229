"""The reward: a sum of named terms, and the route along which progress counts."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.paths import shortest_way
from seastar_gym.scene.checks import require_number
from seastar_gym.scene.serial import register_part


@register_part
@dataclass(frozen=True)
class RewardWeights:
    """Weights of the reward's terms, none negative, and `aim`, the shape of the rewarded route.

    progress: Reward per metre by which the rewarded route to the last waypoint became shorter [1/m].
    waypoint: Reward per waypoint reached.
    effort: Price of heating one limb in one stroke.
    aim: Distance from a waypoint's centre, as a fraction of its radius, at which the rewarded route passes it, 0 to 1.
    """

    progress: float = 200.0
    """Reward per metre by which the rewarded route to the last waypoint became shorter [1/m]. One stroke of the best
    gaits, about 5 mm, earns about 1."""
    waypoint: float = 1.0
    """Reward per waypoint reached."""
    effort: float = 0.01
    """Price of heating one limb in one stroke."""
    aim: float = 0.7
    """Distance from a waypoint's centre, as a fraction of its radius, at which the rewarded route passes it, 0 to 1. A
    route at 1 only touches the circle, so that no stroke need ever end within it."""

    def __post_init__(self) -> None:
        for weight in fields(self):
            require_number(f"RewardWeights.{weight.name}", getattr(self, weight.name), "1", zero_allowed=True)
        if self.aim > 1.0:
            raise ValueError(f"RewardWeights.aim must be at most 1, the waypoint's radius, not {self.aim!r}.")

    def way_to_next(
        self, hub: ArrayLike, current: ArrayLike, following: ArrayLike, waypoint_radius: float
    ) -> NDArray[np.float64]:
        """Length [m], shape (...), of the rewarded route from the hub past the current waypoint to the following one.

        hub, current, following: Positions [m], shape (..., 2), in any one frame. On the last leg `following` equals
        `current`, as in an observation, and the route ends in its centre. waypoint_radius: [m].
        """
        return shortest_way(hub, current, following, self.aim * waypoint_radius)


def reward_terms(
    weights: RewardWeights,
    progress: NDArray[np.float64],
    waypoints_reached: NDArray[np.int64],
    limbs_heated: NDArray[np.int64],
) -> dict[str, NDArray[np.float64]]:
    """Terms of the reward by their names in `info`, each of shape (n_robots,).

    progress: Decrease of the way to go [m]. waypoints_reached, limbs_heated: Counts of this stroke. Shapes (n_robots,).
    """
    return {
        "reward_progress": weights.progress * progress,
        "reward_waypoint": weights.waypoint * waypoints_reached.astype(np.float64),
        "reward_effort": -weights.effort * limbs_heated.astype(np.float64),
    }
