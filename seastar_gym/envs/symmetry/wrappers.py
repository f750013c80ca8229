"""Wrappers that reduce `SeastarSwim-v0` and the timed environments to one sector, or remember, for any learner.

A robot has the sectors of its own symmetry, see the package's docstring.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from seastar_gym.envs.attributes import RobotsEnv
from seastar_gym.envs.commands import sampling_mask
from seastar_gym.envs.randomization import DomainRandomization
from seastar_gym.envs.symmetry.symmetry import FrameStack, Symmetry, memory_mirror, symmetry_of
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import Mirror, complete
from seastar_gym.scene.checks import require_kind
from seastar_gym.scene.shape import PointGroup

if TYPE_CHECKING:
    _VectorWrapper = gym.vector.VectorWrapper[Any, Any, Any, Any, Any]
else:
    _VectorWrapper = gym.vector.VectorWrapper  # not generic in gymnasium 1.2


def require_symmetry(scene: Scene, randomization: DomainRandomization | None = None) -> None:
    """ValueError for scenes, and draws of their numbers, that every turn and mirror would change.

    Drawn strengths of limbs are no reason: they have the same distribution for every limb.
    """
    why = next(_asymmetries(scene, () if randomization is None else randomization.distributions), None)
    if why is not None:
        raise ValueError(f"This scene has neither the symmetry of the regular polygon nor a lesser one: {why}.")


def _asymmetries(scene: Scene, drawn: Iterable[str]) -> Iterator[str]:
    """Reasons why a scene, some of whose numbers are drawn, is not symmetric."""
    group = symmetry_of(scene)
    if isinstance(group, PointGroup) and group.is_trivial:
        yield "its limbs are not alike, straight and evenly spread" + (
            "" if scene.robot.body is None else " around a body of their symmetry"
        )
    if len(set(scene.limb_strengths)) > 1:
        yield "its limbs are not equally strong"
    if complete(scene.actuator).mirror is None:
        yield "its actuators remember what they did, and do not say what a mirror makes of it (`mirror`)"
    if any(node != 0 for node in scene.held_nodes):
        yield "nodes of limbs are held"
    if scene.loads:
        yield "its nodes are loaded"
    for term in scene.terms:
        if not getattr(term, "isotropic", False):
            yield f"its own {type(term).__name__} does not say that turns and mirrors leave it (`isotropic = True`)"
    if scene.gravity is not None:
        yield "gravity has a direction"
    if scene.fluid is not None and scene.fluid.current is not None:
        yield "its water has a current"
    for name in drawn:
        if name.startswith("robot.limbs."):
            yield f"{name} is drawn for every limb by itself"


def symmetry_in(env: Any) -> Symmetry:
    """Symmetry of an environment or a batch; ValueError if its scene is not symmetric."""
    inner = getattr(env, "unwrapped", env)
    if not isinstance(inner, RobotsEnv):
        raise ValueError(f"Symmetry is known of SeastarSwim-v0 and the timed environments alone, not of {inner!r}.")
    require_symmetry(inner.scene, inner.randomization)
    return Symmetry(symmetry_of(inner.scene), observed_mirror(inner), inner.layout, inner.actions)


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
        self._symmetry = symmetry_in(env)
        self._element = np.zeros((), np.intp)

    def _reduced(self, observation: NDArray[np.float32]) -> NDArray[np.floating[Any]]:
        reduced, self._element = self._symmetry.reduce(observation)
        return reduced

    def action_masks(self) -> NDArray[np.bool_]:
        """Actions on the last reduced observation that the wires can follow, shape (k,)."""
        inner: Any = self.unwrapped
        return self._symmetry.carry_masks(inner.action_masks(), self._element)

    def sampling_mask(self) -> Any:
        """`action_masks` in the form that `action_space.sample(mask=...)` takes."""
        return sampling_mask(self.action_space, self.action_masks())

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; the observation is reduced."""
        observation, info = self.env.reset(seed=seed, options=options)
        reduced = self._reduced(observation)
        return reduced, self._symmetry.carry_info(info, self._element)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Swim for one decision by an action that was chosen on the last reduced observation."""
        action = self._symmetry.restore(action, self._element)
        observation, reward, terminated, truncated, info = self.env.step(action)
        reduced = self._reduced(observation)
        return reduced, reward, terminated, truncated, self._symmetry.carry_info(info, self._element)


class VectorSymmetryReduction(_VectorWrapper):
    """Wrapper of the native batch that does for every robot what `SymmetryReduction` does for one.

    Observations in `info["final_obs"]` are turned and mirrored, too, each by its own element, and so are masks.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any]):
        require_kind("env", env, gym.vector.VectorEnv, "a batch, as gym.make_vec gives it")
        super().__init__(env)
        self._symmetry = symmetry_in(env)
        self._elements = np.zeros(env.num_envs, np.intp)

    @property
    def elements(self) -> NDArray[np.intp]:
        """Elements that brought the last observations into sector 0, shape (num_envs,), a copy."""
        return self._elements.copy()

    def _reduced(self, observations: NDArray[np.float32]) -> NDArray[np.floating[Any]]:
        reduced, self._elements = self._symmetry.reduce(observations)
        return reduced

    def action_masks(self) -> NDArray[np.bool_]:
        """Actions on the last reduced observations that the wires can follow, shape (num_envs, k)."""
        inner: Any = self.unwrapped
        return self._symmetry.carry_masks(inner.action_masks(), self._elements)

    def sampling_mask(self) -> tuple[Any, ...]:
        """`action_masks` in the form that `single_action_space.sample(mask=...)` takes, for every robot."""
        return tuple(sampling_mask(self.single_action_space, mask) for mask in self.action_masks())

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes; the observations are reduced."""
        observations, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        reduced = self._reduced(observations)
        return reduced, self._symmetry.carry_info(info, self._elements)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Swim for one decision with every robot, by actions that were chosen on the last reduced observations."""
        actions = self._symmetry.restore(actions, self._elements)
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        if "final_obs" in info:
            info = {**info, **self._reduced_final(info)}
        reduced = self._reduced(observations)
        return reduced, rewards, terminated, truncated, self._symmetry.carry_info(info, self._elements)

    def _reduced_final(self, info: dict[str, Any]) -> dict[str, Any]:
        """Last observations and infos of episodes that are over, of reduced robots."""
        final, elements = info["final_obs"].copy(), np.zeros(self.num_envs, np.intp)
        for robot in np.flatnonzero(info["_final_obs"]):
            final[robot], elements[robot] = self._symmetry.reduce(final[robot])
        return {"final_obs": final, "final_info": self._symmetry.carry_info(info["final_info"], elements)}


class VectorFrameStack(VectorSymmetryReduction):
    """Wrapper of a native batch that shows a `FrameStack`, and takes actions that were chosen on it.

    At the beginning of an episode, the past is the first observation. Asked headings are not shown in the past.

    past: Number of past observations.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any], past: int):
        super().__init__(env)
        if self._symmetry.layout.asks_headings:
            raise ValueError("Asked headings have no place in this memory: take a task without them.")
        self.frame_stack = FrameStack(self._symmetry, past)
        self._over = np.zeros(env.num_envs, bool)  # robots whose next step begins an episode
        self._begins_later = env.metadata.get("autoreset_mode") == AutoresetMode.NEXT_STEP
        self._past = np.zeros((env.num_envs, past, self.frame_stack.layout.size), np.float32)
        self.single_observation_space = gym.spaces.Box(-np.inf, np.inf, (self.frame_stack.size,), np.float32)
        self.observation_space = gym.vector.utils.batch_space(self.single_observation_space, env.num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes, of those in `options["reset_mask"]` or of all."""
        observations, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        mask = (options or {}).get("reset_mask")
        begun = np.ones(self.num_envs, bool) if mask is None else np.asarray(mask)
        self._past[begun] = observations[begun, None]
        self._over[begun] = False
        self._latest = observations
        shown, self._elements = self.frame_stack.stacked(observations, self._past)
        return shown, self._symmetry.carry_info(info, self._elements)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Swim for one decision by actions that were chosen on what was shown last."""
        actions = self._symmetry.restore(actions, self._elements)
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        self._past = np.concatenate([self._latest[:, None], self._past[:, :-1]], axis=1)
        begun = self._over
        if self._begins_later:
            self._over = terminated | truncated
        elif "final_obs" in info:
            begun = info["_final_obs"]
            info = {**info, **self._shown_final(info)}
        self._past[begun] = observations[begun, None]
        self._latest = observations
        shown, self._elements = self.frame_stack.stacked(observations, self._past)
        return shown, rewards, terminated, truncated, self._symmetry.carry_info(info, self._elements)

    def _shown_final(self, info: dict[str, Any]) -> dict[str, Any]:
        """Last observations with their past, and masks, of episodes that are over."""
        over, final, elements = info["_final_obs"], info["final_obs"].copy(), np.zeros(self.num_envs, np.intp)
        shown, elements[over] = self.frame_stack.stacked(np.stack(list(final[over])), self._past[over])
        for robot, last in zip(np.flatnonzero(over), shown, strict=True):
            final[robot] = last
        return {"final_obs": final, "final_info": self._symmetry.carry_info(info["final_info"], elements)}
