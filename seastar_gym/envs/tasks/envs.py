"""Environments of the tasks of this folder: of one robot, and of a native batch."""

from typing import Literal

import gymnasium as gym
from gymnasium.vector import AutoresetMode

from seastar_gym.envs.commands import Actions
from seastar_gym.envs.options import Plain, SwimOptions
from seastar_gym.envs.seastar_swim import RenderMode, SeastarSwimEnv
from seastar_gym.envs.sight import Drawn, Sight
from seastar_gym.envs.task_env import arguments_of
from seastar_gym.envs.tasks.challenge import Challenge
from seastar_gym.envs.tasks.fail_blind import FailBlind
from seastar_gym.envs.tasks.miswired import Miswired
from seastar_gym.envs.tasks.numbered import Split
from seastar_gym.envs.tasks.obst_trap import ObstTrap
from seastar_gym.envs.tasks.prey import Prey
from seastar_gym.envs.tasks.prizes import Prizes
from seastar_gym.envs.tasks.sim_to_real import SimToReal
from seastar_gym.envs.tasks.station import Station
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.checks import require_choice, require_number, require_period, shown
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.serial import read, to_dict

CHALLENGES: dict[str, Challenge] = {
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
"""Challenges by name."""


def register_task(
    id: str,
    challenge: Challenge,
    seconds: float,
    actions: Actions = "joint",
    decision_period: float = 1.0,
    reward_threshold: float | None = None,
) -> None:
    """Register a challenge of your own as an id of gymnasium, alone and as a native batch.

    seconds: Time limit of an episode [s]. decision_period: Time between decisions [s]. reward_threshold: Return that
        solves it.
    """
    require_number("seconds", seconds, "s")
    require_period(decision_period)
    gym.register(
        id,
        f"{__name__}:SeastarTaskEnv",
        vector_entry_point=f"{__name__}:SeastarTaskVectorEnv",
        max_episode_steps=max(1, round(seconds / decision_period)),
        reward_threshold=reward_threshold,
        disable_env_checker=True,
        kwargs={"task": to_dict(challenge), "actions": actions, "decision_period": decision_period},
    )


def read_challenge(task: Challenge | Plain | str) -> Challenge:
    """Challenge of a name, an object or its plain form."""
    if isinstance(task, str):
        require_choice("task", task, tuple(CHALLENGES))
        return CHALLENGES[task]
    challenge = read(task, Challenge)
    if not isinstance(challenge, Challenge):
        raise ValueError(f"task must be a challenge such as Miswired(), or its name, not {shown(task)}.")
    return challenge


def name_of(challenge: Challenge | None) -> str | None:
    """Name of a challenge; None for waypoints, or where it has no name."""
    return next((name for name, known in CHALLENGES.items() if known == challenge), None)


def _options(
    actions: Actions,
    fidelity: Fidelity | None,
    decision_period: float | None,
    sight: Sight | Plain | None,
    action_delay: Drawn | Plain,
) -> SwimOptions:
    return SwimOptions(
        actions=actions, fidelity=fidelity, decision_period=decision_period,
        sight=sight, action_delay=action_delay,  # type: ignore[arg-type]  # plain data, too
    )  # fmt: skip


class SeastarTaskEnv(SeastarSwimEnv):
    """Environment of one of the tasks whose headroom is measured, for the chapter's robot.

    | id                        | `task`          | decision period [s] | `actions` | time limit [s] | threshold |
    |---------------------------|-----------------|---------------------|-----------|----------------|-----------|
    | `SeastarMiswired-v0`      | `"miswired"`    | 1.0                 | `"joint"` | 400            | 150       |
    | `SeastarMiswiredTimed-v0` | `"miswired"`    | 0.5                 | `"joint"` | 400            | 145       |
    | `SeastarPrey-v0`          | `"prey"`        | 1.0                 | `"pairs"` | 200            | 80        |
    | `SeastarPreyTimed-v0`     | `"fast-prey"`   | 0.5                 | `"pairs"` | 200            | 130       |
    | `SeastarStation-v0`       | `"station"`     | 1.0                 | `"joint"` | 120            | -20       |
    | `SeastarFailBlind-v0`     | `"fail-blind"`  | 1.0                 | `"joint"` | 500            | 150       |
    | `SeastarObstTrap-v0`      | `"obst-trap"`   | 1.0                 | `"pairs"` | 300            | 95        |
    | `SeastarObstTrapTimed-v0` | `"obst-trap"`   | 0.5                 | `"pairs"` | 200            | 94        |
    | `SeastarPrizes-v0`        | `"prizes"`      | 1.0                 | `"pairs"` | 201            | 80        |
    | `SeastarPrizesTimed-v0`   | `"fast-prizes"` | 0.5                 | `"pairs"` | 115.5          | 76        |
    | `SeastarSwimSimToReal-v0` | `"sim-to-real"` | 0.2                 | `"pairs"` | 300            | 145       |

    `Prizes` ends by itself a decision before its time limit.

    The threshold is `reward_threshold` of the spec: about the mean return of the best rule in docs/tasks.md that is
    not told what is hidden; for `Station`, a little more.

    What a task asks for, observes and rewards stands in the docstring of its challenge: `Miswired`, `Prey`, `Station`,
    `FailBlind`, `ObstTrap`, `Prizes`, `SimToReal`. Actions, masks and everything else are those of `SeastarSwimEnv`.

    ## Splits
    An episode is a number, and what is drawn for it follows from its split and its number alone. A reset draws the
    number, from two billion in the split "train", from a thousand in "test". `info["instance"]` tells it, and
    `reset(options={"instance": number})` swims a certain one. The splits share no episode.

    ## Arguments
    task: Name of a challenge, or a challenge with numbers of your own, as an object or in plain form.
    split: Which episodes are drawn: "train" or "test".
    actions, fidelity, decision_period: See `SeastarSwimEnv`.
    render_mode: See `SeastarSwimEnv`. Pictures show what the robot is not told.
    frames_per_stroke: See `SeastarSwimEnv`.
    sight: See `SeastarSwimEnv`; `SimToReal` has one of its own. What a task shows besides the robot, such as prey, is
        not late.
    action_delay: See `SeastarSwimEnv`.
    """

    _option = "instance"

    def __init__(
        self,
        task: Challenge | Plain | str = "miswired",
        split: Split = "train",
        actions: Actions = "pairs",
        fidelity: Fidelity | None = None,
        decision_period: float | None = None,
        render_mode: RenderMode | None = None,
        frames_per_stroke: int | None = None,
        sight: Sight | Plain | None = None,
        action_delay: Drawn | Plain = 0.0,
    ):
        self._set_pictures(render_mode, frames_per_stroke)
        self.challenge, self.task, self.split = read_challenge(task), task, split
        options = _options(actions, fidelity, decision_period, sight, action_delay)
        self._begin_with(self.challenge.swimming(options, 1, 1, split), frames_per_stroke)

    _arguments = arguments_of(__init__)


class SeastarTaskVectorEnv(SeastarSwimVectorEnv):
    """Environment of `num_envs` robots side by side, with the bits of one `SeastarTaskEnv` each.

    Batches are those of `SeastarSwimVectorEnv`, tasks those of `SeastarTaskEnv`. `reset(options={"instance": ...})`
    takes one number for all robots, or one for each.

    ## Arguments besides those of `SeastarTaskEnv`
    num_envs, max_episode_steps, autoreset_mode, threads, disable_env_checker: See `SeastarSwimVectorEnv`.
    """

    _option = "instance"

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        task: Challenge | Plain | str = "miswired",
        split: Split = "train",
        actions: Actions = "pairs",
        fidelity: Fidelity | None = None,
        decision_period: float | None = None,
        render_mode: Literal["rgb_array"] | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        sight: Sight | Plain | None = None,
        action_delay: Drawn | Plain = 0.0,
        frames_per_stroke: int | None = None,
        disable_env_checker: bool | None = None,
    ):
        self._set_batch(
            num_envs, max_episode_steps, render_mode, autoreset_mode, threads, frames_per_stroke, disable_env_checker
        )
        self.challenge, self.task, self.split = read_challenge(task), task, split
        options = _options(actions, fidelity, decision_period, sight, action_delay)
        self._begin_with(self.challenge.swimming(options, num_envs, threads, split))

    _arguments = arguments_of(__init__)
