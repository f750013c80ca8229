"""Registered environments of this package, by id."""

from typing import Any

import gymnasium as gym


def task_ids() -> list[str]:
    """Ids of the environments that this package has registered, in their order."""
    return [id for id, spec in gym.registry.items() if str(spec.entry_point).startswith("seastar_gym.")]


def require_task(task: str) -> None:
    """ValueError, with the known ids, for an id that this package has not registered."""
    if task not in task_ids():
        raise ValueError(f"There is no task {task!r}: choose of {', '.join(task_ids())}.")


def make_task(task: str, **arguments: Any) -> gym.Env[Any, Any]:
    """Environment of an id with these arguments instead of its own."""
    require_task(task)
    env: gym.Env[Any, Any] = gym.make(task, disable_env_checker=True, **arguments)
    return env
