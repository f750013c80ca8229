"""Registered environments of this package, by id, and episodes that an agent swims in them, one for each seed."""

import importlib
from pathlib import Path
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec

from seastar_gym.controllers.contract import Policy, actions_in, require_fit
from seastar_gym.controllers.greedy import Searcher
from seastar_gym.envs.commands import Actions
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.robots import Split
from seastar_gym.envs.sight import told
from seastar_gym.evaluation.measures import measure_of
from seastar_gym.evaluation.rollout import Batch, Episodes, rollout
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.scene_file import search

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
        search(Path.cwd())
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


def make_task(task: str, **arguments: Any) -> gym.Env[Any, Any]:
    """Environment of an id with these arguments instead of its own."""
    require_task(task)
    env: gym.Env[Any, Any] = gym.make(spec_of(task), disable_env_checker=True, **arguments)
    return env


def held_out(task: str, fidelity: Fidelity | None = None, split: Split = "test") -> dict[str, Any]:
    """Arguments that keep a task to the episodes of a split, where it has splits; by default those that no training
    draws. fidelity: None means the task's own."""
    return ({"split": split} if "task" in spec_of(task).kwargs else {}) | (
        {} if fidelity is None else {"fidelity": fidelity}
    )


def env_of(task: str, **arguments: Any) -> Any:
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
        shown_by = "" if env.sight is None else f", by {told(env.sight)}"
        raise ValueError(f"It reads observations of {n_known} numbers, the task shows {n_seen}{shown_by}.")
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
