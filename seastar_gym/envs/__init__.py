"""Environments of robots that swim by decisions. Importing this package registers their ids, and nothing else.

In come actions, out go observations and rewards. An environment (seastar_swim.py, vector.py) holds robots (robots.py),
which ask a task where its targets are and how a decision is scored: `AlongPath` in waypoints.py, or those of `tasks`.
The terms of rewards are in rewards.py, and
`Robots` adds them up.

`SeastarSwim-v0`, the same with continuous commands, the timed environments that decide several times a second, one that
asks for headings, and the tasks of `seastar_gym.envs.tasks`: every id is a row of `IDS`.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from gymnasium.envs.registration import EnvSpec, register, registry

if TYPE_CHECKING:
    from seastar_gym.envs.commands import Actions


class Id(NamedTuple):
    """What a registered environment is made of."""

    goal: str
    """What it asks for, in a few words."""
    task: str | None
    """Name of the task; None for waypoints."""
    actions: "Actions"
    decision_period: float
    """Time between decisions [s]."""
    seconds: float
    """Time limit [s]."""
    threshold: float | None = None
    """Return that solves it."""
    more: Mapping[str, Any] = {}
    """Further arguments of the environment."""

    @property
    def decisions(self) -> int:
        """Time limit [decisions]."""
        return round(self.seconds / self.decision_period)


IDS: dict[str, Id] = {
    "SeastarSwim-v0": Id("waypoints, a stroke a second", None, "limbs", 1.0, 400.0),
    "SeastarSwimContinuous-v0": Id("waypoints, by strokes of any strength", None, "continuous", 1.0, 400.0),
    "SeastarSwimTimed-v0": Id("waypoints, two decisions a second", None, "pairs", 0.5, 200.0),
    "SeastarSwimTimedModerate-v0": Id("waypoints, five decisions a second", None, "pairs", 0.2, 200.0),
    "SeastarSwimTimedHard-v0": Id("waypoints, ten decisions a second", None, "pairs", 0.1, 200.0),
    "SeastarSwimHeading-v0": Id(
        "waypoints, with limb 1 pointing along the legs of the path", None, "pairs", 0.5, 300.0,
        more={"headings": {"version": 1, "kind": "HeadingTargets"}},
    ),
    "SeastarMiswired-v0": Id("waypoints; wires may be swapped", "miswired", "joint", 1.0, 400.0, 150.0),
    "SeastarMiswiredTimed-v0": Id("waypoints; wires may be swapped", "miswired", "joint", 0.5, 400.0, 145.0),
    "SeastarPrey-v0": Id("catch faster prey on a closed course", "prey", "pairs", 1.0, 200.0, 80.0),
    "SeastarPreyTimed-v0": Id("catch faster prey on a closed course", "fast-prey", "pairs", 0.5, 200.0, 130.0),
    "SeastarStation-v0": Id("keep a place in a current", "station", "joint", 1.0, 120.0, -20.0),
    "SeastarFailBlind-v0": Id("waypoints with two dead limbs", "fail-blind", "joint", 1.0, 500.0, 150.0),
    "SeastarObstTrap-v0": Id("a goal behind a horseshoe of discs", "obst-trap", "pairs", 1.0, 300.0, 95.0),
    "SeastarObstTrapTimed-v0": Id("a goal behind a horseshoe of discs", "obst-trap", "pairs", 0.5, 200.0, 94.0),
    "SeastarPrizes-v0": Id("more prizes than can be reached", "prizes", "pairs", 1.0, 201.0, 80.0),
    "SeastarPrizesTimed-v0": Id("more prizes than can be reached", "fast-prizes", "pairs", 0.5, 115.5, 76.0),
    "SeastarSwimSimToReal-v0": Id("waypoints, seen by a late camera", "sim-to-real", "pairs", 0.2, 300.0, 145.0),
}  # fmt: skip
"""All environments of the package."""
TASKS = {id: row for id, row in IDS.items() if row.task is not None}
"""Those of tasks."""

ENVIRONMENTS: dict[str, Any] = {
    "entry_point": "seastar_gym.envs.seastar_swim:SeastarSwimEnv",
    "vector_entry_point": "seastar_gym.envs.vector:SeastarSwimVectorEnv",
    "disable_env_checker": True,  # after a first reset that is refused or interrupted, it fails at every step
}
"""What makes the environments of every id."""

STROKE = 1.0
"""Time between decisions [s] that the actuator chooses, unless another is asked for."""


def _arguments(row: Id) -> dict[str, Any]:
    """Arguments of an environment that are not its own ones."""
    own = {"task": None, "actions": "limbs", "decision_period": STROKE}
    return {name: getattr(row, name) for name in own if getattr(row, name) != own[name]} | dict(row.more)


for _id, _row in IDS.items():
    _facts = ENVIRONMENTS | {
        "max_episode_steps": _row.decisions, "reward_threshold": _row.threshold, "kwargs": _arguments(_row),
    }  # fmt: skip
    if registry.get(_id) != EnvSpec(_id, **_facts):  # unless this module is loaded again
        register(_id, **_facts)
