"""Wrappers that reduce `SeastarSwim-v0` and the timed environments to one sector, for any learner.

A robot has the sectors of its own symmetry, see the package's docstring.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.commands import Actions
from seastar_gym.envs.own_numbers import OwnNumbers
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry.actions import restore_actions
from seastar_gym.envs.symmetry.group import Elements, Group
from seastar_gym.envs.symmetry.masks import transform_masks
from seastar_gym.envs.symmetry.observations import reduce_observations
from seastar_gym.envs.symmetry.scenes import memory_mirror, require_symmetry, symmetry_of
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.actuators.actuator import Mirror
from seastar_gym.scene.checks import require_kind

if TYPE_CHECKING:
    _VectorWrapper = gym.vector.VectorWrapper[Any, Any, Any, Any, Any]
else:
    _VectorWrapper = gym.vector.VectorWrapper  # not generic in gymnasium 1.2


class Kind(NamedTuple):
    """What the symmetry has to know of an environment: mode, group, mirror of observed memory, and what is added."""

    mode: Actions
    group: Group
    mirror: Mirror
    with_headings: bool
    own: OwnNumbers

    def reduce(self, observations: NDArray[Any]) -> tuple[NDArray[np.floating[Any]], Elements]:
        """Reduced observations, and the elements that reduced them."""
        return reduce_observations(observations, self.group, self.mirror, self.with_headings, self.own)

    def restore(self, actions: Any, elements: Elements) -> Any:
        """Actions of the robots as they are."""
        return restore_actions(actions, elements, self.mode, self.group)

    def mask(self, masks: NDArray[Any], elements: Elements) -> NDArray[Any]:
        """Masks of reduced robots."""
        return transform_masks(masks, elements, self.mode, self.group)

    def mask_info(self, info: dict[str, Any], elements: Elements) -> dict[str, Any]:
        """Info with the masks of reduced robots, if it has any."""
        return {**info, "action_mask": self.mask(info["action_mask"], elements)} if "action_mask" in info else info


def kind_of(env: Any) -> Kind:
    """Kind of an environment or a batch; ValueError if its scene is not symmetric."""
    inner = getattr(env, "unwrapped", env)
    if not isinstance(inner, SeastarSwimEnv | SeastarSwimVectorEnv):
        raise ValueError(f"Symmetry is known of SeastarSwim-v0 and the timed environments alone, not of {inner!r}.")
    require_symmetry(inner.scene, inner.randomization)
    return Kind(
        inner.actions, symmetry_of(inner.scene), observed_mirror(inner), inner.headings is not None, inner.own_numbers
    )


def observed_mirror(env: Any) -> Mirror:
    """What a mirror does to the numbers that are observed of every limb of an environment or a batch."""
    mirror = memory_mirror(env.scene.actuator) if env.observe_actuators else ()
    return mirror + tuple((len(mirror) + index, sign) for index, sign in env.added_mirror)


class SymmetryReduction(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Wrapper that turns and mirrors observations so that the current waypoint lies in sector 0, and actions back.

    Masks of actions, in info and of `action_masks`, are those of the reduced robot.
    """

    def __init__(self, env: gym.Env[Any, Any]):
        require_kind("env", env, gym.Env, "an environment of one robot")
        gym.utils.RecordConstructorArgs.__init__(self)
        gym.Wrapper.__init__(self, env)
        self._kind = kind_of(env)
        self._element = np.zeros((), np.intp)

    def _reduced(self, observation: NDArray[np.float32]) -> NDArray[np.floating[Any]]:
        reduced, self._element = self._kind.reduce(observation)
        return reduced

    def action_masks(self) -> NDArray[np.bool_]:
        """Actions on the last reduced observation that the wires can follow, shape (k,)."""
        inner: Any = self.unwrapped
        return self._kind.mask(inner.action_masks(), self._element)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; the observation is reduced."""
        observation, info = self.env.reset(seed=seed, options=options)
        reduced = self._reduced(observation)
        return reduced, self._kind.mask_info(info, self._element)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Swim for one decision by an action that was chosen on the last reduced observation."""
        action = self._kind.restore(action, self._element)
        observation, reward, terminated, truncated, info = self.env.step(action)
        reduced = self._reduced(observation)
        return reduced, reward, terminated, truncated, self._kind.mask_info(info, self._element)


class VectorSymmetryReduction(_VectorWrapper):
    """Wrapper of the native batch that does for every robot what `SymmetryReduction` does for one.

    Observations in `info["final_obs"]` are turned and mirrored, too, each by its own element, and so are masks.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any]):
        require_kind("env", env, gym.vector.VectorEnv, "a batch, as gym.make_vec gives it")
        super().__init__(env)
        self._kind = kind_of(env)
        self._elements = np.zeros(env.num_envs, np.intp)

    def _reduced(self, observations: NDArray[np.float32]) -> NDArray[np.floating[Any]]:
        reduced, self._elements = self._kind.reduce(observations)
        return reduced

    def action_masks(self) -> NDArray[np.bool_]:
        """Actions on the last reduced observations that the wires can follow, shape (num_envs, k)."""
        inner: Any = self.unwrapped
        return self._kind.mask(inner.action_masks(), self._elements)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes; the observations are reduced."""
        observations, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        reduced = self._reduced(observations)
        return reduced, self._kind.mask_info(info, self._elements)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Swim for one decision with every robot, by actions that were chosen on the last reduced observations."""
        actions = self._kind.restore(actions, self._elements)
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        if "final_obs" in info:
            info = {**info, **self._reduced_final(info)}
        reduced = self._reduced(observations)
        return reduced, rewards, terminated, truncated, self._kind.mask_info(info, self._elements)

    def _reduced_final(self, info: dict[str, Any]) -> dict[str, Any]:
        """Last observations and infos of episodes that are over, of reduced robots."""
        final, elements = info["final_obs"].copy(), np.zeros(self.num_envs, np.intp)
        for robot in np.flatnonzero(info["_final_obs"]):
            final[robot], elements[robot] = self._kind.reduce(final[robot])
        return {"final_obs": final, "final_info": self._kind.mask_info(info["final_info"], elements)}
