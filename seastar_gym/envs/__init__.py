"""Environments of robots that swim by decisions. Importing this package registers their ids, and nothing else.

`SeastarSwim-v0`, the same with continuous commands, the timed environments that decide several times a second, one that
asks for headings, and the tasks of `seastar_gym.envs.tasks`.
"""

from typing import TYPE_CHECKING, Any

from gymnasium.envs.registration import EnvSpec, register, registry

if TYPE_CHECKING:
    from seastar_gym.envs.commands import Actions


def _register(id: str, home: str = "seastar_gym.envs.vector", name: str = "SeastarSwim", **facts: Any) -> None:
    """Register an id, unless it is, as when this module is loaded again.

    Gymnasium's passive checker is left out: after a first reset that is refused or interrupted, it fails at every step.
    """
    single = home.replace("vector", "seastar_swim")
    facts |= {
        "entry_point": f"{single}:{name}Env", "vector_entry_point": f"{home}:{name}VectorEnv",
        "disable_env_checker": True,
    }  # fmt: skip
    if registry.get(id) != EnvSpec(id=id, **facts):
        register(id=id, **facts)


_register("SeastarSwim-v0", max_episode_steps=400)
_register("SeastarSwimContinuous-v0", max_episode_steps=400, kwargs={"actions": "continuous"})

TIMED = {"SeastarSwimTimed-v0": 0.5, "SeastarSwimTimedModerate-v0": 0.2, "SeastarSwimTimedHard-v0": 0.1}
"""Times between decisions [s] of the timed environments, easy, moderate and hard, by id."""
TIME_LIMIT = 200.0
"""Time limit of the timed environments [s]."""

for _id, _decision_period in TIMED.items():
    _register(
        _id,
        max_episode_steps=round(TIME_LIMIT / _decision_period),
        kwargs={"decision_period": _decision_period, "actions": "pairs"},
    )

_register(
    "SeastarSwimHeading-v0",
    max_episode_steps=600,
    kwargs={"decision_period": 0.5, "actions": "pairs", "headings": {"version": 1, "kind": "HeadingTargets"}},
)

TASKS: dict[str, tuple[str, "Actions", float, float, float]] = {
    "SeastarMiswired-v0": ("miswired", "joint", 1.0, 400.0, 150.0),
    "SeastarMiswiredTimed-v0": ("miswired", "joint", 0.5, 400.0, 145.0),
    "SeastarPrey-v0": ("prey", "pairs", 1.0, 200.0, 80.0),
    "SeastarPreyTimed-v0": ("fast-prey", "pairs", 0.5, 200.0, 130.0),
    "SeastarStation-v0": ("station", "joint", 1.0, 120.0, -20.0),
    "SeastarFailBlind-v0": ("fail-blind", "joint", 1.0, 500.0, 150.0),
    "SeastarObstTrap-v0": ("obst-trap", "pairs", 1.0, 300.0, 95.0),
    "SeastarObstTrapTimed-v0": ("obst-trap", "pairs", 0.5, 200.0, 94.0),
    "SeastarPrizes-v0": ("prizes", "pairs", 1.0, 201.0, 80.0),
    "SeastarPrizesTimed-v0": ("fast-prizes", "pairs", 0.5, 115.5, 76.0),
    "SeastarSwimSimToReal-v0": ("sim-to-real", "pairs", 0.2, 300.0, 145.0),
}
"""Name of the challenge, actions, time between decisions [s], time limit [s] and reward threshold of tasks, by id."""

for _id, (_task, _actions, _decision_period, _limit, _threshold) in TASKS.items():
    _register(
        _id,
        "seastar_gym.envs.tasks.envs",
        "SeastarTask",
        max_episode_steps=round(_limit / _decision_period),
        reward_threshold=_threshold,
        kwargs={"task": _task, "actions": _actions, "decision_period": _decision_period},
    )
