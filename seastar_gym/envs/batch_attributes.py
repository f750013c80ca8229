"""Attributes of a batch robot by robot, as Gymnasium's `SyncVectorEnv` gives and sets them."""

from typing import Any

import numpy as np

from seastar_gym.envs.task_env import TaskEnv

OF_EACH_ROBOT = ("action_masks", "np_random", "np_random_seed", "render", "waypoints")
"""Names of attributes and methods of the batch that give a tuple with a value for every robot."""


class BatchAttributes(TaskEnv):
    """Base of a batch whose robots share one simulator."""

    num_envs: int
    _own_attributes: dict[str, tuple[Any, ...]]

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Attribute, or result of a method, of every robot."""
        if name in ("reset", "step", "close"):
            raise ValueError(f"The robots share one simulator: use {name}() of the batch, not call({name!r}).")
        if name in ("action_space", "observation_space"):
            name = f"single_{name}"
        if name == "scene":
            return tuple(map(self.scene.of_robot, range(self.num_envs)))
        value = self._own_attributes[name] if name in self._own_attributes else getattr(self, name)
        value = value(*args, **kwargs) if callable(value) else value
        of_each = name in self._own_attributes or name in OF_EACH_ROBOT
        return tuple(value) if of_each and value is not None else (value,) * self.num_envs

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Attribute of every robot."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute to a list or tuple with a value for every robot, or to one value for all.

        Robots may differ in new attributes and in `np_random`. An attribute that the batch has already is common to all
        robots, and takes one value only.
        """
        values = tuple(values) if isinstance(values, list | tuple) else (values,) * self.num_envs
        if len(values) != self.num_envs:
            raise ValueError(f"{name} must be one value or {self.num_envs} of them, not {len(values)}.")
        if name == "np_random":
            setattr(self, name, values)
        elif not hasattr(self, name):
            self._own_attributes[name] = values
        elif all(value is values[0] or np.all(value == values[0]) for value in values):
            setattr(self, name, values[0])
        else:
            raise ValueError(f"The robots share one batch, so {name} must be the same for all of them.")
