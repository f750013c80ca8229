"""Attributes of a batch robot by robot, as Gymnasium's `SyncVectorEnv` gives and sets them."""

from collections.abc import Callable, Mapping, Sequence
from operator import getitem
from typing import Any

import numpy as np

from seastar_gym.envs.task_env import TaskEnv
from seastar_gym.scene import Scene

OF_EACH_ROBOT: Mapping[str, Callable[[Any, int], Any]] = {
    **dict.fromkeys(("action_masks", "np_random", "np_random_seed", "render", "sampling_mask", "waypoints"), getitem),
    "privileged_observations": lambda rows, robot: rows[robot : robot + 1],
    "scene": Scene.of_robot,
}
"""What a robot has of its own of these attributes, and results of methods, of a batch; all others are common."""
NOT_OF_A_ROBOT = ("reset", "step")
"""Methods that robots of one simulator cannot be called alone for."""


def robot_by_robot(name: str, value: Any, n_robots: int) -> tuple[Any, ...]:
    """What every robot has of an attribute of a batch, or of a method's result."""
    own = OF_EACH_ROBOT.get(name)
    return (
        (value,) * n_robots if own is None or value is None else tuple(own(value, robot) for robot in range(n_robots))
    )


class BatchAttributes(TaskEnv):
    """Base of a batch whose robots share one simulator."""

    num_envs: int
    _own_attributes: dict[str, tuple[Any, ...]]

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Attribute, or result of a method, of every robot."""
        if name in NOT_OF_A_ROBOT:
            raise ValueError(f"The robots share one simulator: use {name}() of the batch, not call({name!r}).")
        if name == "get_wrapper_attr":
            return self.call(*args)
        if name in self._own_attributes:
            values = self._own_attributes[name]
            return tuple(value(*args, **kwargs) if callable(value) else value for value in values)
        if name in self._task.per_episode:
            return tuple(self._argument(name, robot) for robot in range(self.num_envs))
        if name in ("action_space", "observation_space"):
            name = f"single_{name}"
        value = getattr(self, name)
        return robot_by_robot(name, value(*args, **kwargs) if callable(value) else value, self.num_envs)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Attribute of every robot."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute to a list or tuple with a value for every robot, or to one value for all.

        Robots may differ in new attributes, in `np_random`, and in the arguments that hold from their next episodes on:
        `path`, `random_heading`, `reward` and `waypoint_radius`. Another attribute that the batch has already is common
        to all robots, and takes one value only; other arguments of the constructor are refused.
        """
        values = tuple(values) if isinstance(values, list | tuple) else (values,) * self.num_envs
        if len(values) != self.num_envs:
            raise ValueError(f"{name} must be one value or {self.num_envs} of them, not {len(values)}.")
        if name == "np_random":
            setattr(self, name, values)
        elif name in self._task.per_episode:
            self._ask(name, values)
        elif not hasattr(self, name):
            self._own_attributes[name] = values
        elif all(value is values[0] or np.all(value == values[0]) for value in values):
            setattr(self, name, values[0])
        else:
            raise ValueError(f"The robots share one batch, so {name} must be the same for all of them.")

    def has_wrapper_attr(self, name: str) -> bool:
        """Whether robots have an attribute, as Gymnasium's environments tell."""
        return name in self._own_attributes or hasattr(self, name)

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """Set an attribute of all robots; returns whether it is set. force: Also where there is none of the name."""
        is_set = force or self.has_wrapper_attr(name)
        if is_set:
            self.set_attr(name, (value,) * self.num_envs)
        return is_set

    def _ask(self, name: str, values: Sequence[Any]) -> None:
        if name == "max_episode_steps":
            self._limit_episodes(values[0])
        else:
            super()._ask(name, values)

    def _limit_episodes(self, decisions: int | None) -> None:
        """Have a time limit [decisions] hold from the next episode of every robot on."""
        raise NotImplementedError
