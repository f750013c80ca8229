"""Controllers of `ObstTrap`: a goal behind discs."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from seastar_gym.controllers.greedy import turned
from seastar_gym.envs.tasks.discs import Ways, rims, ways
from seastar_gym.envs.tasks.obst_trap import PASSAGE, STEP
from studies.tasks.ahead import Ahead, Robots
from studies.tasks.episodes import Info
from studies.tasks.greedy import Actions, Floats, Floats32, Greedy, length

CLEAR = 0.008
"""Distance from rims below which no decision is to end [m]."""
TOO_NEAR = 1e3
"""Cost of one that does."""
SAME = 0.005
"""Discs whose centres are so near [m] are the same one."""

Known = Callable[[Robots, Floats32, Info], list[Floats]]
"""Discs that are known of each robot in the world [m], shape (m, 3), as a function of robots, observations and info."""


def seen_discs(robots: Robots, observations: Floats32) -> Floats:
    """Discs that are seen in the body frames [m], shape (n, 6, 3)."""
    return robots.scene.robot.limb_length * robots.own(observations).reshape(robots.n, -1, 3)


def with_clearance(cost: Floats, ends: Floats, discs: Floats) -> Floats:
    """Costs, shape (n, m), of ends [m], shape (n or 1, m, 2), that no disc, shape (n, k, 3), may be near to."""
    clear = rims(ends, discs[:, None]).min(axis=-1)
    return np.where(clear < CLEAR, TOO_NEAR - clear, cost)


class ClearGreedy(Greedy):
    """Greedy agent that takes no action whose mean displacement ends near a disc that it sees."""

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        ends, cost = self.hub[None], self.cost(self.hub[None], *self.robots.targets(observations))
        return np.argmin(with_clearance(cost, ends, seen_discs(self.robots, observations)), axis=1)


class ClearPlanner:
    """Agent that simulates pairs of limbs one decision ahead, and ends near no disc that it sees.

    known: Discs around which it measures the way to the goal. None means the straight way.
    """

    def __init__(self, robots: Robots, known: Known | None = None):
        self._robots, self._known = robots, known
        self._ahead = Ahead(robots, robots.table)

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        robots = self._robots
        target, _ = robots.targets(observations)
        discs = seen_discs(robots, observations)
        hub, heading = robots.inner.simulator.hub_position(), robots.heading()
        known = [] if self._known is None else self._known(robots, observations, info)
        goals = hub + turned(target, heading)
        around = [way(found.tobytes(), *np.round(goal, 4)) for found, goal in zip(known, goals, strict=False)]

        def cost(ends: Floats, _: int) -> Floats:
            left = length(ends - target[:, None])
            if around:
                c, s = np.cos(heading)[:, None], np.sin(heading)[:, None]
                x, y = ends[..., 0], ends[..., 1]
                places = hub[:, None] + np.stack([c * x - s * y, s * x + c * y], axis=-1)
                left = np.array([one(place) for one, place in zip(around, places, strict=True)])
            return with_clearance(left, ends, discs)

        return self._ahead.best(robots.states(observations), cost).astype(np.int64)


@lru_cache(maxsize=256)
def way(discs: bytes, x: float, y: float) -> Ways:
    """Ways to a goal at (x, y) around discs."""
    return ways(np.frombuffer(discs).reshape(-1, 3), np.array([x, y]), PASSAGE, STEP)


def all_discs(robots: Robots, observations: Floats32, info: Info) -> list[Floats]:
    """All discs."""
    return list(info["discs"])


def discs_so_far() -> Known:
    """Memory of the discs that were seen so far."""
    remembered: list[Floats] = []

    def known(robots: Robots, observations: Floats32, info: Info) -> list[Floats]:
        if not remembered:
            remembered.extend(np.zeros((0, 3)) for _ in range(robots.n))
        hub, heading = robots.inner.simulator.hub_position(), robots.heading()
        for robot, discs in enumerate(seen_discs(robots, observations)):
            places = hub[robot] + turned(discs[:, :2], np.full(len(discs), heading[robot]))
            away = length(places[:, None] - remembered[robot][:, :2]).min(axis=1, initial=np.inf)
            new = np.column_stack([places, discs[:, 2]])[away > SAME]
            remembered[robot] = np.concatenate([remembered[robot], new])
        return remembered

    return known
