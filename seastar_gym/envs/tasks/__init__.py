"""Tasks in which there is more to gain than a greedy rule gains, by measurement; see docs/control.md.

A task is an object that says what is drawn, where the targets are and how a decision is scored, see
`seastar_gym.envs.robots`; the environments of `SeastarSwim-v0` take it. Here they have names, and get ids.

hidden.py     limbs whose wires may be swapped; dead limbs of a robot that sees its way alone; a robot that a late
              camera sees, and whose stiffness and drag are not known
prey.py       prey that is faster than the robot
station.py    a place to keep in a current that shows in the velocities
obst_trap.py  a goal behind discs, most of which may form a horseshoe, and the ways around them
prizes.py     more prizes than can be reached, and the best choice of them
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, get_args

import gymnasium as gym

from seastar_gym.envs import ENVIRONMENTS
from seastar_gym.envs.commands import Actions
from seastar_gym.envs.instances import Split
from seastar_gym.envs.robots import Task
from seastar_gym.envs.tasks.hidden import FailBlind, Miswired, SimToReal
from seastar_gym.envs.tasks.obst_trap import ObstTrap
from seastar_gym.envs.tasks.prey import Prey
from seastar_gym.envs.tasks.prizes import Prizes
from seastar_gym.envs.tasks.station import Station
from seastar_gym.envs.waypoints import AlongPath, HeldOutPaths
from seastar_gym.scene.checks import require_choice, require_number, require_period, shown
from seastar_gym.scene.serial import read, to_dict

NAMED: dict[str, Task] = {
    "miswired": Miswired(),
    "prey": Prey(),
    "fast-prey": Prey(speed=(0.0105, 0.0135), robot_speed=0.007),
    "station": Station(),
    "fail-blind": FailBlind(),
    "obst-trap": ObstTrap(),
    "prizes": Prizes(),
    "fast-prizes": Prizes(seconds=115.0, robot_speed=0.007),
    "sim-to-real": SimToReal(),
}
"""Tasks by name."""


def register_task(
    id: str,
    task: Task,
    seconds: float,
    actions: Actions = "joint",
    decision_period: float = 1.0,
    reward_threshold: float | None = None,
) -> None:
    """Register a task of your own as an id of gymnasium, alone and as a native batch.

    seconds: Time limit of an episode [s]. decision_period: Time between decisions [s]. reward_threshold: Return that
        solves it.
    """
    require_number("seconds", seconds, "s")
    require_period(decision_period)
    gym.register(
        id,
        **ENVIRONMENTS,
        max_episode_steps=max(1, round(seconds / decision_period)),
        reward_threshold=reward_threshold,
        kwargs={"task": to_dict(task), "actions": actions, "decision_period": decision_period},
    )


def read_task(task: Task | Mapping[str, Any] | str) -> Task:
    """Task of a name, an object or its plain form."""
    if isinstance(task, str):
        require_choice("task", task, tuple(NAMED))
        return NAMED[task]
    found = read(task, Task)
    if not isinstance(found, Task):
        raise ValueError(f"task must be a task such as Miswired(), or its name, not {shown(task)}.")
    return found


def chosen_task(task: Task | Mapping[str, Any] | str | None, split: Split, **of_swim: Any) -> Task:
    """Task that is given, or the `AlongPath` of these arguments, all of which belong to that alone."""
    require_choice("split", split, get_args(Split))
    if task is None:
        return HeldOutPaths(**of_swim) if split == "test" else AlongPath(**of_swim)
    found = read_task(task)
    for one in fields(AlongPath):
        value = of_swim.get(one.name, one.default)
        if type(value) is not type(one.default) or value != one.default:
            raise ValueError(f"{one.name} belongs to swims along a path: leave it out with task={shown(task)}.")
    return found


def name_of(task: Task | None) -> str | None:
    """Name of a task, whatever its rewards weigh; None for waypoints, or where it has no name."""
    return next(
        (name for name, known in NAMED.items() if type(known) is type(task) and known == _paid_as(known, task)), None
    )


def _paid_as(known: Any, task: Any) -> Any:
    """A task with the `RewardWeights` of another of its kind."""
    return replace(task, reward=known.reward) if hasattr(known, "reward") else task
