"""Wrappers that reduce `SeastarSwim-v0` to one sector, for any learner."""

from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.commands import Actions
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry.actions import restore_actions
from seastar_gym.envs.symmetry.observations import reduce_observations
from seastar_gym.envs.symmetry.scenes import memory_mirror, require_symmetry
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.actuators.heating import Mirror

if TYPE_CHECKING:
    _VectorWrapper = gym.vector.VectorWrapper[Any, Any, Any, Any, Any]
else:
    _VectorWrapper = gym.vector.VectorWrapper  # not generic in gymnasium 1.2


def _mode_limbs_and_mirror(env: Any) -> tuple[Actions, int, Mirror]:
    """Action mode, number of limbs and `memory_mirror` of an environment or a batch; ValueError if not symmetric."""
    inner = getattr(env, "unwrapped", env)
    if not isinstance(inner, SeastarSwimEnv | SeastarSwimVectorEnv):
        raise ValueError(f"Symmetry is known of SeastarSwim-v0 alone, not of {inner!r}.")
    require_symmetry(inner.scene, inner.randomization)
    return inner.actions, inner.scene.robot.n_limbs, memory_mirror(inner.scene.actuator)


class SymmetryReduction(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Wrapper that turns and mirrors observations so that the current waypoint lies in sector 0, and actions back."""

    def __init__(self, env: gym.Env[Any, Any]):
        gym.utils.RecordConstructorArgs.__init__(self)
        gym.Wrapper.__init__(self, env)
        self._mode, self._n_limbs, self._mirror = _mode_limbs_and_mirror(env)
        self._element = np.zeros((), np.intp)

    def _reduced(self, observation: NDArray[np.float32]) -> NDArray[np.floating[Any]]:
        reduced, self._element = reduce_observations(observation, self._n_limbs, self._mirror)
        return reduced

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; the observation is reduced."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._reduced(observation), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Swim one stroke by an action that was chosen on the last reduced observation."""
        action = restore_actions(action, self._element, self._mode, self._n_limbs)
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._reduced(observation), reward, terminated, truncated, info


class VectorSymmetryReduction(_VectorWrapper):
    """Wrapper of the native batch that does for every robot what `SymmetryReduction` does for one.

    Observations in `info["final_obs"]` are turned and mirrored, too, each by its own element.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any]):
        super().__init__(env)
        self._mode, self._n_limbs, self._mirror = _mode_limbs_and_mirror(env)
        self._elements = np.zeros(env.num_envs, np.intp)

    def _reduced(self, observations: NDArray[np.float32]) -> NDArray[np.floating[Any]]:
        reduced, self._elements = reduce_observations(observations, self._n_limbs, self._mirror)
        return reduced

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes; the observations are reduced."""
        observations, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        return self._reduced(observations), info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Swim one stroke with every robot, by actions that were chosen on the last reduced observations."""
        actions = restore_actions(actions, self._elements, self._mode, self._n_limbs)
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        if "final_obs" in info:
            final = info["final_obs"].copy()
            for robot in np.flatnonzero(info["_final_obs"]):
                final[robot], _ = reduce_observations(final[robot], self._n_limbs, self._mirror)
            info = {**info, "final_obs": final}
        return self._reduced(observations), rewards, terminated, truncated, info
