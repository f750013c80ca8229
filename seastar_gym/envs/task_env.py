"""Common base of the environments of one robot and of a batch: task, action mode, and options of a reset."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ParamSpec, TypeVar

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from seastar_gym.envs.commands import Actions, action_space, command_table
from seastar_gym.envs.headings import HeadingTargets
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.randomization import DomainRandomization
from seastar_gym.envs.sight import Drawn, Sight
from seastar_gym.envs.spec import PlainSpec
from seastar_gym.envs.swimming import Swimming
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import Mirror
from seastar_gym.scene.checks import shown
from seastar_gym.simulator import Simulator

_P = ParamSpec("_P")
Result = TypeVar("Result")


class TaskEnv(PlainSpec):
    """Base of the environments: their task, and the spaces of one robot."""

    actions: Actions
    _arguments: frozenset[str] = frozenset()
    """Names of the constructor's arguments, which are attributes, too. Once the environment is made, setting one holds
    from the next episode on, or is refused, see `Swimming.ask`."""
    _is_made = False
    _option = "path"
    """Name of the option by which a reset asks for something of the task."""
    _running = False
    """Whether an episode has begun and was not interrupted."""

    def _set_task(self, task: Swimming) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
        """Take the task; returns the spaces of one robot's actions and observations."""
        n_limbs = task.scene.robot.n_limbs
        self._task, self.actions = task, task.options.actions
        actions_of_one = action_space(self.actions, n_limbs)
        has_table = isinstance(actions_of_one, spaces.Discrete)
        self.command_table = command_table(self.actions, n_limbs) if has_table else None
        return actions_of_one, spaces.Box(-np.inf, np.inf, (task.layout.size,), np.float32)

    def __setattr__(self, name: str, value: Any) -> None:
        if self._is_made and name in self._arguments:
            self._ask(name, (value,) * self._task.n_robots)
        else:
            super().__setattr__(name, value)

    def __getattr__(self, name: str) -> Any:
        """Arguments that are no attributes otherwise, those of robot 0."""
        if name not in type(self)._arguments:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return self._argument(name, 0)

    def _argument(self, name: str, robot: int) -> Any:
        return getattr(self._task.options_of[robot], name)

    def _ask(self, name: str, values: Sequence[Any]) -> None:
        """Have an argument hold from the next episode of every robot on. values: One for each robot."""
        self._task.ask(name, values)

    def _to_the_end(self, change: Callable[_P, Result], *args: _P.args, **kwargs: _P.kwargs) -> Result:
        """What a step or reset returns: after an interruption, robots and task disagree, and only a reset helps."""
        was_running, self._running = self._running, False
        try:
            result = change(*args, **kwargs)
        except ValueError:  # refused before anything changed
            self._running = was_running
            raise
        self._running = True
        return result

    @property
    def decision_period(self) -> float:
        """Time between decisions [s], which a step takes."""
        return self._task.decision_period

    @property
    def observe_actuators(self) -> bool:
        """Whether observations have the memory of the actuators."""
        return self._task.options.observe_actuators

    @property
    def added_mirror(self) -> Mirror:
        """What a mirror does to the numbers that the task adds to a limb's in the observation."""
        return self._task.added_mirror

    @property
    def layout(self) -> Layout:
        """What one robot's observation consists of, and the places of all that."""
        return self._task.layout

    @property
    def headings(self) -> HeadingTargets | None:
        """Headings that are asked for at the waypoints, None if none are."""
        return self._task.options.headings

    @property
    def sight(self) -> Sight | None:
        """Camera through which robots are seen, None for full sight."""
        return self._task.options.sight

    @property
    def action_delay(self) -> Drawn:
        """Time from a decision to the heat of wires [s], or its distribution."""
        return self._task.options.action_delay

    @property
    def scene(self) -> Scene:
        """Scene as it was given, before `randomization` draws any of its numbers."""
        return self._task.scene

    @property
    def randomization(self) -> DomainRandomization | None:
        """Distributions of the numbers that are drawn for every episode."""
        return self._task.options.randomization

    def privileged_observations(self) -> NDArray[np.float32]:
        """What would be observed now without a `Sight`: the true state, for rewards and critics of a training.

        Shape (n_robots, size), in the layout of `SeastarSwim-v0` in this scene, `Layout.of(scene)`.
        """
        return self._task.privileged_observations()

    @property
    def simulator(self) -> Simulator:
        """Simulator of all robots of the environment."""
        return self._task.simulator


def arguments_of(init: Callable[..., None]) -> frozenset[str]:
    """Names of the arguments of a constructor, without those that it takes under any name."""
    named = inspect.signature(init).parameters.values()
    return frozenset(one.name for one in named if one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD)) - {"self"}


def checked_options(options: Mapping[str, Any] | None, known: set[str]) -> Mapping[str, Any]:
    """Options of a reset. ValueError: an option has a name that is not known, and would be ignored."""
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"options must be a dictionary with any of {sorted(known)}, or None, not {shown(options)}.")
    unknown = set(options or {}) - known
    if unknown:
        raise ValueError(f"Unknown reset option(s) {shown(sorted(unknown, key=str))}: known are {sorted(known)}.")
    return options or {}
