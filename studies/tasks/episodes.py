"""Held-out episodes of a task, swum by an agent, and the task's measure of them."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.numerics import Fidelity

Floats = NDArray[np.float64]
Batch = gym.vector.VectorEnv[Any, Any, Any]
Wrap = Callable[[Batch], Batch]
"""What a learner puts around a batch."""
Info = dict[str, Any]


class Agent(Protocol):
    """Whoever chooses the actions of a batch."""

    def act(self, observations: NDArray[np.float32], info: Info) -> NDArray[np.int64]:
        """Actions of all robots. info: That of the batch, for those who may know it."""


class Episodes(NamedTuple):
    """Episodes side by side: info of every decision, shape (n_decisions, n_episodes), NaN after an episode's end."""

    time: Floats
    """Time since the beginning [s]."""
    distance: Floats
    """Entry `distance` of info [m]."""
    catches: Floats
    """Entry `catches` of info; 0 in tasks without."""
    taken: Floats
    """Entry `taken` of info; 0 in tasks without."""
    success: NDArray[np.bool_]
    """Whether each episode ended with success, shape (n_episodes,)."""
    returns: Floats
    """Sum of rewards, shape (n_episodes,)."""
    limit: float
    """Time limit [s]."""


def make_batch(id: str, n: int, split: str | None, fidelity: Fidelity, threads: int | None, **arguments: Any) -> Batch:
    """Native batch of a task. split: None where it has none."""
    arguments |= {} if split is None else {"split": split}
    return gym.make_vec(id, n, vectorization_mode="vector_entry_point", fidelity=fidelity, threads=threads, **arguments)


def swim(
    id: str,
    make_agent: Callable[[Batch], Agent],
    n_episodes: int,
    fidelity: Fidelity,
    threads: int | None = None,
    wrap: Wrap = lambda batch: batch,
) -> Episodes:
    """The first episodes of the split "test", each to its end."""
    batch = wrap(make_batch(id, n_episodes, "test", fidelity, threads))
    agent = make_agent(batch)
    return swim_to_the_end(batch, agent, *batch.reset(seed=0, options={"instance": np.arange(n_episodes)}))


def swim_to_the_end(batch: Batch, agent: Agent, observations: NDArray[np.float32], info: Info) -> Episodes:
    """Episodes of a batch from their first observations and info, each to its end; closes the batch."""
    inner: Any = batch.unwrapped
    n_episodes = batch.num_envs
    over, success, returns = np.zeros(n_episodes, bool), np.zeros(n_episodes, bool), np.zeros(n_episodes)
    history: dict[str, list[Floats]] = {name: [] for name in RECORDED}
    for _ in range(inner.max_episode_steps):
        observations, rewards, terminated, truncated, info = batch.step(agent.act(observations, info))
        returns += np.where(over, 0.0, rewards)
        for name, values in history.items():
            values.append(np.where(over, np.nan, info.get(name, np.zeros(n_episodes))))
        success |= ~over & (terminated | truncated) & info["is_success"]
        over |= terminated | truncated
        if over.all():
            break
    batch.close()
    arrays = {name: np.array(values) for name, values in history.items()}
    return Episodes(**arrays, success=success, returns=returns, limit=inner.max_episode_steps * inner.decision_period)


def measure(task: str, episodes: Episodes) -> Floats:
    """The task's measure of every episode, shape (n_episodes,)."""
    return MEASURES[task](episodes)


def _seconds(episodes: Episodes) -> Floats:
    """Seconds to the last waypoint, the time limit for robots that do not arrive."""
    return np.where(episodes.success, np.nanmax(episodes.time, axis=0), episodes.limit)


def _catches(episodes: Episodes) -> Floats:
    """Prey caught."""
    return np.asarray(np.nanmax(episodes.catches, axis=0))


def _worth(episodes: Episodes) -> Floats:
    """Worth of the prizes taken."""
    return np.asarray(np.nanmax(episodes.taken, axis=0))


def _millimetres(episodes: Episodes) -> Floats:
    """Mean distance from the station once the robot is there [mm]."""
    settled = np.where(episodes.time > SETTLED, episodes.distance, np.nan)
    return np.asarray(1000.0 * np.nanmean(settled, axis=0))


RECORDED = ("time", "distance", "catches", "taken")
SETTLED = 30.0
"""Time after which distances from a station count [s]."""
MEASURES: dict[str, Callable[[Episodes], Floats]] = {
    "miswired": _seconds,
    "prey": _catches,
    "fast-prey": _catches,
    "station": _millimetres,
    "fail-blind": _seconds,
    "obst-trap": _seconds,
    "prizes": _worth,
    "fast-prizes": _worth,
    "heading": _seconds,
}
"""Measures by the name of the challenge; more is better for prey and prizes, less for the others."""
