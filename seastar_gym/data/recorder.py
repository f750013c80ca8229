"""Wrapper that keeps what a batch does, as Minari's `DataCollector` does for one environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.vector import checked_seeds
from seastar_gym.evaluation.rollout import require_next_step
from seastar_gym.scene.checks import require_kind

if TYPE_CHECKING:
    _VectorWrapper = gym.vector.VectorWrapper[Any, Any, Any, Any, Any]
else:
    _VectorWrapper = gym.vector.VectorWrapper


class Episode(NamedTuple):
    """One episode of n decisions.

    seed: Seed of its reset, None for those that followed by themselves. observations: Shape (n + 1, size), the first
    and the last one among them. actions: Shape (n, ...). rewards, terminated, truncated: Shape (n,). infos: Entries of
    info by name, shape (n + 1, ...), those of the reset first.
    """

    seed: int | None
    observations: NDArray[np.float32]
    actions: NDArray[Any]
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    infos: dict[str, NDArray[Any]]


class Recorder(_VectorWrapper):
    """Wrapper of a native batch in autoreset mode NEXT_STEP that keeps every decision of every robot, with its info.

    It belongs right around the batch, so that observations and actions are the environment's own, whatever a learner
    wraps around it. A reset begins new episodes, and what was not finished before is not kept.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any]):
        require_kind("env", env, gym.vector.VectorEnv, "a batch, as gym.make_vec gives it")
        super().__init__(env)
        require_next_step("A recorder", env)
        self._rows: list[tuple[Any, ...]] = []  # what one step returned, and its actions
        self._infos: list[dict[str, NDArray[Any]]] = []
        self._begin = np.zeros(env.num_envs, np.int64)  # row of the first observation of the present episode
        self._begins_next = np.zeros(env.num_envs, bool)
        self._seeds: list[int | None] = [None] * env.num_envs
        self._spans: list[tuple[int, int, int, int | None]] = []  # robot, first and last row, and seed

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes of all robots."""
        if isinstance(options, Mapping) and "reset_mask" in options:
            raise ValueError("A recorder begins episodes of all robots: leave reset_mask out.")
        observations, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        self._seeds = checked_seeds(seed, self.num_envs)
        self._begin[:] = len(self._rows)
        self._begins_next[:] = False
        self._keep((observations, None, None, None, None), info)
        return observations, info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One decision of every robot."""
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        for robot in np.flatnonzero(self._begins_next).tolist():
            self._begin[robot], self._seeds[robot] = len(self._rows), None
        self._keep((observations, np.array(actions), rewards, terminated, truncated), info)
        self._begins_next = terminated | truncated
        for robot in np.flatnonzero(self._begins_next).tolist():
            self._spans.append((robot, int(self._begin[robot]), len(self._rows) - 1, self._seeds[robot]))
        return observations, rewards, terminated, truncated, info

    def _keep(self, row: tuple[Any, ...], info: dict[str, Any]) -> None:
        self._rows.append(row)
        self._infos.append({name: values for name, values in info.items() if not name.startswith("_")})

    def episodes(self, only_first: bool = False) -> list[Episode]:
        """Episodes that are finished, in the order in which they ended.

        only_first: Without those that began by themselves: whoever counts them as well prefers short ones.
        """
        return [self._episode(*span) for span in self._spans if not only_first or span[3] is not None]

    def _episode(self, robot: int, first: int, last: int, seed: int | None) -> Episode:
        after = range(first + 1, last + 1)
        actions, rewards, terminated, truncated = (
            np.array([self._rows[row][part][robot] for row in after]) for part in range(1, 5)
        )
        observations = np.array([self._rows[row][0][robot] for row in range(first, last + 1)])
        infos = {
            name: np.array([self._infos[row][name][robot] for row in range(first, last + 1)])
            for name in self._infos[first]
        }
        return Episode(seed, observations, actions, rewards, terminated, truncated, infos)
