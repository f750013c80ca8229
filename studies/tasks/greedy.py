"""Controllers that simulate nothing: at rest, and greedy by a map of mean displacements."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.evaluation.rollout import Info
from studies.tasks.ahead import Robots

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Actions = NDArray[np.int64]


def length(vectors: Floats) -> Floats:
    """Length over the last axis."""
    return np.asarray(np.hypot(vectors[..., 0], vectors[..., 1]))


class Greedy:
    """Agent that takes the action whose mean displacement ends nearest to the target, or shortens the route most."""

    def __init__(self, robots: Robots):
        self.robots, self.hub = robots, robots.map().hub

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        return np.argmin(self.cost(self.hub[None], *self.robots.targets(observations)), axis=1)

    def cost(self, ends: Floats, target: Floats, after: Floats) -> Floats:
        """Cost of ends in the body frame [m], shape (n or 1, m, 2)."""
        return length(ends - target[:, None])


def route(ends: Floats, target: Floats, after: Floats) -> Floats:
    """Length of the rewarded route [m] that is left from ends in the body frame [m], shape (n or 1, m, 2)."""
    return RewardWeights().way_to_next(ends, target[:, None], after[:, None], WAYPOINT_RADIUS)


class GreedyOnRoute(Greedy):
    """Greedy agent along waypoints."""

    cost = staticmethod(route)
