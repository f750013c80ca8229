"""Measures of tasks: a number for every episode, and whether more or less of it is better."""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np

from seastar_gym.envs.robots import Task
from seastar_gym.envs.tasks.prey import Prey
from seastar_gym.envs.tasks.prizes import Prizes
from seastar_gym.envs.tasks.station import Station
from seastar_gym.evaluation.rollout import Episodes, Floats

SETTLED = 30.0
"""Time after which distances from a station count [s]."""


class Measure(NamedTuple):
    """What the episodes of a task are measured by.

    of: Function that makes scores, shape (n_episodes,), of episodes.
    records: Entries of info that it needs, besides those that the package's own do.
    """

    name: str
    unit: str
    better: Literal["less", "more"]
    of: Callable[[Episodes], Floats]
    records: tuple[str, ...] = ()


def seconds_to_success(episodes: Episodes) -> Floats:
    """Time until the task was done [s]; the time limit where it was not."""
    return np.where(episodes.success, episodes.last("time"), episodes.limit)


def catches(episodes: Episodes) -> Floats:
    """Prey caught."""
    return episodes.last("catches").astype(float)


def mean_distance(episodes: Episodes) -> Floats:
    """Mean distance from the station [mm] once SETTLED has passed."""
    settled = np.where(episodes.of("time") > SETTLED, episodes.of("distance"), np.nan)
    return np.asarray(1000.0 * np.nanmean(settled, axis=0))


def prizes(episodes: Episodes) -> Floats:
    """Worth of the prizes taken."""
    return episodes.last("taken").astype(float)


SECONDS = Measure("time until done", "s", "less", seconds_to_success)
MEASURES: dict[type[Any], Measure] = {
    Prey: Measure("prey caught", "1", "more", catches),
    Station: Measure("mean distance", "mm", "less", mean_distance),
    Prizes: Measure("worth of prizes", "1", "more", prizes),
}
"""Measures of tasks that are not done at some time; those of one's own join them."""


def measure_of(env: Any) -> Measure:
    """Measure of the task of an environment."""
    return measure_of_task(getattr(env, "task", None))


def measure_of_task(task: Task | None) -> Measure:
    """Measure of a task; None for waypoints."""
    return MEASURES.get(type(task), SECONDS)
