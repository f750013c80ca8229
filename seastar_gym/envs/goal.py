"""Goal form of the environment of one robot, for learners that change goals in hindsight (HER)."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from seastar_gym.envs.headings import wrapped
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.stations import heading_of
from seastar_gym.envs.symmetry import OF_OBSERVATIONS, require_plain
from seastar_gym.scene.checks import as_floats, require_kind

Floats = NDArray[np.float64]
GoalObservation = dict[str, Floats]

SERVED = (
    "SeastarSwim-v0", "SeastarSwimContinuous-v0", "SeastarSwimTimed-v0", "SeastarSwimTimedModerate-v0",
    "SeastarSwimTimedHard-v0", "SeastarSwimHeading-v0", "SeastarMiswired-v0", "SeastarMiswiredTimed-v0",
)  # fmt: skip
"""Ids that have a goal form: whose robots are to reach waypoints, and nothing else."""


class GoalForm(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Wrapper whose observations name the goal, in the form of Gymnasium-Robotics and of `HerReplayBuffer`.

    | key             | shape    | meaning                                                               | unit      |
    |-----------------|----------|-----------------------------------------------------------------------|-----------|
    | `observation`   | `(n,)`   | observation without its waypoints and asked headings, then cosine and | see there |
    |                 |          | sine of the body frame's direction in the world                       |           |
    | `achieved_goal` | `(k,)`   | position of the hub in the world: x, y                                | 0.1 m     |
    | `desired_goal`  | `(k,)`   | current waypoint in the world: x, y                                   | 0.1 m     |

    0.1 m is the length of a limb, and k is 2. With `headings` k is 4: cosine and sine follow, of the body frame's
    direction and of the asked one. The reward is 0 where the waypoint of the decision is reached, and -1 elsewhere;
    everything else is that of `SeastarSwimEnv`.

    It serves `SERVED`: `SeastarSwim-v0`, the same with continuous commands, the timed environments, that with headings,
    and `SeastarMiswired`, without `sight`. Wrappers that change observations belong around it.
    """

    _goal: Floats

    def __init__(self, env: gym.Env[NDArray[np.float32], Any]):
        require_kind("env", env, gym.Env, "an environment of waypoints")
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        swim = env.unwrapped
        if not isinstance(swim, SeastarSwimEnv):
            raise ValueError(f"GoalForm needs an environment of waypoints, not {swim}: one of {', '.join(SERVED)}.")
        if not swim.task.goals_are_waypoints:
            raise ValueError(f"In {swim} waypoints are not all that counts: GoalForm serves {', '.join(SERVED)}.")
        if swim.sight is not None:
            raise ValueError("GoalForm tells where the hub is, which no camera knows: leave out sight.")
        require_plain(env, "GoalForm", OF_OBSERVATIONS)
        self._swim = swim
        self._length = float(swim.scene.robot.limb_length)
        at, places = swim.layout, np.arange(swim.layout.size)
        self._without_goals = np.setdiff1d(places, np.concatenate([places[at.waypoints], places[at.headings]]))
        size = 2 if swim.headings is None else 4
        shapes = {"observation": (len(self._without_goals) + 2,), "achieved_goal": (size,), "desired_goal": (size,)}
        self.observation_space = spaces.Dict(
            {name: spaces.Box(-np.inf, np.inf, shape, np.float64) for name, shape in shapes.items()}
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[GoalObservation, dict[str, Any]]:
        """Begin an episode."""
        seen, info = self.env.reset(seed=seed, options=options)
        return self._observed(seen, info), info

    def step(self, action: Any) -> tuple[GoalObservation, float, bool, bool, dict[str, Any]]:
        """Swim for one decision; the reward is that of the goal before it."""
        seen, _, terminated, truncated, info = self.env.step(action)
        goal, observed = self._goal, self._observed(seen, info)
        reward = float(self.compute_reward(observed["achieved_goal"], goal, info))
        return observed, reward, terminated, truncated, info

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Floats:
        """Rewards, shape (...), of goals of shape (..., k); info, of one or of all, is not needed."""
        achieved, desired = as_floats("achieved_goal", achieved_goal), as_floats("desired_goal", desired_goal)
        shape = self.observation_space["desired_goal"].shape  # type: ignore[index]
        if achieved.shape != desired.shape or achieved.shape[-1:] != shape:
            raise ValueError(f"Goals must have one shape (..., {shape[0]}), not {achieved.shape} and {desired.shape}.")
        away = achieved - desired
        reached = (
            np.hypot(away[..., 0], away[..., 1]) <= self._swim.task.radius_of(self._swim._robots, 0) / self._length
        )
        if self._swim.headings is not None:
            now, asked = (np.arctan2(goals[..., 3], goals[..., 2]) for goals in (achieved, desired))
            reached &= np.abs(wrapped(asked - now)) <= self._swim.headings.tolerance
        return np.where(reached, 0.0, -1.0)

    def _observed(self, seen: NDArray[np.float32], info: dict[str, Any]) -> GoalObservation:
        waypoints, headings, heading = (
            self._swim.waypoints,
            self._swim.task.headings_of(self._swim._robots, 0),
            heading_of(self._swim.simulator)[0],
        )
        k, direction = min(info["waypoint_index"], len(waypoints) - 1), _direction(heading)
        achieved, self._goal = info["hub_position"] / self._length, waypoints[k] / self._length
        if headings is not None:
            achieved, self._goal = np.append(achieved, direction), np.append(self._goal, _direction(headings[k]))
        rest = seen[self._without_goals].astype(np.float64)
        return {
            "observation": np.append(rest, direction), "achieved_goal": achieved, "desired_goal": self._goal.copy(),
        }  # fmt: skip


def _direction(angle: float) -> Floats:
    return np.array([np.cos(angle), np.sin(angle)])
