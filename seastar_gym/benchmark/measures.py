"""Measures of tasks: a number for every episode, and whether more or less of it is better."""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np

from seastar_gym.benchmark.episodes import Episodes, Floats
from seastar_gym.envs.tasks.prey import Prey
from seastar_gym.envs.tasks.prizes import Prizes
from seastar_gym.envs.tasks.station import Station


class Measure(NamedTuple):
    """What the episodes of a task are measured by.

    of: Function that makes scores, shape (n_episodes,), of episodes.
    """

    name: str
    unit: str
    better: Literal["less", "more"]
    of: Callable[[Episodes], Floats]


def seconds_to_success(episodes: Episodes) -> Floats:
    """Time until the task was done [s]; the time limit where it was not."""
    return np.where(episodes.success, episodes.last("time"), episodes.limit)


def catches(episodes: Episodes) -> Floats:
    """Prey caught."""
    return episodes.last("catches")


def mean_distance(episodes: Episodes) -> Floats:
    """Mean distance from the station [mm] once 30 s have passed."""
    settled = np.where(episodes.of("time") > 30.0, episodes.of("distance"), np.nan)
    return np.asarray(1000.0 * np.nanmean(settled, axis=0))


def prizes(episodes: Episodes) -> Floats:
    """Worth of the prizes taken."""
    return episodes.last("taken")


SECONDS = Measure("time until done", "s", "less", seconds_to_success)
MEASURES: dict[type[Any], Measure] = {
    Prey: Measure("prey caught", "1", "more", catches),
    Station: Measure("mean distance", "mm", "less", mean_distance),
    Prizes: Measure("worth of prizes", "1", "more", prizes),
}
"""Measures of challenges that are not done at some time."""


def measure_of(env: Any) -> Measure:
    """Measure of the task of an environment."""
    return MEASURES.get(type(getattr(env, "challenge", None)), SECONDS)
