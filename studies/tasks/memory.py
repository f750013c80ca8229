"""Memory of past observations for learners without one, under the symmetry of the robot."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.own_numbers import places_of
from seastar_gym.envs.stations import N_STATIONS
from seastar_gym.envs.symmetry import observed_mirror, restore_actions, sectors, transform_observations

Floats32 = NDArray[np.float32]
if TYPE_CHECKING:
    _VectorWrapper = gym.vector.VectorWrapper[Any, Any, Any, Any, Any]
else:
    _VectorWrapper = gym.vector.VectorWrapper


class VectorMemory(_VectorWrapper):
    """Wrapper of a native batch that shows the present observation, and what was most telling of the last ones.

    Of every past observation, it keeps the tips of the limbs, the hub's velocity, the numbers of the limbs (last
    commands among them) and the targets. All of them are turned and mirrored by the element that brings the present
    target into sector 0, so that limbs have the same places throughout. At the beginning of an episode, the past is the
    first observation. Where a task shows no limbs, all of every past observation is kept.

    past: Number of past observations.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any], past: int):
        super().__init__(env)
        inner: Any = env.unwrapped
        self._actions, self._n_limbs = inner.actions, inner.scene.robot.n_limbs
        self._mirror, self._own = observed_mirror(inner), inner.own_numbers
        at = places_of(self._n_limbs, len(self._mirror) * self._n_limbs, self._own)
        tips = [2 * N_STATIONS * (limb + 1) + k for limb in range(self._n_limbs) for k in (-2, -1)]
        hub_velocity = at.stations_and_hub.stop - 2
        self._told = np.array([*tips, *range(hub_velocity, at.size)]) if self._own.with_stations else np.arange(at.size)
        self._past = np.zeros((env.num_envs, past, at.size), np.float32)
        self._elements = np.zeros(env.num_envs, np.intp)
        shape = (at.size + past * len(self._told),)
        self.single_observation_space = gym.spaces.Box(-np.inf, np.inf, shape, np.float32)
        self.observation_space = gym.vector.utils.batch_space(self.single_observation_space, env.num_envs)

    def _shown(self, observations: Floats32, past: Floats32) -> tuple[Floats32, NDArray[np.intp]]:
        """What is shown of observations, shape (n, size), and of those before, (n, past, size); and the elements."""
        elements = sectors(observations, self._n_limbs, self._mirror, own=self._own)
        every = np.concatenate([observations[:, None], past], axis=1)
        alike = np.repeat(elements[:, None], every.shape[1], axis=1)
        reduced = transform_observations(every, alike, self._n_limbs, self._mirror, own=self._own)
        n = len(observations)
        shown = np.concatenate([reduced[:, 0], reduced[:, 1:, self._told].reshape(n, -1)], axis=1)
        return shown.astype(np.float32), elements

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        observations, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        self._past[:] = observations[:, None]
        self._latest = observations
        shown, self._elements = self._shown(observations, self._past)
        return shown, info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Swim for one decision by actions that were chosen on what was shown last."""
        restored = restore_actions(actions, self._elements, self._actions, self._n_limbs)
        observations, rewards, terminated, truncated, info = self.env.step(restored)
        self._past = np.concatenate([self._latest[:, None], self._past[:, :-1]], axis=1)
        begun = np.zeros(self.num_envs, bool)
        if "final_obs" in info:
            begun = info["_final_obs"]
            final = info["final_obs"].copy()
            shown, _ = self._shown(np.stack(list(final[begun])), self._past[begun])
            for robot, last in zip(np.flatnonzero(begun), shown, strict=True):
                final[robot] = last
            info = {**info, "final_obs": final}
        self._past[begun] = observations[begun, None]
        self._latest = observations
        shown, self._elements = self._shown(observations, self._past)
        return shown, rewards, terminated, truncated, info


Wrap = Callable[[gym.vector.VectorEnv[Any, Any, Any]], gym.vector.VectorEnv[Any, Any, Any]]
"""What a learner puts around a batch."""
