"""Controllers that simulate nothing: greedy by a map of mean displacements, also by one that they believe in."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.evaluation.rollout import Info
from studies.frame import Floats
from studies.tasks.ahead import Odometer, Robots

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


ERROR_OF_PLACE, ERROR_OF_TURN = 0.002, 0.02
"""By how much one decision differs from the mean of many like it [m, rad], about."""


class Guess:
    """Greedy agent along waypoints that believes in one of several hypotheses on what its limbs make of commands.

    hypotheses: Factors of the commands of all limbs, shape (n_hypotheses, n_limbs).
    """

    def __init__(self, robots: Robots, hypotheses: Floats):
        self._robots, self._odometer, self._map = robots, Odometer(robots), robots.map()
        self.hypotheses = hypotheses
        self._does = np.array([robots.actions_of(robots.table * factors) for factors in hypotheses])
        self._surprise = np.zeros((robots.n, len(hypotheses)))
        self._last = np.zeros(robots.n, np.int64)

    @property
    def believed(self) -> NDArray[np.intp]:
        """Number of the hypothesis that every robot believes in."""
        return np.argmin(self._surprise, axis=1)

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        found = self._odometer.read()
        if found is not None:
            done = self._does[:, self._last].T
            missed = length(found[0][:, None] - self._map.hub[done]) / ERROR_OF_PLACE
            self._surprise += missed**2 + ((found[1][:, None] - self._map.turn[done]) / ERROR_OF_TURN) ** 2
        target, after = self._robots.targets(observations)
        self._last = np.argmin(route(self._map.hub[self._does[self.believed]], target, after), axis=1)
        return self._last
