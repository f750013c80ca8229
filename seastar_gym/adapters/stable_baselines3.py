"""Stable-Baselines3's `VecEnv` over the native batch."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from types import FrameType
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices, VecEnvObs, VecEnvStepReturn

from seastar_gym.envs.vector import SeastarSwimVectorEnv, robot_by_robot

Info = dict[str, Any]

LONGEST_ROLLOUT = 16_384
"""Decisions of a rollout beyond which somebody is told: 200,000 of them have few updates then."""
DRAWN = 16
"""Robots in a picture of the batch: of more, none could be recognised."""
HOW_TO_MAKE = (
    'BatchVecEnv(gym.make_vec("SeastarSwim-v0", 16, vectorization_mode="vector_entry_point", '
    'autoreset_mode="SameStep"))'
)


class BatchVecEnv(VecEnv):
    """A Gymnasium vector environment that returns fresh arrays, autoreset SAME_STEP, for Stable-Baselines3.

    Gives what its `DummyVecEnv` of single environments behind a `Monitor` gives: fresh arrays every step, and at the
    end of an episode `terminal_observation`, `TimeLimit.truncated` and `episode` (return `r`, length `l`, seconds `t`)
    in that robot's info. The robots share one environment, so methods are the batch's own, and attributes can be set
    for all of them only. For the same reason `make_vec_env(..., vec_env_cls=BatchVecEnv)` is refused. With render_mode
    "rgb_array" the first DRAWN robots are drawn, side by side.

    seconds_in_steps: Time spent in the steps so far [s], the simulator's share of a training.
    """

    actions: NDArray[Any]

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any]):
        if not isinstance(env, gym.vector.VectorEnv):
            raise ValueError(
                "BatchVecEnv wraps one batch, not functions that make single environments, as make_vec_env gives them: "
                f"{HOW_TO_MAKE}."
            )
        mode = env.metadata.get("autoreset_mode")
        if mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"Stable-Baselines3 needs autoreset_mode=AutoresetMode.SAME_STEP, not {mode}.")
        if getattr(env.unwrapped, "on_device", False):
            raise ValueError("Stable-Baselines3 needs observations on the processor: make the batch without on_device.")
        self.env = env
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata = {**env.metadata, **self.metadata}
        self.seconds_in_steps = 0.0
        self._started = time.time()
        self._returns = np.zeros(self.num_envs)
        self._lengths = np.zeros(self.num_envs, np.int64)

    def reset(self) -> VecEnvObs:
        """Begin episodes of all robots, with the seeds and options set for this reset."""
        _warn_of_long_rollouts(self.num_envs)
        options = self._options[0]
        if any(other is not options for other in self._options if other or options):
            raise ValueError("The robots share one environment: set_options takes one dictionary for all of them.")
        seeds = None if self._seeds[0] is None else list(self._seeds)
        observations, info = self.env.reset(seed=seeds, options=options or None)  # type: ignore[arg-type]
        self._reset_seeds()
        self._reset_options()
        self._returns[:] = 0.0
        self._lengths[:] = 0
        self.reset_infos = _one_per_robot(info, self.num_envs)
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions of the next `step_wait`."""
        self.actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """One decision of every robot."""
        began = time.perf_counter()
        observations, rewards, terminated, truncated, info = self.env.step(self.actions)
        self.seconds_in_steps += time.perf_counter() - began
        dones = terminated | truncated
        self._returns += rewards
        self._lengths += 1
        infos = _one_per_robot(info, self.num_envs)
        if dones.any():
            final_infos = _one_per_robot(info["final_info"], self.num_envs)
            for robot in np.flatnonzero(dones).tolist():
                self.reset_infos[robot] = infos[robot]
                infos[robot] = {
                    **infos[robot],  # what a wrapper tells, as far as the batch's own last info has it not
                    **final_infos[robot],
                    "terminal_observation": info["final_obs"][robot],
                    "episode": self._end_episode(robot),
                }
        for robot, only_truncated in enumerate((truncated & ~terminated).tolist()):
            infos[robot]["TimeLimit.truncated"] = only_truncated
        return observations, rewards.astype(np.float32), dones, infos

    def _end_episode(self, robot: int) -> Info:
        """The statistics that a `Monitor` gives."""
        statistics = {
            "r": round(float(self._returns[robot]), 6),
            "l": int(self._lengths[robot]),
            "t": round(time.time() - self._started, 6),
        }
        self._returns[robot] = 0.0
        self._lengths[robot] = 0
        return statistics

    def close(self) -> None:
        """Close the batch."""
        self.env.close()

    def layers(self) -> list[gym.vector.VectorEnv[Any, Any, Any]]:
        """The environment and what it wraps, outermost first."""
        layers = [self.env]
        while isinstance(layers[-1], gym.vector.VectorWrapper):
            layers.append(layers[-1].env)
        return layers

    def _owner(self, name: str) -> gym.vector.VectorEnv[Any, Any, Any]:
        for layer in self.layers():
            if hasattr(layer, name):
                return layer
        raise AttributeError(f"{self.env} has no attribute {name!r}.")

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The attribute of every robot asked for."""
        owner = self._owner(attr_name)
        value = getattr(owner, attr_name)
        values: Sequence[Any] = [value] * self.num_envs
        if isinstance(owner, SeastarSwimVectorEnv) and not callable(value):
            values = owner.get_attr(attr_name)
        return [values[robot] for robot in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the batch, on the layer that has it."""
        if len(set(self._get_indices(indices))) != self.num_envs:
            raise ValueError("The robots share one environment: an attribute can only be set for all of them.")
        layers = [layer for layer in self.layers() if hasattr(layer, attr_name)]
        setattr(layers[0] if layers else self.env.unwrapped, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call the batch's method, once; what every robot asked for has of its result, see `robot_by_robot`."""
        result = getattr(self._owner(method_name), method_name)(*method_args, **method_kwargs)
        of_all = robot_by_robot(method_name, result, self.num_envs)
        return [of_all[robot] for robot in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """Whether the batch is wrapped so; a Monitor counts as present, because its statistics are."""
        wrapped = issubclass(wrapper_class, Monitor) or any(isinstance(one, wrapper_class) for one in self.layers())
        return [wrapped] * len(list(self._get_indices(indices)))

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Pictures of the first DRAWN robots."""
        batch = self.env.unwrapped
        if self.render_mode is None or not isinstance(batch, SeastarSwimVectorEnv):
            return [None] * self.num_envs
        return batch.render_robots(range(min(DRAWN, self.num_envs))) or ()


def _warn_of_long_rollouts(n_robots: int) -> None:
    """Warn the learner that resets a batch, if one does, where its rollout is so long that it hardly updates."""
    frame: FrameType | None = sys._getframe(1)
    while (frame := frame and frame.f_back) is not None:
        learner = frame.f_locals.get("self")
        if isinstance(learner, OnPolicyAlgorithm):
            if learner.n_steps * n_robots > LONGEST_ROLLOUT:
                gym.logger.warn(
                    f"{type(learner).__name__} updates once in {learner.n_steps * n_robots:,} decisions, a rollout of "
                    f"{n_robots} robots: give it n_steps={max(1, 2048 // n_robots)}, which makes it about 2,048."
                )
            return


def _one_per_robot(info: Info, n_robots: int) -> list[Info]:
    """A batch's info as one per robot: plain numbers, and an array for a vector. What is of no robot, all have.

    Masks, and what the adapter makes itself, final values and statistics of episodes, are left out.
    """
    own = "final_obs", "final_info", "episode"
    names = [name for name in info if not name.startswith("_") and name not in own]
    if not names:
        return [{} for _ in range(n_robots)]
    columns = [_column(info[name], n_robots) for name in names]
    return [dict(zip(names, values, strict=True)) for values in zip(*columns, strict=True)]


def _column(values: Any, n_robots: int) -> list[Any]:
    """What every robot has of an entry of a batch's info, which a wrapper may have put there."""
    if isinstance(values, np.ndarray) and values.ndim == 1 and len(values) == n_robots:
        found: list[Any] = values.tolist()
        return found
    has_all = isinstance(values, list | tuple) or (isinstance(values, np.ndarray) and values.ndim > 1)
    return list(values) if has_all and len(values) == n_robots else [values] * n_robots
