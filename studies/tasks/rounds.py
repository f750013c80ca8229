"""Controllers of `Prizes`: which prize to swim to next."""

import numpy as np

from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.tasks.prizes import Prizes
from seastar_gym.envs.tasks.rounds import best_round, distances
from seastar_gym.evaluation.rollout import Info
from studies.frame import Floats
from studies.tasks.ahead import Ahead, Robots
from studies.tasks.greedy import Actions, Floats32, Greedy, length


class MostPerMetre(Greedy):
    """Greedy agent that swims to the prize of most worth per metre of those that it can reach in time."""

    def __init__(self, robots: Robots):
        super().__init__(robots)
        self.config: Prizes = robots.inner.challenge
        self._speed = robots.speed

    def prizes(self, observations: Floats32) -> tuple[Floats, Floats, Floats]:
        """Places of prizes in the body frames [m], shape (n, 10, 2), their worth, and the ways that are left [m]."""
        own = self.robots.own(observations)
        seen = own[:, :-1].reshape(self.robots.n, -1, 3)
        places = self.robots.scene.robot.limb_length * seen[..., :2]
        return places, seen[..., 2], self._speed * self.config.seconds * own[:, -1]

    def chosen(self, observations: Floats32) -> Floats:
        """Places of the chosen prizes in the body frames [m], shape (n, 2)."""
        places, worth, way = self.prizes(observations)
        to = np.maximum(length(places) - self.config.radius, 1e-4)
        value = np.where((worth > 0.0) & (to <= way[:, None]), worth / to, worth * 1e-6 / to)
        return places[np.arange(self.robots.n), np.argmax(value, axis=1)]

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        chosen = self.chosen(observations)
        return np.argmin(self.cost(self.hub[None], chosen, chosen), axis=1)


class PlannedMostPerMetre(MostPerMetre):
    """Agent that chooses likewise, and simulates pairs of limbs one decision ahead to get there."""

    def __init__(self, robots: Robots):
        super().__init__(robots)
        self._ahead = Ahead(robots, robots.table)

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        chosen = self.chosen(observations)
        best = self._ahead.best(self.robots.states(observations), lambda hub, _: length(hub - chosen[:, None]))
        return best.astype(np.int64)


class BestRound(MostPerMetre):
    """Agent that plans the best round through the prizes that are left, and simulates pairs of limbs to follow it."""

    def __init__(self, robots: Robots):
        super().__init__(robots)
        self._ahead = Ahead(robots, robots.table, depth=2, beam=6)

    def act(self, observations: Floats32, info: Info) -> Actions:
        """Actions of all robots."""
        first, second = self._round(observations)

        def cost(hub: Floats, _: int) -> Floats:
            return RewardWeights().way_to_next(hub, first[:, None], second[:, None], self.config.radius)

        return self._ahead.best(self.robots.states(observations), cost).astype(np.int64)

    def _round(self, observations: Floats32) -> tuple[Floats, Floats]:
        """First and second prizes of the rounds in the body frames [m], (n, 2) each; else the nearest."""
        places, worth, ways = self.prizes(observations)
        chosen = np.repeat(places[:, :1], 2, axis=1)
        for robot in range(self.robots.n):
            is_left = worth[robot] > 0.0
            there, left = places[robot, is_left], worth[robot, is_left]
            if len(left) == 0:
                continue
            first, between = (np.maximum(0.0, to - self.config.radius) for to in (length(there), distances(there)))
            order = best_round(first, between, left, float(ways[robot])).order or [0]
            chosen[robot] = there[(order * 2)[:2]]
        return chosen[:, 0], chosen[:, 1]
