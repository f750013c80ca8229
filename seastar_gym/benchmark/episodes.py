"""Episodes of a task that an agent swims side by side, one for each seed."""

import inspect
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import load_env_creator
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy, actions_in, require_fit
from seastar_gym.controllers.greedy import Searcher
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.tasks.numbered import Split
from seastar_gym.scene.numerics import Fidelity

Floats = NDArray[np.float64]
KEPT = ("time", "distance", "catches", "taken")
"""Entries of info that measures need, where a task has them."""


class Episodes(NamedTuple):
    """Episodes side by side. entries: Of info, by name, of every decision, NaN after the end of an episode.

    success: Whether each episode ended with success, shape (n_episodes,). returns: Sums of rewards. decisions: Lengths.
    limit: Time limit [s].
    """

    entries: dict[str, list[Floats]]
    success: NDArray[np.bool_]
    returns: Floats
    decisions: NDArray[np.int64]
    limit: float

    def of(self, name: str) -> Floats:
        """An entry, shape (n_decisions, n_episodes)."""
        return np.array(self.entries[name])

    def last(self, name: str) -> Floats:
        """An entry at the end of every episode."""
        return self.of(name)[self.decisions - 1, np.arange(len(self.decisions))]


def held_out(task: str, split: Split = "test") -> dict[str, Any]:
    """Arguments that keep a task to the episodes of a split, where it has splits; by default those that no training
    draws."""
    entry: Any = gym.spec(task).entry_point
    creator: Any = load_env_creator(entry) if isinstance(entry, str) else entry
    return {"split": split} if "split" in inspect.signature(creator).parameters else {}


def make_batch(
    task: str, n: int, /, threads: int | None = None, **arguments: Any
) -> gym.vector.VectorEnv[Any, Any, Any]:
    """Batch of a task, the native one where there is one. threads: Of the native one; None means one per processor."""
    if gym.spec(task).vector_entry_point is None:
        return gym.make_vec(task, n, vectorization_mode="sync", **arguments)
    return gym.make_vec(task, n, vectorization_mode="vector_entry_point", threads=threads, **arguments)


def require_seen(policy: Policy, env: Any) -> None:
    """ValueError where an agent cannot know what a task shows, or cannot drive its robot."""
    n_seen, n_known = env.observation_space.shape[0], Layout.of(env.scene).size
    if isinstance(policy, Searcher) and n_seen != n_known:
        raise ValueError(f"It reads observations of {n_known} numbers, the task shows {n_seen}.")
    actions = actions_in(policy, env.actions, env.scene.robot.n_limbs)
    require_fit(policy, env.scene, actions, env.decision_period, n_seen, getattr(env, "challenge", None))


def swim_episodes(
    task: str,
    policy: Policy,
    seeds: list[int],
    *,
    fidelity: Fidelity | None = None,
    max_decisions: int | None = None,
    threads: int | None = None,
    split: Split = "test",
) -> Episodes:
    """Episodes with these seeds, each to its end, with deterministic actions.

    fidelity: None means the task's own. max_decisions: None means the time limit of the task. threads: Of the
    simulator; None means one per processor. split: Where a task has splits, the one whose episodes are swum.
    """
    arguments = held_out(task, split) | ({} if fidelity is None else {"fidelity": fidelity})
    plain: Any = gym.make(task, disable_env_checker=True, **arguments).unwrapped
    require_seen(policy, plain)
    mode = actions_in(policy, plain.actions, plain.scene.robot.n_limbs)
    limit = max_decisions or gym.spec(task).max_episode_steps
    if limit is None:
        raise ValueError(f"The task {task!r} has no time limit.")
    env = make_batch(task, len(seeds), threads, actions=mode, max_episode_steps=limit, **arguments)
    episodes = _swim(env, policy, seeds, limit * plain.decision_period)
    env.close()
    return episodes


def _swim(env: Any, policy: Policy, seeds: list[int], limit: float) -> Episodes:
    n = len(seeds)
    found = Episodes({}, np.zeros(n, bool), np.zeros(n), np.zeros(n, np.int64), limit)
    observations, _ = env.reset(seed=seeds)
    state, begins, swimming = None, np.ones(n, bool), np.ones(n, bool)
    while swimming.any():
        actions, state = policy.predict(observations, state=state, episode_start=begins, deterministic=True)
        observations, rewards, terminated, truncated, info = env.step(actions)
        begins = terminated | truncated
        found.returns[swimming] += rewards[swimming]
        found.decisions[swimming] += 1
        found.success[swimming] |= (begins & info["is_success"])[swimming]
        for name in set(KEPT) & set(info):
            found.entries.setdefault(name, []).append(np.where(swimming, info[name], np.nan))
        swimming &= ~begins
    return found
