"""`SeastarSwim-v0` as a native batch: all robots in one simulator, with the bits of one environment each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from operator import getitem
from typing import Any, Literal, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from seastar_gym.accuracy.chapters import warn_of_task, warn_uncertified, warn_undamped
from seastar_gym.envs.attributes import RobotsEnv, arguments_of, checked_options
from seastar_gym.envs.commands import as_array, sampling_mask, to_commands
from seastar_gym.envs.instances import Split
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.rendering import BatchPictures, Picture
from seastar_gym.envs.robots import Outcome, Robots
from seastar_gym.envs.tasks import chosen_task
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import (
    is_whole_number,
    require_choice,
    require_count,
    require_flag,
    require_kind,
    require_seed,
    shown,
)
from seastar_gym.simulator.simulator import MAX_ROBOTS, completed


class Buffers(NamedTuple):
    """Arrays of one step of a batch, such as rows of a learner's memory; none of them shares memory with another.

    observations: Shape (num_envs, size). rewards, terminated, truncated: Shape (num_envs,), numbers and flags.
    """

    observations: NDArray[Any]
    rewards: NDArray[Any]
    terminated: NDArray[Any]
    truncated: NDArray[Any]

    def take(self, results: Buffers) -> None:
        """Write the results of a step."""
        for buffer, result in zip(self, results, strict=True):
            buffer[...] = result


def require_buffers(out: Buffers, n_robots: int, size: int) -> None:
    """ValueError, with one sentence, for arrays that cannot take the results of so many robots."""
    require_kind("out", out, Buffers, "Buffers")
    shapes = {"observations": (n_robots, size)}
    for name, buffer in out._asdict().items():
        shape, kind = shapes.get(name, (n_robots,)), "f" if name in ("observations", "rewards") else "b"
        fits = isinstance(buffer, np.ndarray) and buffer.shape == shape and buffer.dtype.kind == kind
        if not fits or not buffer.flags.writeable:
            what = "numbers" if kind == "f" else "flags"
            raise ValueError(f"out.{name} must be a writeable array of {what} of shape {shape}.")


Observations = NDArray[np.float32]
Flags = NDArray[np.bool_]
Info = dict[str, Any]

LONGEST = 2**63 - 1
"""Largest time limit, which is none [decisions]."""
FRAMES_PER_SECOND = 10
"""Pictures per second of simulated time, unless another number is asked for."""
MOST_ASKED_FRAMES = 1_000_000
"""Largest number of pictures of a decision."""
OF_EACH_ROBOT: Mapping[str, Callable[[Any, int], Any]] = {
    **dict.fromkeys(("action_masks", "np_random", "np_random_seed", "render", "sampling_mask", "waypoints"), getitem),
    "privileged_observations": lambda rows, robot: rows[robot : robot + 1],
    "scene": Scene.of_robot,
}
"""What a robot has of its own of these attributes, and results of methods, of a batch; all others are common."""
OF_ROBOTS = arguments_of(SwimOptions) | arguments_of(AlongPath) | {"task", "split"}
"""Arguments of an environment that say what its robots are and what they swim for."""
NOT_OF_A_ROBOT = ("reset", "step")
"""Methods that robots of one simulator cannot be called alone for."""


class Step(NamedTuple):
    """What a decision of a batch gives: results, info of all robots, and which have begun an episode meanwhile.

    final: Last observations and infos of episodes that are over, if the next ones have begun.
    """

    results: Buffers
    info: dict[str, NDArray[Any]]
    begun: Flags
    final: Info


class Course:
    """Context of a step or reset: after an interruption, robots and task disagree, and only a reset helps.

    is_running: Whether episodes have begun and were not interrupted.
    """

    def __init__(self) -> None:
        self.is_running = self._was_running = False

    def __enter__(self) -> None:
        self._was_running, self.is_running = self.is_running, False

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        was_refused = kind is not None and issubclass(kind, ValueError)  # before anything changed
        self.is_running = kind is None or (was_refused and self._was_running)


class ManyRobotsEnv(RobotsEnv, gym.vector.VectorEnv[Observations, Any, Any]):
    """Environment of robots that are there already, side by side; `SeastarSwimVectorEnv` documents all of it."""

    on_device = False
    metadata = {
        "render_modes": ["rgb_array"], "render_fps": FRAMES_PER_SECOND, "autoreset_mode": AutoresetMode.NEXT_STEP,
    }  # fmt: skip

    def __init__(
        self,
        robots: Robots,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        frames_per_stroke: int | None = None,
        on_device: bool = False,
    ):
        n_robots = robots.n_robots
        self._limit_episodes(max_episode_steps)
        self.autoreset_mode = _checked_mode(autoreset_mode)
        self.num_envs, self.render_mode, self.on_device = n_robots, render_mode, on_device
        self.frames_per_stroke = frames_of_a_decision(robots, frames_per_stroke)
        fps = render_fps(robots, render_mode, self.frames_per_stroke)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode, "render_fps": fps}
        self.single_action_space, self.single_observation_space = self._take(robots)
        self.action_space = batch_space(self.single_action_space, n_robots)
        self.observation_space = batch_space(self.single_observation_space, n_robots)
        self._generators, self._seeds = map(list, zip(*(seeding.np_random(None) for _ in range(n_robots)), strict=True))
        self.pictures = BatchPictures(robots)
        self._own_attributes: dict[str, tuple[Any, ...]] = {}
        self._course = Course()
        self._elapsed, self._limits = np.zeros(n_robots, np.int64), np.full(n_robots, LONGEST)
        self.needs_reset = np.ones(n_robots, bool)
        self._is_made = True

    def _limit_episodes(self, decisions: int | None) -> None:
        if is_whole_number(decisions) and decisions == -1:
            decisions = None
        if decisions is not None:
            require_count("max_episode_steps", decisions, 1, LONGEST)
        object.__setattr__(self, "max_episode_steps", decisions)

    @property
    def is_running(self) -> bool:
        """Whether episodes have begun and were not interrupted."""
        return self._course.is_running

    @property
    def waypoints(self) -> tuple[NDArray[np.float64], ...]:
        """Waypoints [m] of the present episode of every robot, shape (n, 2) each."""
        return tuple(self.task.waypoints_of(self._robots, robot) for robot in range(self.num_envs))

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
        (name or waypoints [m]), or for tasks "instance" (number of an episode, or one for each robot), and
        "reset_mask" (whether each robot begins an episode, shape (num_envs,)).
        """
        chosen = checked_options(options, {self.task.option, "reset_mask"})
        mask = self._checked_mask(chosen.get("reset_mask"))
        seeds = checked_seeds(seed, self.num_envs)
        for robot in np.flatnonzero(mask):
            if seeds[robot] is not None:
                self._generators[robot], self._seeds[robot] = seeding.np_random(seeds[robot])
        self.begin(mask, chosen.get(self.task.option))
        first = self._robots.first_info()
        return self._observe(), with_masks({name: of_some(values, mask) for name, values in first.items()}, mask)

    def _checked_mask(self, mask: Any) -> Flags:
        if mask is None:
            return np.ones(self.num_envs, bool)
        mask = as_array(mask)
        if mask.dtype != bool or mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(f"reset_mask must be boolean of shape ({self.num_envs},) with at least one True.")
        if not self.is_running and not mask.all():
            raise gym.error.ResetNeeded("The first reset must be of all robots: call reset() without a reset_mask.")
        return mask

    def begin(self, mask: Flags, asked: Any = None) -> None:
        """Begin episodes of the robots in a mask, with their own generators. asked: What a reset asks for."""
        with self._course:
            self._begin_episodes(mask, asked)

    def _begin_episodes(self, mask: Flags, asked: Any = None) -> None:
        self._robots.reset(mask, self._generators, asked)
        self._elapsed[mask], self._limits[mask] = 0, self.max_episode_steps or LONGEST
        self.needs_reset[mask] = False
        if self.render_mode is not None:
            self.pictures.begin(mask)

    def step(
        self, actions: Any, out: Buffers | None = None
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, Info]:
        """Swim for one decision with every robot; returns observations, rewards, terminated, truncated and info.

        out: Arrays that the results are written into, and that are returned then; by default fresh ones.
        """
        if out is not None and self.on_device:
            raise ValueError("out takes observations of the processor: make the batch without on_device, or copy them.")
        if out is not None:
            require_buffers(out, self.num_envs, self.layout.size)
        if not self.is_running:
            raise gym.error.ResetNeeded("The episodes have not begun or were interrupted: call reset() before step().")
        if self.autoreset_mode is AutoresetMode.DISABLED and self.needs_reset.any():
            raise gym.error.ResetNeeded(
                'Some episodes are over: call reset(options={"reset_mask": ...}) before step().'
            )
        results, values, begun, final = self.advance(actions)
        info = with_masks(values, np.ones_like(begun)) | final
        if begun.any():
            for name, first in self._robots.first_info().items():
                info[name][begun] = first[begun]
        if out is None:
            return *results, info
        out.take(results)
        return *out, info

    def advance(self, actions: Any, look: Callable[[float], None] | None = None, parts: int = 1) -> Step:
        """Swim for one decision, if need be in `parts` parts.

        look: Called with the time since the decision [s] after every part, when pictures are asked for.
        """
        begun = self.needs_reset.copy()  # NEXT_STEP: these begin anew instead of swimming
        some_begin = any(begun.tolist())
        commands = to_commands(self.actions, self._robots.scene.robot.n_limbs, actions, self.num_envs)
        if some_begin:
            commands[begun] = 0.0
        if self.closed:
            self.closed = False
        with self._course:
            outcome = self._swim(commands, look, parts)
            np.add(self._elapsed, 1, out=self._elapsed)
            reward, terminated, truncated = outcome.reward, outcome.terminated, self._elapsed >= self._limits
            if some_begin:
                terminated, truncated = terminated & ~begun, truncated & ~begun
                reward = np.where(begun, 0.0, reward)
                self._begin_episodes(begun)
            np.logical_or(terminated, truncated, out=self.needs_reset)
            final = Info()
            observations = self._observe()
            if self.autoreset_mode is AutoresetMode.SAME_STEP and any(self.needs_reset.tolist()):
                begun = self.needs_reset.copy()
                final = _final(observations, outcome.info, begun)
                self._begin_episodes(begun)
                observations = self._observe()
            return Step(Buffers(observations, reward, terminated, truncated), outcome.info, begun, final)

    def _swim(self, commands: NDArray[np.float64], look: Callable[[float], None] | None, parts: int) -> Outcome:
        """Swim for one decision, and let trails follow where pictures are drawn."""
        if look is None:
            outcome = self._robots.step(commands)
            if self.render_mode is not None:
                self.pictures.follow()
            return outcome

        def follow(time: float) -> None:
            self.pictures.follow()
            look(time)

        return completed(self._robots.step_in_parts(commands, parts), follow)

    def _observe(self) -> Observations:
        """Observations: numpy's, or the device's if they are asked for."""
        return self._robots.observe_on_device() if self.on_device else self._robots.observe()

    def action_masks(self) -> Flags:
        """Actions that every robot's wires can follow now, shape (num_envs, k), see `seastar_gym.envs.commands`."""
        return self._robots.action_masks()

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
        if not self.is_running:
            raise gym.error.ResetNeeded(
                "The episodes have not begun or were interrupted: call reset() before render()."
            )
        return self.pictures.draw(robots)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Attribute, or result of a method, of every robot."""
        if name in NOT_OF_A_ROBOT:
            raise ValueError(f"The robots share one simulator: use {name}() of the batch, not call({name!r}).")
        if name == "get_wrapper_attr":
            return self.call(*args)
        if name in self._own_attributes:
            values = self._own_attributes[name]
            return tuple(value(*args, **kwargs) if callable(value) else value for value in values)
        if name in self._robots.per_episode:
            return tuple(self._argument(name, robot) for robot in range(self.num_envs))
        if name in ("action_space", "observation_space"):
            name = f"single_{name}"
        value = getattr(self, name)
        return robot_by_robot(name, value(*args, **kwargs) if callable(value) else value, self.num_envs)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Attribute of every robot."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute to a list or tuple with a value for every robot, or to one value for all.

        Robots may differ in new attributes, in `np_random`, and in the arguments that hold from their next episodes on:
        `path`, `random_heading`, `reward` and `waypoint_radius`. Another attribute that the batch has already is common
        to all robots, and takes one value only; other arguments of the constructor are refused.
        """
        values = tuple(values) if isinstance(values, list | tuple) else (values,) * self.num_envs
        if len(values) != self.num_envs:
            raise ValueError(f"{name} must be one value or {self.num_envs} of them, not {len(values)}.")
        if name == "np_random":
            setattr(self, name, values)
        elif name in self._robots.per_episode:
            self._ask(name, values)
        elif not hasattr(self, name) and name not in self._of_task:
            self._own_attributes[name] = values
        elif all(value is values[0] or np.all(value == values[0]) for value in values):
            setattr(self, name, values[0])
        else:
            raise ValueError(f"The robots share one batch, so {name} must be the same for all of them.")

    def has_wrapper_attr(self, name: str) -> bool:
        """Whether robots have an attribute, as Gymnasium's environments tell."""
        return name in self._own_attributes or hasattr(self, name)

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """Set an attribute of all robots; returns whether it is set. force: Also where there is none of the name."""
        is_set = force or self.has_wrapper_attr(name)
        if is_set:
            self.set_attr(name, (value,) * self.num_envs)
        return is_set

    def _ask(self, name: str, values: Sequence[Any]) -> None:
        if name == "max_episode_steps":
            self._limit_episodes(values[0])
        else:
            super()._ask(name, values)


class SeastarSwimVectorEnv(ManyRobotsEnv):
    """Environment of `num_envs` robots side by side; `SeastarSwimEnv` documents spaces, rewards, info and arguments.

    It takes these arguments by name. Robot i has the seed `seed + i` and is bit-identical to a `SeastarSwimEnv` with
    that seed and the same actions. Arrays of actions, observations, rewards and flags have a first axis of length
    `num_envs`, and so have the entries of `info`; `info["_name"]` is the mask of the robots for which `info["name"]`
    is valid.

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
    such as rows of a learner's memory, see `Buffers`.

    Whatever Gymnasium's `SyncVectorEnv` of `SeastarSwimEnv` takes and gives, this batch takes and gives, but that
    `call("reset")` and `call("step")` are refused. `call` and `get_attr` give what each robot has of its own (see
    `OF_EACH_ROBOT`) robot by robot; everything else is common to all robots.
    """

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        *,
        render_mode: Literal["rgb_array"] | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        on_device: bool = False,
        frames_per_stroke: int | None = None,
        disable_env_checker: bool | None = None,
        **arguments: Any,
    ):
        """num_envs robots. arguments: Those of `SeastarSwimEnv`, by name. TypeError for any other."""
        if render_mode is not None and not (isinstance(render_mode, str) and render_mode == "rgb_array"):
            raise ValueError(
                f'The batch draws with render_mode="rgb_array" only, not {shown(render_mode)}: '
                "use gym.make for one robot."
            )
        require_count("num_envs", num_envs, 1, MAX_ROBOTS)
        if disable_env_checker is not None:
            require_flag("disable_env_checker", disable_env_checker)
        require_flag("on_device", on_device)
        self.threads, self.disable_env_checker = threads, disable_env_checker
        if unknown := sorted({*arguments} - self._arguments):
            near = get_close_matches(unknown[0], sorted(self._arguments), 1)
            instead = f": the nearest is {near[0]!r}" if near else ""
            raise TypeError(f"SeastarSwimVectorEnv has no argument {unknown[0]!r}{instead}.")
        robots = swimmers(num_envs, threads, **arguments)
        super().__init__(robots, max_episode_steps, autoreset_mode, render_mode, frames_per_stroke, bool(on_device))

    _arguments = arguments_of(__init__) | OF_ROBOTS


def swimmers(
    n_robots: int, threads: int | None, /, task: Any = None, split: Split = "train", **arguments: Any
) -> Robots:  # fmt: skip
    """Robots of an environment, with a warning where errors were asked for that nobody has measured.

    arguments: Of the environment, those in `OF_ROBOTS`.
    """
    options = SwimOptions(**{name: arguments.pop(name) for name in arguments_of(SwimOptions) & {*arguments}})
    robots = Robots(chosen_task(task, split, **arguments), options, n_robots, threads, split=split)
    if robots.task.tells_errors:
        warn_undamped(robots.scene, robots.timed)
        asked = None if robots.options.scene is None else robots.options.fidelity
        warn_uncertified(robots.scene, asked, robots.certificate, robots.timed)
    elif robots.certificate is not None:
        warn_of_task(type(robots.task).__name__)
    return robots


def frames_of_a_decision(robots: Robots, asked: int | None) -> int:
    """Number of pictures of a decision. asked: None means ten per second of simulated time, and one at least."""
    if asked is None:
        return max(1, round(FRAMES_PER_SECOND * robots.decision_period))
    require_count("frames_per_stroke", asked, 1, MOST_ASKED_FRAMES)
    return asked


def render_fps(robots: Robots, render_mode: str | None, frames_per_stroke: int) -> float:
    """Pictures that `render` returns per second of simulated time: with "rgb_array" one for each decision."""
    fps = float((1 if render_mode == "rgb_array" else frames_per_stroke) / robots.decision_period)
    return int(fps) if fps.is_integer() else fps


def robot_by_robot(name: str, value: Any, n_robots: int) -> tuple[Any, ...]:
    """What every robot has of an attribute of a batch, or of a method's result."""
    own = OF_EACH_ROBOT.get(name)
    return (
        (value,) * n_robots if own is None or value is None else tuple(own(value, robot) for robot in range(n_robots))
    )


def of_some(values: NDArray[Any], mask: Flags) -> NDArray[Any]:
    """Values of the robots in a mask, shape (n_robots,); zero or None, as in Gymnasium, for the others."""
    values = values.copy()
    values[~mask] = None if values.dtype == object else 0
    return values


def with_masks(values: dict[str, NDArray[Any]], mask: Flags) -> Info:
    """Info of a batch in Gymnasium's form: a copy of every array, and a mask of the robots for which it is valid."""
    return {name: array.copy() for name, array in values.items()} | {f"_{name}": mask.copy() for name in values}


def _final(observations: Observations, info: dict[str, NDArray[Any]], over: Flags) -> Info:
    """Entries of info in mode SAME_STEP: last observations and infos of the robots in a mask."""
    last = np.full(len(over), None, dtype=object)
    for robot in np.flatnonzero(over):
        last[robot] = observations[robot]
    last_info = with_masks({name: of_some(values, over) for name, values in info.items()}, over)
    return {"final_obs": last, "_final_obs": over, "final_info": last_info, "_final_info": over}


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
