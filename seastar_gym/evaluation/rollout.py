"""The loop in which a policy swims, `rollout`, and what it gives: `Episodes`.

    from seastar_gym.evaluation.rollout import rollout

    batch = gym.make_vec("SeastarSwim-v0", 64, vectorization_mode="vector_entry_point", actions="pairs")
    found = rollout(batch, load(), seeds=0, record=["time"])
    found.success.mean(), found.last("time")

`swim_episodes` does so in a registered environment, an episode for each seed. The `Measure` of a task is a number of
every episode, and says whether more or less of it is better.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy, actions_in, answer_of, require_fit, require_policy
from seastar_gym.controllers.search import Searcher
from seastar_gym.envs import IDS
from seastar_gym.envs.commands import Actions
from seastar_gym.envs.instances import Split
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.robots import Task
from seastar_gym.envs.sight import told
from seastar_gym.envs.tasks.prey import Prey
from seastar_gym.envs.tasks.prizes import Prizes
from seastar_gym.envs.tasks.station import Station
from seastar_gym.scene.checks import require_callable, require_count, require_kind, require_texts
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.scene import find_modules_in

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
    if is_batch and (mode := env.metadata.get("autoreset_mode")) is not AutoresetMode.NEXT_STEP:
        # Elsewhere info at the end of an episode is that of the next one.
        raise ValueError(f"A rollout needs autoreset_mode=AutoresetMode.NEXT_STEP, not {mode}.")
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
        answer = policy.predict(observations, state=state, episode_start=begins, deterministic=True)
        actions, state = answer_of(answer)
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


def mean_distance(episodes: Episodes) -> Floats:
    """Mean distance from the station [mm] once SETTLED has passed. ValueError where no episode is as long."""
    counts = episodes.of("time") > SETTLED
    if not counts.any():
        raise ValueError(f"Distances from a station count after {SETTLED:g} s: swim longer.")
    settled = np.where(counts, episodes.of("distance"), np.nan)
    return np.asarray(1000.0 * np.nanmean(settled, axis=0))


SECONDS = Measure("time until done", "s", "less", seconds_to_success)
MEASURES: dict[type[Any], Measure] = {
    Prey: Measure("prey caught", "1", "more", lambda episodes: episodes.last("catches").astype(float)),
    Station: Measure("mean distance", "mm", "less", mean_distance),
    Prizes: Measure("worth of prizes", "1", "more", lambda episodes: episodes.last("taken").astype(float)),
}
"""Measures of tasks that are not done at some time; those of one's own join them."""


def measure_of(env: Any) -> Measure:
    """Measure of the task of an environment."""
    return measure_of_task(getattr(env, "task", None))


def measure_of_task(task: Task | None) -> Measure:
    """Measure of a task; None for waypoints."""
    return MEASURES.get(type(task), SECONDS)


RECORDED = ("time", "distance", "catches", "taken")
"""Entries of info that the package's measures need, where a task has them."""


def task_ids() -> list[str]:
    """Ids of the environments that this package has registered, in their order."""
    return [id for id, spec in gym.registry.items() if str(spec.entry_point).startswith("seastar_gym.")]


def known_id(task: str) -> str:
    """Id of a task, which may be behind the module that registers it, "module:id", as gymnasium takes it.

    The module is imported, also from the current folder. ValueError, with one sentence, if there is none.
    """
    module, _, id = task.rpartition(":")
    if module:
        find_modules_in(Path.cwd())
        try:
            importlib.import_module(module)
        except ModuleNotFoundError as missing:
            raise ValueError(f"There is no task {task!r}: {missing}.") from missing
    return id


def spec_of(task: str) -> EnvSpec:
    """Gymnasium's specification of a task."""
    return gym.spec(known_id(task))


def require_task(task: str) -> None:
    """ValueError, with the known ids, for an id that has no environments of this package."""
    if known_id(task) not in task_ids():
        raise ValueError(f"There is no task {task!r}: choose of {', '.join(task_ids())}, or module:id.")


def make_task(task: str, /, **arguments: Any) -> gym.Env[Any, Any]:
    """Environment of an id with these arguments instead of its own."""
    require_task(task)
    env: gym.Env[Any, Any] = gym.make(spec_of(task), disable_env_checker=True, **arguments)
    return env


def held_out(task: str, fidelity: Fidelity | None = None, split: Split = "test") -> dict[str, Any]:
    """Arguments that keep a task to the episodes of a split, where it has splits; by default those that no training
    draws. The package's ids of waypoints swim random paths: those that they begin with are one episode.

    fidelity: None means the task's own."""
    spec = spec_of(task)
    is_swim = spec.id in IDS and IDS[spec.id].task is None
    drawn = {"path": "random", "random_heading": True} if is_swim else {}
    has_splits = is_swim or "task" in spec.kwargs
    return drawn | ({"split": split} if has_splits else {}) | ({} if fidelity is None else {"fidelity": fidelity})


def env_of(task: str, /, **arguments: Any) -> Any:
    """Environment of a task, of one robot, without wrappers."""
    return make_task(task, **arguments).unwrapped


def make_batch(task: str, n: int, /, threads: int | None = None, **arguments: Any) -> Batch:
    """Batch of a task, the native one where there is one. threads: Of the native one; None means one per processor."""
    spec = spec_of(task)
    if spec.vector_entry_point is None:
        return gym.make_vec(spec.id, n, vectorization_mode="sync", **arguments)
    return gym.make_vec(spec.id, n, vectorization_mode="vector_entry_point", threads=threads, **arguments)


def require_seen(policy: Policy, env: Any) -> Actions:
    """Action mode in which an agent swims a task; ValueError where it cannot know what the task shows, or drive it."""
    n_seen, n_known = env.observation_space.shape[0], Layout.of(env.scene).size
    if isinstance(policy, Searcher) and n_seen != n_known:
        shown_by = "the task" if env.sight is None else told(env.sight)
        who = type(policy).__name__
        raise ValueError(f"A {who} needs full sight: it reads {n_known} numbers, {shown_by} shows {n_seen}.")
    actions = actions_in(policy, env.actions, env.scene.robot.n_limbs)
    require_fit(policy, env.scene, actions, env.decision_period, n_seen, getattr(env, "task", None), env.sight)
    return actions


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
    arguments = held_out(task, fidelity, split)
    plain = env_of(task, **arguments)
    mode = require_seen(policy, plain)
    limit = max_decisions or spec_of(task).max_episode_steps
    if limit is None:
        raise ValueError(f"The task {task!r} has no time limit.")
    batch = make_batch(task, len(seeds), threads, actions=mode, max_episode_steps=limit, **arguments)
    records = measure_of(plain).records
    episodes = rollout(batch, policy, seeds=seeds, record=(*RECORDED, *records))
    batch.close()
    return episodes._replace(limit=limit * plain.decision_period)
