"""Controllers of `ObstTrap`: a goal behind discs."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from seastar_gym.controllers.greedy import turned
from seastar_gym.envs.tasks.discs import Ways, rims, ways
from seastar_gym.envs.tasks.obst_trap import (
    ARC,
    EXTENT,
    FIRST,
    LAST,
    PASSAGE,
    SEEN,
    STEP,
    Horseshoe,
    draw_horseshoe,
    draw_kind,
)
from seastar_gym.evaluation.rollout import Info
from studies.frame import Floats
from studies.tasks.ahead import Ahead, Robots
from studies.tasks.greedy import Actions, Floats32, Greedy, length

CLEAR = 0.008
"""Distance from rims below which no decision is to end [m]."""
TOO_NEAR = 1e3
"""Cost of one that does."""
SAME = 0.005
"""Discs whose centres are so near [m] are the same one."""
ALIKE = 0.025
"""Discs of an imagined horseshoe whose centres are so near to those that were seen [m] may be the same ones."""
IMAGINED = 400
"""Horseshoes among which `prior` looks for the most probable one."""

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


class Belief:
    """Belief of one robot in one of several horseshoes, by the discs that it has seen and those that it has not.

    horseshoes: Discs that may be there in the world [m], shape (n_horseshoes, 8, 3), NaN where one is missing;
    the most probable horseshoe first.
    """

    def __init__(self, horseshoes: Floats):
        self._horseshoes = horseshoes
        self._is_missing = np.zeros(horseshoes.shape[:2], bool)

    def look(self, hub: Floats, seen: Floats, known: Floats) -> Floats:
        """Discs that it believes in besides those that it knows, shape (8 or 0, 3).

        seen: The discs in sight [m], shape (6, 3): no other rim is nearer than theirs. known: All that were seen.
        """
        away = self._horseshoes[..., None, :2] - known[:, :2]
        is_known = np.hypot(away[..., 0], away[..., 1]).min(axis=-1) <= ALIKE
        in_sight = rims(hub, self._horseshoes) <= rims(hub, seen).max() - ALIKE
        self._is_missing |= in_sight & ~is_known
        told = is_known.sum(axis=1) - (is_known.shape[1] * self._is_missing).sum(axis=1)
        best = int(np.argmax(told))
        believed = self._horseshoes[best]
        return believed[~np.isnan(believed[:, 0])] if told[best] >= 0 else believed[:0]


def horseshoes_to(goal: float) -> Floats:
    """Horseshoes that the generator may draw before a goal at this distance [m], their mean first, shape (n, 8, 3)."""
    rng = np.random.default_rng(0)
    mean = Horseshoe(
        np.array([0.5 * (FIRST + goal - LAST), 0.0]), float(np.mean(ARC)), float(np.mean(EXTENT)), 0.0, 0.03
    )
    others = (draw_horseshoe(rng, goal, *draw_kind(rng)) for _ in range(IMAGINED))
    return np.stack([mean.discs, *(one.discs for one in others)])


def discs_by_the_prior() -> Known:
    """Memory of discs, and the horseshoe of the task's generator that explains best what was seen so far."""
    so_far, beliefs = discs_so_far(), list[Belief]()

    def known(robots: Robots, observations: Floats32, info: Info) -> list[Floats]:
        if not beliefs:
            goals = length(robots.targets(observations)[0])
            beliefs.extend(Belief(horseshoes_to(goal)) for goal in goals)
        hub, heading = robots.inner.simulator.hub_position(), robots.heading()
        seen = seen_discs(robots, observations)
        found = []
        for robot, discs in enumerate(so_far(robots, observations, info)):
            places = hub[robot] + turned(seen[robot, :, :2], np.full(SEEN, heading[robot]))
            sight = np.column_stack([places, seen[robot, :, 2]])
            found.append(np.concatenate([discs, beliefs[robot].look(hub[robot], sight, discs)]))
        return found

    return known
