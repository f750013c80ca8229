"""Attributes of the environments of one robot and of a batch: their arguments, their robots, and specs that JSON takes.

    spec = EnvSpec.from_json(env.spec.to_json())
    env = gym.make(spec)
"""  # fmt: skip

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from enum import Enum
from operator import attrgetter
from os import PathLike, fspath
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from seastar_gym.envs.commands import Actions, action_space, command_table
from seastar_gym.envs.headings import HeadingTargets
from seastar_gym.envs.instances import Split
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.randomization import DomainRandomization
from seastar_gym.envs.robots import Robots, Task
from seastar_gym.envs.sight import Drawn, Sight
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import Mirror
from seastar_gym.scene.checks import shown
from seastar_gym.scene.serial import KINDS, to_dict
from seastar_gym.simulator import Simulator


def _of_robots(place: str, says: str) -> Any:
    """Property that reads what the robots of an environment have at a place."""
    return property(attrgetter(f"_robots.{place}"), doc=says)


class RobotsEnv:
    """Base of the environments: their robots, and the spaces of one of them.

    The spec holds arguments as plain data: a scene as `Scene.to_dict` writes it, for one. Arguments that have no plain
    form, such as a scene with an actuator of one's own, stay as they are: the spec makes environments as any other
    does, but refuses to be written.
    """

    actions: Actions
    _robots: Robots
    _arguments: frozenset[str] = frozenset()
    """Names of the constructor's arguments, which are attributes, too. Once the environment is made, setting one holds
    from the next episode on, or is refused, see `Robots.ask`."""
    _of_task: frozenset[str] = frozenset()
    """Names of the numbers of the task, which hold as long as the environment."""
    _is_made = False
    _spec: EnvSpec | None = None

    task: Task = _of_robots(
        "task", "What the robots swim for; a `AlongPath` of waypoints unless another task was given."
    )
    split: Split = _of_robots("split", "Which episodes of a task are drawn.")
    decision_period: float = _of_robots("decision_period", "Time between decisions [s], which a step takes.")
    timed: float | None = _of_robots(
        "timed", "Time between decisions [s], None where they are strokes of the actuator."
    )
    observe_actuators: bool = _of_robots(
        "options.observe_actuators", "Whether observations have the memory of the actuators."
    )
    added_mirror: Mirror = _of_robots(
        "added_mirror", "What a mirror does to the numbers that the task adds to a limb's in the observation."
    )
    layout: Layout = _of_robots("layout", "What one robot's observation consists of, and the places of all that.")
    sight: Sight | None = _of_robots("options.sight", "Camera through which robots are seen, None for full sight.")
    action_delay: Drawn = _of_robots(
        "options.action_delay", "Time from a decision to the heat of wires [s], or its distribution."
    )
    scene: Scene = _of_robots("scene", "Scene as it was given, before `randomization` draws any of its numbers.")
    randomization: DomainRandomization | None = _of_robots(
        "options.randomization", "Distributions of the numbers that are drawn for every episode."
    )
    simulator: Simulator = _of_robots("simulator", "Simulator of all robots of the environment.")

    def _take(self, robots: Robots) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
        """Take the robots; returns the spaces of one robot's actions and observations."""
        n_limbs = robots.scene.robot.n_limbs
        self._robots, self.actions = robots, robots.options.actions
        self._of_task = frozenset(getattr(robots.task, "__dataclass_fields__", ()))
        actions_of_one = action_space(self.actions, n_limbs)
        has_table = isinstance(actions_of_one, spaces.Discrete)
        self.command_table = command_table(self.actions, n_limbs) if has_table else None
        seen: Any = spaces.Box(-np.inf, np.inf, (robots.layout.size,), np.float32)
        seen.decision_period = robots.decision_period  # files of models keep it, see `require_fit`
        return actions_of_one, seen

    def __setattr__(self, name: str, value: Any) -> None:
        if self._is_made and (name in self._arguments or name in self._of_task):
            self._ask(name, (value,) * self._robots.n_robots)
        else:
            super().__setattr__(name, value)

    def __getattr__(self, name: str) -> Any:
        """Arguments that are no attributes otherwise, those of robot 0."""
        if name not in type(self)._arguments:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return self._argument(name, 0)

    def _argument(self, name: str, robot: int) -> Any:
        options, task = self._robots.options, self._robots.tasks[robot]
        return getattr(options if hasattr(options, name) else task, name, None)  # None: the task has no such number

    def _ask(self, name: str, values: Sequence[Any]) -> None:
        """Have an argument hold from the next episode of every robot on. values: One for each robot."""
        self._robots.ask(name, values)

    @property
    def spec(self) -> EnvSpec | None:
        """How `gym.make` made the environment, None if it did not."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = None if spec is None else _as_plain(spec)

    @property
    def headings(self) -> HeadingTargets | None:
        """Headings that are asked for at the waypoints, None if none are."""
        return getattr(self.task, "headings", None)

    def privileged_observations(self) -> NDArray[np.float32]:
        """What would be observed now without a `Sight`: the true state, for rewards and critics of a training.

        Shape (n_robots, size), in the layout of `SeastarSwim-v0` in this scene, `Layout.of(scene)`.
        """
        return self._robots.privileged_observations()


def arguments_of(make: Callable[..., Any]) -> frozenset[str]:
    """Names of the arguments of a class or a constructor, without those that it takes under any name."""
    named = inspect.signature(make).parameters.values()
    return frozenset(one.name for one in named if one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD)) - {"self"}


def checked_options(options: Mapping[str, Any] | None, known: set[str]) -> Mapping[str, Any]:
    """Options of a reset. ValueError: an option has a name that is not known, and would be ignored."""
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"options must be a dictionary with any of {sorted(known)}, or None, not {shown(options)}.")
    unknown = set(options or {}) - known
    if unknown:
        raise ValueError(f"Unknown reset option(s) {shown(sorted(unknown, key=str))}: known are {sorted(known)}.")
    return options or {}


class _UnwritableSpec(EnvSpec):
    def to_json(self) -> str:
        """Refuse, with the reason."""
        _plain(self.kwargs)
        return super().to_json()


def _as_plain(spec: EnvSpec) -> EnvSpec:
    try:
        return replace(spec, kwargs=_plain(spec.kwargs))
    except ValueError:
        return _UnwritableSpec(**{one.name: getattr(spec, one.name) for one in fields(spec) if one.init})


def _plain(value: Any) -> Any:
    """An argument, or several, as JSON has them."""
    match value:
        case _ if KINDS.get(type(value).__name__) is type(value):
            return to_dict(value)
        case Enum():
            return value.value
        case PathLike():
            return fspath(value)
        case np.ndarray() | np.generic():
            return value.tolist()
        case None | bool() | int() | float() | str():
            return value
        case Sequence() if not isinstance(value, bytes):
            return [_plain(one) for one in value]
        case Mapping():
            return {name: _plain(one) for name, one in value.items()}
    raise ValueError(f"The spec of an environment with {value!r} among its arguments cannot be written.")
