"""Common base of the environments of one robot and of a batch: task, action mode, and options of a reset."""

from typing import Any

import numpy as np
from gymnasium import spaces

from seastar_gym.envs.commands import Actions, action_space, command_table
from seastar_gym.envs.headings import Headings
from seastar_gym.envs.own_numbers import OwnNumbers
from seastar_gym.envs.randomization import DomainRandomization
from seastar_gym.envs.spec import PlainSpec
from seastar_gym.envs.swimming import Swimming
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import Mirror
from seastar_gym.scene.checks import shown
from seastar_gym.simulator import Simulator


class TaskEnv(PlainSpec):
    """Base of the environments: their task, and the spaces of one robot."""

    actions: Actions
    _option = "path"
    """Name of the option by which a reset asks for something of the task."""

    def _set_task(self, task: Swimming) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
        """Take the task; returns the spaces of one robot's actions and observations."""
        n_limbs = task.scene.robot.n_limbs
        self._task, self.actions = task, task.actions
        actions_of_one = action_space(task.actions, n_limbs)
        has_table = isinstance(actions_of_one, spaces.Discrete)
        self.command_table = command_table(task.actions, n_limbs) if has_table else None
        return actions_of_one, spaces.Box(-np.inf, np.inf, (task.observation_size,), np.float32)

    @property
    def decision_period(self) -> float:
        """Time between decisions [s], which a step takes."""
        return self._task.decision_period

    @property
    def observe_actuators(self) -> bool:
        """Whether observations have the memory of the actuators."""
        return self._task.observe_actuators

    @property
    def added_mirror(self) -> Mirror:
        """What a mirror does to the numbers that the task adds to a limb's in the observation."""
        return self._task.added_mirror

    @property
    def own_numbers(self) -> OwnNumbers:
        """What the task shows of its own in the observation, and whether it shows the limbs."""
        return self._task.own_numbers

    @property
    def headings(self) -> Headings | None:
        """Headings that are asked for at the waypoints, None if none are."""
        return self._task.headings

    @property
    def scene(self) -> Scene:
        """Scene as it was given, before `randomization` draws any of its numbers."""
        return self._task.scene

    @property
    def randomization(self) -> DomainRandomization | None:
        """Distributions of the numbers that are drawn for every episode."""
        return self._task.randomization

    @property
    def simulator(self) -> Simulator:
        """Simulator of all robots of the environment."""
        return self._task.simulator


def checked_options(options: dict[str, Any] | None, known: set[str]) -> dict[str, Any]:
    """Options of a reset. ValueError: an option has a name that is not known, and would be ignored."""
    if options is not None and not isinstance(options, dict):
        raise ValueError(f"options must be a dictionary with any of {sorted(known)}, or None, not {shown(options)}.")
    unknown = set(options or {}) - known
    if unknown:
        raise ValueError(f"Unknown reset option(s) {shown(sorted(unknown, key=str))}: known are {sorted(known)}.")
    return options or {}
