"""`SeastarSwim-v0` as a native batch: all robots in one simulator, with the bits of one environment each."""

from collections.abc import Iterable, Sequence
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from seastar_gym.accuracy.info import warn_uncertified
from seastar_gym.envs.batch_attributes import BatchAttributes
from seastar_gym.envs.batch_info import Info, of_some, with_masks
from seastar_gym.envs.batch_pictures import BatchPictures, Picture
from seastar_gym.envs.buffers import Buffers, require_buffers
from seastar_gym.envs.commands import as_array, to_commands, unless_strokes
from seastar_gym.envs.masks import sampling_mask
from seastar_gym.envs.options import SwimOptions, with_options
from seastar_gym.envs.seastar_swim import FRAMES_PER_SECOND, MOST_ASKED_FRAMES, frames_of_a_decision, render_fps
from seastar_gym.envs.swimming import Swimming
from seastar_gym.envs.task import SwimTask
from seastar_gym.envs.task_env import arguments_of, checked_options
from seastar_gym.scene.checks import is_whole_number, require_choice, require_count, require_flag, require_seed, shown
from seastar_gym.simulator.simulator import MAX_ROBOTS

Observations = NDArray[np.float32]
Flags = NDArray[np.bool_]

LONGEST = 2**63 - 1
"""Largest time limit, which is none [decisions]."""


class SeastarSwimVectorEnv(BatchAttributes, gym.vector.VectorEnv[Observations, Any, Any]):
    """Environment of `num_envs` robots side by side; `SeastarSwimEnv` documents spaces, rewards, info and arguments.

    Robot i has the seed `seed + i` and is bit-identical to a `SeastarSwimEnv` with that seed and the same actions.
    Arrays of actions, observations, rewards and flags have a first axis of length `num_envs`, and so have the entries
    of `info`; `info["_name"]` is the mask of the robots for which `info["name"]` is valid.

    ## Arguments besides those of `SeastarSwimEnv`
    num_envs: Number of robots.
    max_episode_steps: Time limit [decisions], applied here; None or -1 for none.
    autoreset_mode: When an episode that is over is followed by the next one. NEXT_STEP (default): the next step ignores
        the robot's action and returns the first observation of its next episode with reward 0. SAME_STEP: the step that
        ends an episode returns the first observation of the next one, and puts the last observation and info into
        `info["final_obs"]` and `info["final_info"]`. DISABLED: `reset` with `options={"reset_mask": ...}` is needed
        before the next step.
    threads: Number of threads of the simulator; by default one for every processor.
    on_device: Whether observations are made on the `device` and stay there: arrays of CuPy on "cuda", which
        `torch.from_dlpack` takes without a copy. Rewards, flags and info are NumPy arrays. Results are bit-identical.
    render_mode: "rgb_array": `render` returns a picture of every robot, the smaller the more there are;
        `render_robots` draws some of them.
    frames_per_stroke, disable_env_checker: As for `gym.make`, without effect: a picture shows the end of a decision,
        and batches have no checker.

    ## Memory
    Arrays that a step returns are new, and the environment keeps no reference to them, so a learner may keep them as
    they are. With `step(actions, out=Buffers(...))` observations, rewards and flags are written into the given arrays,
    such as rows of a learner's memory, see `seastar_gym.envs.buffers`.

    Whatever Gymnasium's `SyncVectorEnv` of `SeastarSwimEnv` takes and gives, this batch takes and gives, but that
    `call("reset")` and `call("step")` are refused. `call` and `get_attr` give what each robot has of its own (see
    `OF_EACH_ROBOT` in `batch_attributes`) robot by robot; everything else is common to all robots.
    """

    on_device = False
    metadata = {
        "render_modes": ["rgb_array"], "render_fps": FRAMES_PER_SECOND, "autoreset_mode": AutoresetMode.NEXT_STEP,
    }  # fmt: skip

    @with_options
    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        *given: Any,
        render_mode: Literal["rgb_array"] | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        on_device: bool = False,
        frames_per_stroke: int | None = None,
        disable_env_checker: bool | None = None,
        **options: Any,
    ):
        self._set_batch(
            num_envs, max_episode_steps, render_mode, autoreset_mode, threads, frames_per_stroke, disable_env_checker
        )
        require_flag("on_device", on_device)
        self.on_device = bool(on_device)
        task = SwimTask(SwimOptions(*given, **options), num_envs, threads)
        timed = unless_strokes(task.options.decision_period, task.scene)
        warn_uncertified(task.scene, task.options.fidelity_of_scene, task.certificate, timed)
        self._begin_with(task)

    _arguments = arguments_of(__init__)

    def _set_batch(
        self,
        num_envs: int,
        max_episode_steps: int | None,
        render_mode: Literal["rgb_array"] | None,
        autoreset_mode: AutoresetMode | str,
        threads: int | None = None,
        frames_per_stroke: int | None = None,
        disable_env_checker: bool | None = None,
    ) -> None:
        if render_mode is not None and not (isinstance(render_mode, str) and render_mode == "rgb_array"):
            raise ValueError(
                f'The batch draws with render_mode="rgb_array" only, not {shown(render_mode)}: '
                "use gym.make for one robot."
            )
        require_count("num_envs", num_envs, 1, MAX_ROBOTS)
        if disable_env_checker is not None:
            require_flag("disable_env_checker", disable_env_checker)
        if frames_per_stroke is not None:
            require_count("frames_per_stroke", frames_per_stroke, 1, MOST_ASKED_FRAMES)
        self.num_envs, self.threads = num_envs, threads
        self.frames_per_stroke, self.disable_env_checker = frames_per_stroke, disable_env_checker
        self._limit_episodes(max_episode_steps)
        self.autoreset_mode = _checked_mode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode

    def _limit_episodes(self, decisions: int | None) -> None:
        if is_whole_number(decisions) and decisions == -1:
            decisions = None
        if decisions is not None:
            require_count("max_episode_steps", decisions, 1, LONGEST)
        object.__setattr__(self, "max_episode_steps", decisions)

    def _begin_with(self, task: Swimming) -> None:
        num_envs = self.num_envs
        if self.frames_per_stroke is None:
            self.frames_per_stroke = frames_of_a_decision(task)
        fps = render_fps(task, self.render_mode, self.frames_per_stroke)
        self.metadata = {**self.metadata, "render_fps": fps}
        self.single_action_space, self.single_observation_space = self._set_task(task)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._generators, self._seeds = map(list, zip(*(seeding.np_random(None) for _ in range(num_envs)), strict=True))
        self._commands = np.zeros((num_envs, task.scene.robot.n_limbs))
        self._pictures = BatchPictures(self._task)
        self._own_attributes: dict[str, tuple[Any, ...]] = {}
        self._elapsed, self._limits = np.zeros(num_envs, np.int64), np.full(num_envs, LONGEST)
        self._needs_reset = np.ones(num_envs, bool)
        self._is_made = True

    @property
    def waypoints(self) -> tuple[NDArray[np.float64], ...]:
        """Waypoints [m] of the present episode of every robot, shape (n, 2) each."""
        return tuple(map(self._task.waypoints_of, range(self.num_envs)))

    @property  # type: ignore[override]
    def np_random(self) -> tuple[np.random.Generator, ...]:
        """Random generator of every robot, which draws its paths, headings and numbers."""
        return tuple(self._generators)

    @np_random.setter  # type: ignore[override]
    def np_random(self, generators: Iterable[np.random.Generator]) -> None:
        self._generators, self._seeds = list(generators), [-1] * self.num_envs

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Seed of the random generator of every robot, -1 where the generator was given."""
        return tuple(self._seeds)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Info]:
        """Begin episodes; returns their first observations and infos.

        seed: Seed of robot 0, followed by those of the others, or a list with a seed for every robot. options: "path"
        (name or waypoints [m]) and "reset_mask" (whether each robot begins an episode, shape (num_envs,)).
        """
        chosen = checked_options(options, {self._option, "reset_mask"})
        mask = self._checked_mask(chosen.get("reset_mask"))
        seeds = checked_seeds(seed, self.num_envs)
        for robot in np.flatnonzero(mask):
            if seeds[robot] is not None:
                self._generators[robot], self._seeds[robot] = seeding.np_random(seeds[robot])
        self._to_the_end(self._begin_episodes, mask, chosen.get(self._option))
        first = self._task.first_info()
        return self._observe(), with_masks({name: of_some(values, mask) for name, values in first.items()}, mask)

    def _checked_mask(self, mask: Any) -> Flags:
        if mask is None:
            return np.ones(self.num_envs, bool)
        mask = as_array(mask)
        if mask.dtype != bool or mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(f"reset_mask must be boolean of shape ({self.num_envs},) with at least one True.")
        if not self._running and not mask.all():
            raise gym.error.ResetNeeded("The first reset must be of all robots: call reset() without a reset_mask.")
        return mask

    def _begin_episodes(self, mask: Flags, asked: Any = None) -> None:
        self._task.reset(mask, self._generators, asked)
        self._elapsed[mask], self._limits[mask] = 0, self.max_episode_steps or LONGEST
        self._needs_reset[mask] = False
        self._commands[mask] = 0.0
        if self.render_mode is not None:
            self._pictures.begin(mask)

    def step(
        self, actions: Any, out: Buffers | None = None
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, Info]:
        """Swim for one decision with every robot; returns observations, rewards, terminated, truncated and info.

        out: Arrays that the results are written into, and that are returned then; by default fresh ones.
        """
        if out is not None and self.on_device:
            raise ValueError("out takes observations of the processor: make the batch without on_device, or copy them.")
        if out is not None:
            require_buffers(out, self.num_envs, self._task.layout.size)
        if not self._running:
            raise gym.error.ResetNeeded("The episodes have not begun or were interrupted: call reset() before step().")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._needs_reset.any():
            raise gym.error.ResetNeeded(
                'Some episodes are over: call reset(options={"reset_mask": ...}) before step().'
            )
        resting = self._needs_reset.copy()  # NEXT_STEP: these begin anew instead of swimming
        commands = to_commands(self.actions, self.simulator.scene.robot.n_limbs, actions, self.num_envs)
        commands[resting] = 0.0
        self.closed = False
        results, info = self._to_the_end(self._step, commands, resting)
        if out is None:
            return *results, info
        out.take(results)
        return *out, info

    def _step(self, commands: NDArray[np.float64], resting: Flags) -> tuple[Buffers, Info]:
        outcome = self._task.step(commands)
        self._commands = outcome.commands
        if self.render_mode is not None:
            self._pictures.follow()
        self._elapsed += 1
        terminated = outcome.terminated & ~resting
        truncated = (self._elapsed >= self._limits) & ~resting
        reward = np.where(resting, 0.0, outcome.reward)
        if resting.any():
            self._begin_episodes(resting)
        self._needs_reset = terminated | truncated
        observations, info = self._observe(), self._info(outcome.info, resting)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._needs_reset.any():
            observations, info = self._begin_next_episodes(observations, outcome.info)
        return Buffers(observations, reward, terminated, truncated), info

    def _observe(self) -> Observations:
        """Observations: numpy's, or the device's if they are asked for."""
        return self._task.observe_on_device() if self.on_device else self._task.observe()

    def action_masks(self) -> Flags:
        """Actions that every robot's wires can follow now, shape (num_envs, k), see `seastar_gym.envs.masks`."""
        return self._task.action_masks()

    def sampling_mask(self) -> tuple[Any, ...]:
        """`action_masks` in the form that `single_action_space.sample(mask=...)` takes, for every robot."""
        return tuple(sampling_mask(self.single_action_space, mask) for mask in self.action_masks())

    def close_extras(self, **ignored: Any) -> None:
        """End the simulator's threads; a step after that starts them again.

        ignored: Arguments of other batches, such as `terminate` and `timeout`: the threads are at rest.
        """
        self.simulator.close()

    def render(self) -> tuple[Picture, ...] | None:
        """Picture of every robot, shape (height, width, 3) each; None without a render_mode."""
        return self.render_robots(range(self.num_envs))

    def render_robots(self, robots: Iterable[int]) -> tuple[Picture, ...] | None:
        """Pictures of the robots of these numbers, shape (height, width, 3) each; None without a render_mode."""
        if self.render_mode is None:
            gym.logger.warn('render() without a render_mode draws nothing: make the batch with "rgb_array".')
            return None
        if not self._running:
            raise gym.error.ResetNeeded(
                "The episodes have not begun or were interrupted: call reset() before render()."
            )
        return self._pictures.draw(robots, self._commands)

    def _begin_next_episodes(
        self, observations: Observations, strokes: dict[str, NDArray[Any]]
    ) -> tuple[Observations, Info]:
        """Begin the next episodes in mode SAME_STEP; info keeps the last observations and infos of the old ones."""
        over = self._needs_reset.copy()
        final_obs = np.full(self.num_envs, None, dtype=object)
        for robot in np.flatnonzero(over):
            final_obs[robot] = observations[robot]
        final_info = with_masks({name: of_some(values, over) for name, values in strokes.items()}, over)
        self._begin_episodes(over)
        return self._observe(), {
            **self._info(strokes, over),
            "final_obs": final_obs,
            "_final_obs": over,
            "final_info": final_info,
            "_final_info": over,
        }

    def _info(self, strokes: dict[str, NDArray[Any]], begun: Flags) -> Info:
        """Info of the decision, and of the reset for robots in the mask of those that have `begun` an episode."""
        info = with_masks(strokes, np.ones_like(begun))
        if begun.any():
            for name, values in self._task.first_info().items():
                info[name][begun] = values[begun]
        return info


def checked_seeds(seed: object, n_robots: int) -> list[int | None]:
    """Seeds of all robots: one number and those that follow it, or a sequence with one for each."""
    if isinstance(seed, np.ndarray) and seed.ndim > 0:
        seed = list(seed)
    if isinstance(seed, Sequence) and not isinstance(seed, str | bytes):
        if len(seed) != n_robots:
            raise ValueError(f"seed must be one number or {n_robots} of them, not {len(seed)}.")
        for one in seed:
            require_seed(one)
        return [None if one is None else int(one) for one in seed]
    require_seed(seed)
    return [None if seed is None else int(seed) + robot for robot in range(n_robots)]  # type: ignore[call-overload]


def _checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    if not isinstance(mode, AutoresetMode):
        require_choice("autoreset_mode", mode, tuple(one.value for one in AutoresetMode))
    return AutoresetMode(mode)
