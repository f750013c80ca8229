"""`SeastarSwim-v0` as a native batch: all robots of one simulator, the same numbers as one environment each."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from seastar_gym.checks import require_choice, require_count, require_seed
from seastar_gym.envs.commands import Actions, action_space, command_table, to_commands
from seastar_gym.envs.randomization import DomainRandomization
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.seastar_swim import checked_options
from seastar_gym.envs.task import Path, SwimTask, make_scene
from seastar_gym.scene import Fidelity, Scene
from seastar_gym.simulator import MAX_ROBOTS, Simulator, SolverStatus

Observations = NDArray[np.float32]
Flags = NDArray[np.bool_]
Info = dict[str, Any]


class SeastarSwimVectorEnv(gym.vector.VectorEnv[Observations, Any, Any]):
    """`num_envs` robots side by side; spaces, rewards, info and arguments are those of `SeastarSwimEnv`.

    Robot i has the seed `seed + i` and then does to the last bit what `SeastarSwimEnv` does with that seed and the same
    actions.

    max_episode_steps: Time limit [strokes], applied here; None for none.
    autoreset_mode: NEXT_STEP (default): the step after the end of an episode ignores its action and returns the first
        observation of the next one with reward 0. SAME_STEP: the step that ends an episode returns the next one's first
        observation, and its own last one in `info["final_obs"]`, `info["final_info"]`. DISABLED: `reset` with
        `options={"reset_mask": ...}` before the next step.
    threads: Threads of the simulator; all processors if None.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        path: Path = "pentagon",
        actions: Actions = "limbs",
        fidelity: Fidelity | None = None,
        scene: Scene | None = None,
        reward: RewardWeights = RewardWeights(),
        waypoint_radius: float = 0.01,
        random_heading: bool = False,
        render_mode: None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        randomization: DomainRandomization | None = None,
    ):
        if render_mode is not None:
            raise ValueError('The batch draws nothing: use gym.make("SeastarSwim-v0", render_mode=...) for one robot.')
        require_count("num_envs", num_envs, 1, MAX_ROBOTS)
        if max_episode_steps is not None:
            require_count("max_episode_steps", max_episode_steps, 1, 2**63 - 1)
        self.num_envs = num_envs
        self.max_episode_steps = max_episode_steps
        self.autoreset_mode = _checked_mode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = None
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
        self._generators = [seeding.np_random(None)[0] for _ in range(num_envs)]
        self._elapsed = np.zeros(num_envs, np.int64)
        self._needs_reset = np.ones(num_envs, bool)
        self._has_begun = False

    @property
    def scene(self) -> Scene:
        """What is modelled, before anything is drawn by `randomization`."""
        return self._task.scene

    @property
    def simulator(self) -> Simulator:
        """The simulator of all robots."""
        return self._task.simulator

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Info]:
        """Begin episodes. options: "path" (name or waypoints [m]), "reset_mask" (which robots, shape (num_envs,))."""
        chosen = checked_options(options, {"path", "reset_mask"})
        mask = self._checked_mask(chosen.get("reset_mask"))
        seeds = checked_seeds(seed, self.num_envs)
        for robot in np.flatnonzero(mask):
            if seeds[robot] is not None:
                self._generators[robot] = seeding.np_random(seeds[robot])[0]
        self._begin_episodes(mask, chosen.get("path"))
        self._has_begun = True
        facts = self._task.facts()
        return self._task.observe(), {**facts, **{f"_{name}": mask.copy() for name in facts}}

    def _checked_mask(self, mask: Any) -> Flags:
        if mask is None:
            return np.ones(self.num_envs, bool)
        mask = np.asarray(mask)
        if mask.dtype != bool or mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(f"reset_mask must be boolean of shape ({self.num_envs},) with at least one True.")
        if not self._has_begun and not mask.all():
            raise gym.error.ResetNeeded("The first reset must be of all robots: call reset() without a reset_mask.")
        return mask

    def _begin_episodes(self, mask: Flags, path: Path | None = None) -> None:
        self._task.reset(mask, self._generators, path)
        self._elapsed[mask] = 0
        self._needs_reset[mask] = False

    def step(self, actions: Any) -> tuple[Observations, NDArray[np.float64], Flags, Flags, Info]:
        """One stroke of every robot."""
        if not self._has_begun:
            raise gym.error.ResetNeeded("The episodes have not begun: call reset() before step().")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._needs_reset.any():
            raise gym.error.ResetNeeded(
                'Some episodes are over: call reset(options={"reset_mask": ...}) before step().'
            )
        resting = self._needs_reset.copy()  # NEXT_STEP: these begin anew instead of swimming
        commands = to_commands(self.actions, self.simulator.scene.robot.n_limbs, actions, self.num_envs)
        commands[resting] = 0.0
        outcome = self._task.step(commands)
        self._elapsed += 1
        terminated = outcome.terminated & ~resting
        out_of_time = self.max_episode_steps is not None and self._elapsed >= self.max_episode_steps
        truncated = np.asarray(out_of_time & ~resting) & np.ones(self.num_envs, bool)
        reward = np.where(resting, 0.0, outcome.reward)
        if resting.any():
            self._begin_episodes(resting)
        self._needs_reset = terminated | truncated
        observations, info = self._task.observe(), self._with_masks(outcome.info, resting)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._needs_reset.any():
            observations, info = self._begin_next_episodes(observations, outcome.info)
        return observations, reward, terminated, truncated, info

    def _begin_next_episodes(
        self, observations: Observations, strokes: dict[str, NDArray[Any]]
    ) -> tuple[Observations, Info]:
        """SAME_STEP: put away the last observations and infos of the episodes that are over, and begin the next."""
        over = self._needs_reset.copy()
        final_obs = np.full(self.num_envs, None, dtype=object)
        for robot in np.flatnonzero(over):
            final_obs[robot] = observations[robot]
        final_info = self._with_masks(strokes, ~over, begun_anew=False)
        self._begin_episodes(over)
        return self._task.observe(), {
            **self._with_masks(strokes, over),
            "final_obs": final_obs,
            "_final_obs": over,
            "final_info": final_info,
            "_final_info": over,
        }

    def _with_masks(self, strokes: dict[str, NDArray[Any]], others: Flags, begun_anew: bool = True) -> Info:
        """Gymnasium's form of a batch's info: beside every array a mask of the robots that it tells about.

        strokes: What a stroke says of all robots; of `others` only what a reset says counts, if they have begun anew.
        """
        facts = self._task.facts() if begun_anew and others.any() else {}
        info: Info = {}
        for name, values in strokes.items():
            values = values.copy()
            if others.any():
                values[others] = facts[name][others] if name in facts else 0
            info[name], info[f"_{name}"] = values, np.ones_like(others) if name in facts else ~others
        failed = (strokes["solver_status"] != SolverStatus.CONVERGED) & ~others
        if failed.any():
            messages = np.full(self.num_envs, None, dtype=object)
            for robot in np.flatnonzero(failed):
                messages[robot] = SolverStatus(strokes["solver_status"][robot]).sentence
            info["solver_message"], info["_solver_message"] = messages, failed
        return info


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
