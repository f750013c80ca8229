"""Memory of past observations, under the symmetry of the robot: for learners and policies without a state of their own.

The limbs of a robot are renamed from one decision to the next as the waypoint moves from sector to sector. Here all
past observations are carried by the element of the present one, so that limbs have the same places throughout.
"""

from functools import cached_property
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from seastar_gym.envs.own_numbers import NO_MORE, OwnNumbers, Places, places_of
from seastar_gym.envs.stations import N_STATIONS
from seastar_gym.envs.symmetry.group import Elements, Group, n_limbs_of, require_group, require_mirror
from seastar_gym.envs.symmetry.observations import sectors, transform_observations
from seastar_gym.envs.symmetry.wrappers import kind_of
from seastar_gym.scene.actuators.actuator import Mirror
from seastar_gym.scene.checks import require_count, require_kind

if TYPE_CHECKING:
    _VectorWrapper = gym.vector.VectorWrapper[Any, Any, Any, Any, Any]
else:
    _VectorWrapper = gym.vector.VectorWrapper  # not generic in gymnasium 1.2

MOST_PAST = 1000
"""Largest number of past observations that can be remembered."""


class Recollection:
    """What a controller with memory sees: the present observation, and what was most telling of the last ones.

    Of every past observation it keeps the tips of the limbs, the hub's velocity, the numbers of the limbs (last
    commands among them) and the targets. Where a task shows no limbs, all of every past observation is kept.

    group: Symmetry of the robot. mirror: What a mirror does to the numbers that are observed of every limb.
    own: What the task shows of its own. past: Number of past observations.
    """

    def __init__(self, group: Group, mirror: Mirror, own: OwnNumbers = NO_MORE, past: int = 1):
        require_group(group)
        require_mirror(mirror)
        require_kind("own", own, OwnNumbers, "OwnNumbers")
        require_count("past", past, 1, MOST_PAST)
        self.group, self.mirror, self.own, self.past = group, mirror, own, int(past)

    @cached_property
    def places(self) -> Places:
        """Places in one observation."""
        n_limbs = n_limbs_of(self.group)
        return places_of(n_limbs, len(self.mirror) * n_limbs, self.own)

    @cached_property
    def told(self) -> NDArray[np.intp]:
        """Places of the numbers that are kept of a past observation."""
        if not self.own.with_stations:
            return np.arange(self.places.size)
        tips = [2 * N_STATIONS * (limb + 1) + k for limb in range(n_limbs_of(self.group)) for k in (-2, -1)]
        hub_velocity = self.places.stations_and_hub.stop - 2
        return np.array([*tips, *range(hub_velocity, self.places.size)])

    @property
    def size(self) -> int:
        """Length of what is shown."""
        return self.places.size + self.past * len(self.told)

    def shown(self, observations: NDArray[Any], past: NDArray[Any]) -> tuple[NDArray[np.float32], Elements]:
        """What is shown of observations, shape (n, size), and the elements that brought their targets into sector 0.

        observations: Present ones, shape (n, places.size). past: Those before, latest first, (n, past, places.size).
        """
        elements = sectors(observations, self.group, self.mirror, own=self.own)
        every = np.concatenate([observations[:, None], past], axis=1)
        alike = np.repeat(elements[:, None], every.shape[1], axis=1)
        reduced = transform_observations(every, alike, self.group, self.mirror, own=self.own)
        n = len(observations)
        shown = np.concatenate([reduced[:, 0], reduced[:, 1:, self.told].reshape(n, -1)], axis=1)
        return shown.astype(np.float32), elements


class VectorMemory(_VectorWrapper):
    """Wrapper of a native batch that shows a `Recollection`, and takes actions that were chosen on it.

    At the beginning of an episode, the past is the first observation. Asked headings are not shown in the past.

    past: Number of past observations.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any], past: int):
        require_kind("env", env, gym.vector.VectorEnv, "a batch, as gym.make_vec gives it")
        super().__init__(env)
        self._kind = kind = kind_of(env)
        if kind.with_headings:
            raise ValueError("Asked headings have no place in this memory: take a task without them.")
        self.recollection = Recollection(kind.group, kind.mirror, kind.own, past)
        self._over = np.zeros(env.num_envs, bool)  # robots whose next step begins an episode
        self._begins_later = env.metadata.get("autoreset_mode") == AutoresetMode.NEXT_STEP
        self._past = np.zeros((env.num_envs, past, self.recollection.places.size), np.float32)
        self._elements = np.zeros(env.num_envs, np.intp)
        self.single_observation_space = gym.spaces.Box(-np.inf, np.inf, (self.recollection.size,), np.float32)
        self.observation_space = gym.vector.utils.batch_space(self.single_observation_space, env.num_envs)

    def action_masks(self) -> NDArray[np.bool_]:
        """Actions on what was shown last that the wires can follow, shape (num_envs, k)."""
        inner: Any = self.unwrapped
        return self._kind.mask(inner.action_masks(), self._elements)

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
        shown, self._elements = self.recollection.shown(observations, self._past)
        return shown, self._kind.mask_info(info, self._elements)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Swim for one decision by actions that were chosen on what was shown last."""
        actions = self._kind.restore(actions, self._elements)
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
        shown, self._elements = self.recollection.shown(observations, self._past)
        return shown, rewards, terminated, truncated, self._kind.mask_info(info, self._elements)

    def _shown_final(self, info: dict[str, Any]) -> dict[str, Any]:
        """Last observations with their past, and masks, of episodes that are over."""
        over, final, elements = info["_final_obs"], info["final_obs"].copy(), np.zeros(self.num_envs, np.intp)
        shown, elements[over] = self.recollection.shown(np.stack(list(final[over])), self._past[over])
        for robot, last in zip(np.flatnonzero(over), shown, strict=True):
            final[robot] = last
        return {"final_obs": final, "final_info": self._kind.mask_info(info["final_info"], elements)}
