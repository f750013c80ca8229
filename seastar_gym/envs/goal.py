"""Goal form of the environment of one robot, for learners that change goals in hindsight (HER)."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.stations import heading_of
from seastar_gym.scene.checks import as_floats, require_kind

GoalObservation = dict[str, NDArray[np.float64]]


class GoalForm(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Wrapper whose observations name the goal, in the form of Gymnasium-Robotics and of `HerReplayBuffer`.

    | key             | shape         | meaning                                                         | unit      |
    |-----------------|---------------|-----------------------------------------------------------------|-----------|
    | `observation`   | `(size - 2,)` | observation without its waypoints, then cosine and sine of the  | see there |
    |                 |               | body frame's direction in the world                             |           |
    | `achieved_goal` | `(2,)`        | position of the hub in the world: x, y                          | 0.1 m     |
    | `desired_goal`  | `(2,)`        | current waypoint in the world: x, y                             | 0.1 m     |

    size is that of the wrapped environment's observation, 0.1 m the length of a limb. The reward is 0 where the hub
    reaches the goal of the decision, and -1 elsewhere; everything else is that of `SeastarSwimEnv`.
    """

    def __init__(self, env: gym.Env[NDArray[np.float32], Any]):
        require_kind("env", env, gym.Env, "an environment of waypoints")
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        swim = env.unwrapped
        if not isinstance(swim, SeastarSwimEnv):
            raise ValueError(f"GoalForm needs an environment of waypoints, not {swim}.")
        if swim._task.options.sight is not None:
            raise ValueError("GoalForm tells where the hub is, which no camera knows: leave out sight.")
        self._swim = swim
        self._length = float(swim.scene.robot.limb_length)
        self._radius = float(swim._task.waypoint_radius) / self._length
        self._without_waypoints = np.delete(np.arange(swim.layout.size), swim.layout.waypoints)
        shapes = {"observation": (len(self._without_waypoints) + 2,), "achieved_goal": (2,), "desired_goal": (2,)}
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
        goal = self._goal
        seen, _, terminated, truncated, info = self.env.step(action)
        observed = self._observed(seen, info)
        reward = float(self.compute_reward(observed["achieved_goal"], goal, info))
        return observed, reward, terminated, truncated, info

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> NDArray[np.float64]:
        """Rewards, shape (...), of goals of shape (..., 2); info is not needed."""
        achieved, desired = as_floats("achieved_goal", achieved_goal), as_floats("desired_goal", desired_goal)
        if achieved.shape != desired.shape or achieved.shape[-1:] != (2,):
            raise ValueError(f"Goals must have one shape (..., 2), not {achieved.shape} and {desired.shape}.")
        distance = np.linalg.norm(achieved - desired, axis=-1)
        return np.where(distance <= self._radius, 0.0, -1.0)

    def _observed(self, seen: NDArray[np.float32], info: dict[str, Any]) -> GoalObservation:
        waypoints = self._swim.waypoints
        self._goal = waypoints[min(info["waypoint_index"], len(waypoints) - 1)] / self._length
        heading = heading_of(self._swim.simulator)[0]
        rest = seen[self._without_waypoints].astype(np.float64)
        return {
            "observation": np.append(rest, [np.cos(heading), np.sin(heading)]),
            "achieved_goal": info["hub_position"] / self._length,
            "desired_goal": self._goal,
        }
