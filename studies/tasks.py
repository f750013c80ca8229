"""Greedy rules of the tasks, on the held-out episodes of docs/control.md, whose column "greedy" is printed."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym import TASKS
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.search import Searcher, displacement_map, waypoints_of
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.rewards import RewardWeights
from seastar_gym.envs.tasks.obst_trap import ObstTrap, rims
from seastar_gym.envs.tasks.prey import Prey
from seastar_gym.envs.tasks.prizes import Prizes
from seastar_gym.envs.tasks.station import Station
from seastar_gym.envs.waypoints import length
from seastar_gym.evaluation.benchmark import swum
from seastar_gym.evaluation.rollout import Batch, make_batch
from seastar_gym.scene.numerics import Fidelity
from studies.frame import Floats, Results, Study
from studies.pages import markdown, show

FIDELITY: Fidelity = "fast"
HELD_OUT = 64
"""Held-out episodes of the page: the first of the split "test"."""
SPEED_IN_STROKES, SPEED_IN_TIME = 0.0043, 0.0075
"""Speed at which a robot swims any way [m/s]."""
CLEAR, TOO_NEAR = 0.008, 1e3
"""Distance from rims below which no decision is to end [m], and the cost of one that does."""
Floats32 = NDArray[np.float32]


# Greedy rules


class OnRoute(Searcher):
    """Takes the action whose mean displacement leaves the shortest rewarded route."""

    def __init__(self, inner: Any):
        self.scene, self.layout, self.task = inner.scene, inner.layout, inner.task
        self.in_strokes = inner.timed is None
        self.hub = displacement_map(inner.scene, inner.actions, inner.timed).hub[None]

    def choose(self, observations: Floats32) -> NDArray[np.int64]:
        """Actions, shape (n,), for observations of shape (n, size)."""
        target, after = waypoints_of(observations, self.scene, self.layout)
        return np.argmin(self.cost(observations, target[:, None], after[:, None]), axis=1)

    def cost(self, observations: Floats32, target: Floats, after: Floats) -> Floats:
        """Cost of all actions, shape (n, n_actions). target, after: In the body frame [m], shape (n, 1, 2)."""
        return RewardWeights().way_to_next(self.hub, target, after, WAYPOINT_RADIUS)

    def own(self, observations: Floats32) -> Floats:
        """Numbers that the task shows of its own, shape (n, size)."""
        return observations[:, self.layout.further].astype(np.float64)


class Nearest(OnRoute):
    """Takes the action whose mean displacement ends nearest to the target."""

    def cost(self, observations: Floats32, target: Floats, after: Floats) -> Floats:
        return length(self.hub - target)


class Clear(OnRoute):
    """Takes the action that ends nearest to the target, and none that ends near a disc that it sees."""

    def cost(self, observations: Floats32, target: Floats, after: Floats) -> Floats:
        discs = self.scene.robot.limb_length * self.own(observations).reshape(len(observations), 1, -1, 3)
        clear = rims(self.hub, discs).min(axis=-1)
        return np.where(clear < CLEAR, TOO_NEAR - clear, length(self.hub - target))


class MostPerMetre(OnRoute):
    """Swims to the prize of most worth per metre of those that it can reach in time."""

    def cost(self, observations: Floats32, target: Floats, after: Floats) -> Floats:
        own = self.own(observations)
        seen = own[:, :-1].reshape(len(own), -1, 3)
        places, worth = self.scene.robot.limb_length * seen[..., :2], seen[..., 2]
        way = (SPEED_IN_STROKES if self.in_strokes else SPEED_IN_TIME) * self.task.seconds * own[:, -1:]
        to = np.maximum(length(places) - self.task.radius, 1e-4)
        value = np.where((worth > 0.0) & (to <= way), worth / to, worth * 1e-6 / to)
        chosen = places[np.arange(len(own)), np.argmax(value, axis=1)]
        return length(self.hub - chosen[:, None])


RULES: dict[type, type[OnRoute]] = {Prey: Nearest, Station: Nearest, ObstTrap: Clear, Prizes: MostPerMetre}
"""Rules of tasks, of others `OnRoute`."""


def greedy(batch: Batch) -> Policy:
    """Greedy rule of the task of a batch."""
    inner: Any = batch.unwrapped
    return RULES.get(type(inner.task), OnRoute)(inner)


def held_out(id: str, n: int = HELD_OUT) -> float:
    """Mean measure of the greedy rule over the first held-out episodes of a task."""
    batch = make_batch(id, n, split="test", fidelity=FIDELITY)
    return float(np.mean(swum(batch, greedy(batch))["measure"]))


def run(results: Results) -> None:
    """Measure the greedy rules; prints the column of the page."""
    show(markdown(["task", "greedy"], [[id, f"{held_out(id):.3g}"] for id in TASKS]))


STUDY = Study("tasks", run, out=Path("runs/tasks"))
