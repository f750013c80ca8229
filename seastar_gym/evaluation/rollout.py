"""The loop in which a policy swims, `rollout`, and what it gives: `Episodes`.

    from seastar_gym.evaluation.rollout import rollout

    batch = gym.make_vec("SeastarSwim-v0", 64, vectorization_mode="vector_entry_point", actions="pairs")
    found = rollout(batch, load(), seeds=0, record=["time"])
    found.success.mean(), found.last("time")
"""  # fmt: skip

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy, require_policy
from seastar_gym.scene.checks import require_callable, require_count, require_kind, require_texts

Floats = NDArray[np.float64]
Batch = gym.vector.VectorEnv[Any, Any, Any]
Info = dict[str, Any]

MOST_DECISIONS = 1_000_000_000
"""Most decisions of a swim."""


class Episodes(NamedTuple):
    """Episodes side by side, one of every robot.

    entries: Of info, by name, of the reset and of every decision, shape (n_decisions + 1, n_episodes, ...); what comes
    after the end of an episode is none of it. success: Whether each episode ended with success, shape (n_episodes,).
    returns: Sums of rewards. decisions: Lengths. waypoints: Of each episode [m], shape (n, 2); none in tasks without.
    limit: Time limit [s].
    """

    entries: dict[str, NDArray[Any]]
    success: NDArray[np.bool_]
    returns: Floats
    decisions: NDArray[np.int64]
    waypoints: tuple[Floats, ...]
    limit: float = np.inf

    def of(self, name: str, after: float = np.nan) -> Floats:
        """An entry of every decision, shape (n_decisions, n_episodes). after: Value after the end of an episode."""
        entry = self.entries[name][1:]
        return np.where(np.arange(len(entry))[:, None] < self.decisions, entry, after)

    def last(self, name: str) -> NDArray[Any]:
        """An entry at the end of every episode, shape (n_episodes, ...)."""
        return np.asarray(self.entries[name][self.decisions, np.arange(len(self.decisions))])

    def total(self, name: str) -> Floats:
        """Sum of an entry over the decisions of every episode, added one after the other."""
        return np.asarray(np.add.accumulate(self.of(name, 0.0))[-1])


def rollout(
    env: gym.Env[Any, Any] | Batch,
    policy: Policy,
    *,
    seeds: int | list[int] | None = None,
    options: Info | None = None,
    until: int | None = None,
    record: Sequence[str] = (),
    on_step: Callable[[Info], bool | None] | None = None,
) -> Episodes:
    """An episode of every robot of a batch, or of an environment's one, to its end, with deterministic actions.

    Robots whose episode is over rest until those of all are. The policy sees what the environment shows: a batch's
    observations, or those of its one robot.

    seeds, options: Of the reset. until: Most decisions. None means that episodes end by themselves.
    record: Entries of info to keep, of those that there are.
    on_step: Called with the info of the reset and of every decision; True ends the rollout.
    """
    is_batch = isinstance(env, gym.vector.VectorEnv)
    require_kind("env", env, gym.Env | gym.vector.VectorEnv, "an environment or a batch")
    if is_batch:
        require_next_step("A rollout", env)
    require_policy(policy)
    require_texts("record", record)
    if until is not None:
        require_count("until", until, 1, MOST_DECISIONS)
    if on_step is not None:
        require_callable("on_step", on_step)
    n: int = env.num_envs if is_batch else 1  # type: ignore[union-attr]
    observations, info = env.reset(seed=seeds, options=options)  # type: ignore[arg-type]
    waypoints: Any = getattr(env.unwrapped, "waypoints", ())
    kept: dict[str, list[Any]] = {name: [] for name in record if name in info}

    def look(info: Info) -> bool:
        for name, values in kept.items():
            values.append(info[name] if is_batch else np.array([info[name]]))
        return on_step is not None and on_step(info) is True

    success, returns, decisions = np.zeros(n, bool), np.zeros(n), np.zeros(n, np.int64)
    state, begins, swimming = None, np.ones(n, bool), np.ones(n, bool)
    is_over = look(info)
    while not is_over and swimming.any() and (until is None or decisions.max() < until):
        actions, state = policy.predict(observations, state=state, episode_start=begins, deterministic=True)
        if not swimming.all():
            actions = np.array(actions)
            actions[~swimming] = 0  # rest, in every action mode
        observations, rewards, terminated, truncated, info = env.step(actions)
        begins = np.logical_or(terminated, truncated) & np.ones(n, bool)
        returns += np.where(swimming, rewards, 0.0)  # type: ignore[arg-type]
        decisions += swimming
        success |= swimming & begins & info["is_success"]
        swimming &= ~begins
        is_over = look(info)
    entries = {name: np.array(values) for name, values in kept.items()}
    return Episodes(entries, success, returns, decisions, waypoints if is_batch else (waypoints,))


def require_next_step(who: str, batch: Any) -> None:
    """ValueError where a batch begins episodes otherwise than with the step after an end, so that info is another's."""
    mode = batch.metadata.get("autoreset_mode")
    if mode is not AutoresetMode.NEXT_STEP:
        raise ValueError(f"{who} needs autoreset_mode=AutoresetMode.NEXT_STEP, not {mode}.")
