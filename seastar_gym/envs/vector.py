"""`SeastarSwim-v0` as a native batch: all robots of one simulator, the same numbers as one environment each."""

import contextlib
from collections.abc import Iterable, Iterator
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from seastar_gym.envs.batch_pictures import BatchPictures, Picture
from seastar_gym.envs.commands import Actions, action_space, as_array, command_table, to_commands
from seastar_gym.envs.randomization import DomainRandomization
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.seastar_swim import FRAMES_PER_STROKE, checked_options
from seastar_gym.envs.spec import PlainSpec
from seastar_gym.envs.task import Path, Plain, SwimTask, make_scene
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_choice, require_count, require_seed
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator
from seastar_gym.simulator.simulator import MAX_ROBOTS

Observations = NDArray[np.float32]
Flags = NDArray[np.bool_]
Info = dict[str, Any]


class SeastarSwimVectorEnv(PlainSpec, gym.vector.VectorEnv[Observations, Any, Any]):
    """`num_envs` robots side by side; spaces, rewards, info and arguments are those of `SeastarSwimEnv`.

    Robot i has the seed `seed + i` and then does to the last bit what `SeastarSwimEnv` does with that seed and the same
    actions.

    max_episode_steps: Time limit [strokes], applied here; None for none.
    autoreset_mode: NEXT_STEP (default): the step after the end of an episode ignores its action and returns the first
        observation of the next one with reward 0. SAME_STEP: the step that ends an episode returns the next one's first
        observation, and its own last one in `info["final_obs"]`, `info["final_info"]`. DISABLED: `reset` with
        `options={"reset_mask": ...}` before the next step.
    threads: Threads of the simulator; all processors if None.
    render_mode: "rgb_array": `render` draws every robot after its stroke, the smaller the more there are;
        `render_robots` draws some of them.

    `call`, `get_attr` and `set_attr` are those of Gymnasium's `SyncVectorEnv`. What a robot has of its own
    (`waypoints`, `scene`, `np_random`, `render`..) they give robot by robot; everything else is one and the same for
    all robots.
    """

    metadata = {
        "render_modes": ["rgb_array"], "render_fps": FRAMES_PER_STROKE, "autoreset_mode": AutoresetMode.NEXT_STEP,
    }  # fmt: skip

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        path: Path = "pentagon",
        actions: Actions = "limbs",
        fidelity: Fidelity | None = None,
        scene: Scene | Plain | None = None,
        reward: RewardWeights | Plain = RewardWeights(),
        waypoint_radius: float = 0.01,
        random_heading: bool = False,
        render_mode: Literal["rgb_array"] | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        randomization: DomainRandomization | Plain | None = None,
    ):
        if render_mode is not None and not (isinstance(render_mode, str) and render_mode == "rgb_array"):
            raise ValueError(
                f'The batch draws with render_mode="rgb_array" only, not {render_mode!r}: use gym.make for one robot.'
            )
        require_count("num_envs", num_envs, 1, MAX_ROBOTS)
        if max_episode_steps is not None:
            require_count("max_episode_steps", max_episode_steps, 1, 2**63 - 1)
        self.num_envs = num_envs
        self.max_episode_steps = max_episode_steps
        self.autoreset_mode = _checked_mode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self.actions = actions
        self._task = SwimTask(
            make_scene(scene, fidelity), num_envs, path, reward, waypoint_radius, random_heading, threads, randomization
        )
        n_limbs = self.simulator.scene.robot.n_limbs
        self.single_action_space = action_space(actions, n_limbs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.single_observation_space = spaces.Box(-np.inf, np.inf, (self._task.observation_size,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.command_table = None if actions == "limbs" else command_table(actions, n_limbs)
        self._generators, self._seeds = map(list, zip(*(seeding.np_random(None) for _ in range(num_envs)), strict=True))
        self._commands = np.zeros((num_envs, n_limbs))
        self._pictures = BatchPictures(self._task)
        self._attributes: dict[str, tuple[Any, ...]] = {}
        self._elapsed = np.zeros(num_envs, np.int64)
        self._needs_reset = np.ones(num_envs, bool)
        self._has_begun = False

    @property
    def scene(self) -> Scene:
        """What is modelled, before anything is drawn by `randomization`."""
        return self._task.scene

    @property
    def randomization(self) -> DomainRandomization | None:
        """Numbers of the scene that are drawn for every episode."""
        return self._task.randomization

    @property
    def simulator(self) -> Simulator:
        """The simulator of all robots."""
        return self._task.simulator

    @property
    def waypoints(self) -> tuple[NDArray[np.float64], ...]:
        """Waypoints of every robot's present episode [m], shape (n, 2) each."""
        return tuple(map(self._task.waypoints_of, range(self.num_envs)))

    @property  # type: ignore[override]
    def np_random(self) -> tuple[np.random.Generator, ...]:
        """What every robot's paths, headings and numbers are drawn from."""
        return tuple(self._generators)

    @np_random.setter  # type: ignore[override]
    def np_random(self, generators: Iterable[np.random.Generator]) -> None:
        self._generators = list(generators)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of every robot's generator."""
        return tuple(self._seeds)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Info]:
        """Begin episodes. options: "path" (name or waypoints [m]), "reset_mask" (which robots, shape (num_envs,))."""
        chosen = checked_options(options, {"path", "reset_mask"})
        mask = self._checked_mask(chosen.get("reset_mask"))
        seeds = checked_seeds(seed, self.num_envs)
        for robot in np.flatnonzero(mask):
            if seeds[robot] is not None:
                self._generators[robot], self._seeds[robot] = seeding.np_random(seeds[robot])
        with self._until_whole():
            self._begin_episodes(mask, chosen.get("path"))
        return self._task.observe(), _with_masks(self._task.first_info(), mask)

    def _checked_mask(self, mask: Any) -> Flags:
        if mask is None:
            return np.ones(self.num_envs, bool)
        mask = as_array(mask)
        if mask.dtype != bool or mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(f"reset_mask must be boolean of shape ({self.num_envs},) with at least one True.")
        if not self._has_begun and not mask.all():
            raise gym.error.ResetNeeded("The first reset must be of all robots: call reset() without a reset_mask.")
        return mask

    def _begin_episodes(self, mask: Flags, path: Path | None = None) -> None:
        self._task.reset(mask, self._generators, path)
        self._elapsed[mask] = 0
        self._needs_reset[mask] = False
        self._commands[mask] = 0.0
        if self.render_mode is not None:
            self._pictures.begin(mask)

    def step(self, actions: Any) -> tuple[Observations, NDArray[np.float64], Flags, Flags, Info]:
        """One stroke of every robot."""
        if not self._has_begun:
            raise gym.error.ResetNeeded("The episodes have not begun or were interrupted: call reset() before step().")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._needs_reset.any():
            raise gym.error.ResetNeeded(
                'Some episodes are over: call reset(options={"reset_mask": ...}) before step().'
            )
        resting = self._needs_reset.copy()  # NEXT_STEP: these begin anew instead of swimming
        commands = to_commands(self.actions, self.simulator.scene.robot.n_limbs, actions, self.num_envs)
        commands[resting] = 0.0
        self.closed = False
        with self._until_whole():
            return self._step(commands, resting)

    @contextlib.contextmanager
    def _until_whole(self) -> Iterator[None]:
        """Around a step or reset: if it is interrupted, robots and task may have come differently far."""
        had_begun, self._has_begun = self._has_begun, False
        try:
            yield
        except ValueError:  # refused before anything changed
            self._has_begun = had_begun
            raise
        self._has_begun = True

    def _step(
        self, commands: NDArray[np.float64], resting: Flags
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, Info]:
        outcome = self._task.step(commands)
        self._commands = commands
        if self.render_mode is not None:
            self._pictures.follow()
        self._elapsed += 1
        terminated = outcome.terminated & ~resting
        out_of_time = self.max_episode_steps is not None and self._elapsed >= self.max_episode_steps
        truncated = np.asarray(out_of_time & ~resting) & np.ones(self.num_envs, bool)
        reward = np.where(resting, 0.0, outcome.reward)
        if resting.any():
            self._begin_episodes(resting)
        self._needs_reset = terminated | truncated
        observations, info = self._task.observe(), self._info(outcome.info, resting)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._needs_reset.any():
            observations, info = self._begin_next_episodes(observations, outcome.info)
        return observations, reward, terminated, truncated, info

    def close_extras(self) -> None:
        """End the simulator's threads; a step after that starts them again."""
        self.simulator.close()

    def render(self) -> tuple[Picture, ...] | None:
        """A picture of every robot, shape (height, width, 3) each; None without a render_mode."""
        return self.render_robots(range(self.num_envs))

    def render_robots(self, robots: Iterable[int]) -> tuple[Picture, ...] | None:
        """Pictures of some robots; None without a render_mode."""
        if self.render_mode is None:
            gym.logger.warn('render() without a render_mode draws nothing: make the batch with "rgb_array".')
            return None
        return self._pictures.draw(robots, self._commands)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """An attribute, or the result of a method, once for every robot."""
        if name in ("reset", "step", "close"):
            raise ValueError(f"The robots share one simulator: use {name}() of the batch, not call({name!r}).")
        if name in ("action_space", "observation_space"):
            name = f"single_{name}"
        if name == "scene":
            return tuple(map(self.scene.of_robot, range(self.num_envs)))
        value = self._attributes[name] if name in self._attributes else getattr(self, name)
        value = value(*args, **kwargs) if callable(value) else value
        of_each = name in self._attributes or name in ("np_random", "np_random_seed", "render", "waypoints")
        return value if of_each and value is not None else (value,) * self.num_envs

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute, once for every robot."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute: a list or tuple has a value for every robot, anything else is the value for all.

        Robots may have different values of new attributes and of `np_random`; what the batch has already, all share.
        """
        values = tuple(values) if isinstance(values, list | tuple) else (values,) * self.num_envs
        if len(values) != self.num_envs:
            raise ValueError(f"{name} must be one value or {self.num_envs} of them, not {len(values)}.")
        if name == "np_random":
            self.np_random = values
        elif not hasattr(self, name):
            self._attributes[name] = values
        elif all(value is values[0] or np.all(value == values[0]) for value in values):
            setattr(self, name, values[0])
        else:
            raise ValueError(f"The robots share one batch, so {name} must be the same for all of them.")

    def _begin_next_episodes(
        self, observations: Observations, strokes: dict[str, NDArray[Any]]
    ) -> tuple[Observations, Info]:
        """SAME_STEP: put away the last observations and infos of the episodes that are over, and begin the next."""
        over = self._needs_reset.copy()
        final_obs = np.full(self.num_envs, None, dtype=object)
        for robot in np.flatnonzero(over):
            final_obs[robot] = observations[robot]
        final_info = _with_masks({name: _of_some(values, over) for name, values in strokes.items()}, over)
        self._begin_episodes(over)
        return self._task.observe(), {
            **self._info(strokes, over),
            "final_obs": final_obs,
            "_final_obs": over,
            "final_info": final_info,
            "_final_info": over,
        }

    def _info(self, strokes: dict[str, NDArray[Any]], begun: Flags) -> Info:
        """What a stroke says of the robots, and a reset of those that have begun anew."""
        info = {name: values.copy() for name, values in strokes.items()}
        if begun.any():
            for name, values in self._task.first_info().items():
                info[name][begun] = values[begun]
        return _with_masks(info, np.ones_like(begun))


def checked_seeds(seed: object, n_robots: int) -> list[int | None]:
    """The seed of every robot: one number and those that follow it, or a list with one for each."""
    if isinstance(seed, list):
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


def _of_some(values: NDArray[Any], mask: Flags) -> NDArray[Any]:
    """The values of the robots in the mask; nothing, as Gymnasium writes it, for the others."""
    values = values.copy()
    values[~mask] = None if values.dtype == object else 0
    return values


def _with_masks(values: dict[str, NDArray[Any]], mask: Flags) -> Info:
    """Gymnasium's form of a batch's info: beside every array a mask of the robots that it tells about."""
    return values | {f"_{name}": mask.copy() for name in values}
