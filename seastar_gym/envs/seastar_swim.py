"""`SeastarSwim-v0`: one robot."""

import contextlib
from collections.abc import Generator, Iterator
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from seastar_gym.envs.commands import Actions, action_space, command_table, to_commands
from seastar_gym.envs.randomization import DomainRandomization
from seastar_gym.envs.rendering import Frame, Renderer, limb_nodes
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.spec import PlainSpec
from seastar_gym.envs.task import Outcome, Path, Plain, SwimTask, make_scene
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_choice, require_count, require_seed, shown
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator

FRAMES_PER_STROKE = 10
Observation = NDArray[np.float32]


class SeastarSwimEnv(PlainSpec, gym.Env[Observation, Any]):
    """A five-limb soft robot, driven by shape memory alloy actuators, swims along waypoints.

    ## Action
    One step is one stroke: the chosen limbs are heated for 0.1 s and cool for 0.9 s (Fig. 13.5b).

    | `actions`           | space                     | meaning                                                    |
    |---------------------|---------------------------|------------------------------------------------------------|
    | `"limbs"` (default) | `MultiDiscrete([3] * n)`  | per limb: 0 rest, 1 actuate + (anti-clockwise), 2 actuate - |
    | `"joint"`           | `Discrete(3**n)`          | one whole command; `command_table` lists them              |
    | `"pairs"`           | `Discrete(1 + n (n - 1))` | no limb, or one + and one - limb; see `command_table`      |

    ## Observation
    A `float32` vector in a body frame that turns with the robot; the table stands in `envs/observation.py`. For the
    chapter's robot, 186 numbers:

    | index    | what                                                            | unit       | range       |
    |----------|-----------------------------------------------------------------|------------|-------------|
    | 0..89    | positions of nodes {1,1}..{5,9} relative to the hub, x and y    | 0.1 m      | (-inf, inf) |
    | 90..179  | their velocities relative to the hub, x and y                   | 0.025 m/s  | (-inf, inf) |
    | 180, 181 | velocity of the hub                                             | 0.025 m/s  | (-inf, inf) |
    | 182, 183 | current waypoint relative to the hub                            | 0.1 m      | (-inf, inf) |
    | 184, 185 | next waypoint relative to the hub (on the last leg the current) | 0.1 m      | (-inf, inf) |

    Where the scene's actuators remember something, such as the temperatures of `ThermalSma`, that stands before the
    waypoints, limb after limb.

    ## Reward
    `reward_progress` (metres by which the way to go became shorter: the shortest one that passes the current waypoint
    well within `waypoint_radius`, then from waypoint to waypoint) + `reward_waypoint` (waypoints reached) +
    `reward_effort` (minus the limbs heated), with the weights in `RewardWeights`; the terms are in `info`.

    ## Info
    `time` [s], `hub_position` [m], `waypoint_index` (waypoints reached so far), `distance` [m] from the hub to the
    current waypoint, `cross_track_error` [m] from the leg it is on, `is_success`, `limbs_heated`, `newton_iterations`,
    `solver_status` (0: converged), `smallest_opening_angle` [rad] between neighbouring limbs during the stroke (below
    zero: limbs crossed, which this scene allows), and the reward's terms. `solver_message` says what to do about a
    status other than 0, and is empty for 0. `path_error` (by what share of its length the hub's path may be off) and
    `real_time_factor` (in batch, on one core) are what was measured of the fidelity, see
    `seastar_gym.scene.fidelity`; NaN for other robots and scenes. A reset gives the same names as a step, with zeros
    for what only a stroke can tell.

    ## Episode
    Starts at rest with the hub at the origin. `terminated` when the last waypoint is reached, or when the solver gave
    up (never seen within a scene's limits; the observation is then the last good one). `truncated` by the time limit.

    ## Arguments
    path: "pentagon", "square", "triangle", "line", "figure-eight", "random", or waypoints [m] of shape (n, 2); also
        through `reset(options={"path": ...})`, for that episode.
    actions: see above.
    fidelity: "fast", "balanced" (default), "accurate", "reference" or "chapter". Where `scene` names its numerics,
        those hold, and another fidelity is refused.
    scene: What is modelled; the chapter's robot in water by default.
    reward: Weights of the reward's terms.
    waypoint_radius: A waypoint is reached within this distance [m].
    random_heading: Turn the robot at random at the start of every episode; otherwise limb 1 points along +x.
    render_mode: "rgb_array" draws the end of a stroke, "rgb_array_list" collects `frames_per_stroke` frames in every
        stroke, "human" shows as many in a window.
    frames_per_stroke: See render_mode; at equal times, the last one at the end of the stroke.
    randomization: Numbers of the scene that are drawn at the start of every episode; `info` has them by name.

    scene, reward and randomization may be in plain form, as `Scene.to_dict` and
    `seastar_gym.scene.serial.to_dict` write them. `spec` has them so:
    `gym.make(EnvSpec.from_json(env.spec.to_json()))` is the same environment.
    """

    metadata = {"render_modes": ["human", "rgb_array", "rgb_array_list"], "render_fps": FRAMES_PER_STROKE}

    def __init__(
        self,
        path: Path = "pentagon",
        actions: Actions = "limbs",
        fidelity: Fidelity | None = None,
        scene: Scene | Plain | None = None,
        reward: RewardWeights | Plain = RewardWeights(),
        waypoint_radius: float = 0.01,
        random_heading: bool = False,
        render_mode: Literal["human", "rgb_array", "rgb_array_list"] | None = None,
        frames_per_stroke: int = FRAMES_PER_STROKE,
        randomization: DomainRandomization | Plain | None = None,
    ):
        if render_mode is not None:
            require_choice("render_mode", render_mode, tuple(self.metadata["render_modes"]))
        require_count("frames_per_stroke", frames_per_stroke, 1, 1_000_000)
        self.render_mode = render_mode
        self.frames_per_stroke = frames_per_stroke
        self.metadata = {**self.metadata, "render_fps": frames_per_stroke}
        self.actions = actions
        self._task = SwimTask(
            make_scene(scene, fidelity), 1, path, reward, waypoint_radius, random_heading, 1, randomization
        )
        n_limbs = self.scene.robot.n_limbs
        self.action_space = action_space(actions, n_limbs)
        size = self._task.observation_size
        self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.command_table = None if actions == "limbs" else command_table(actions, n_limbs)
        self._running = False
        self._command = np.zeros(n_limbs)
        self._trail = np.zeros((0, 2))
        self._frames: list[NDArray[np.uint8]] = []
        self._renderer: Renderer | None = None

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
        """The simulator, with one robot."""
        return self._task.simulator

    @property
    def waypoints(self) -> NDArray[np.float64]:
        """Waypoints of the current episode [m], shape (n, 2)."""
        return self._task.waypoints_of(0)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode. options: {"path": name or waypoints [m]} for this episode."""
        require_seed(seed)
        super().reset(seed=None if seed is None else int(seed))
        with self._until_whole():
            self._task.reset(np.ones(1, bool), [self.np_random], checked_options(options, {"path"}).get("path"))
        self._running = True
        self._command = np.zeros_like(self._command)
        self._trail = self.simulator.hub_position()
        self._frames = []
        if self._renderer is not None:
            robot = self.simulator.scene.of_robot(0).robot
            self._renderer.reset(self.waypoints, robot.limb_length, robot.rod_radius)
        self._draw_frame()
        return self._task.observe()[0], _of_one_robot(self._task.first_info())

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One stroke."""
        if not self._running:
            raise gym.error.ResetNeeded(
                "The episode has not begun, is over or was interrupted: call reset() before step()."
            )
        command = to_commands(self.actions, self.scene.robot.n_limbs, [action], 1)
        self._command = command[0]
        with self._until_whole():
            outcome = self._swim(command)
        terminated = bool(outcome.terminated[0])
        self._running = not terminated
        return self._task.observe()[0], float(outcome.reward[0]), terminated, False, _of_one_robot(outcome.info)

    @contextlib.contextmanager
    def _until_whole(self) -> Iterator[None]:
        """Around a step or reset: if it is interrupted, robot and task may have come differently far."""
        was_running, self._running = self._running, False
        try:
            yield
        except ValueError:  # refused before anything changed
            self._running = was_running
            raise

    def _swim(self, command: NDArray[np.float64]) -> Outcome:
        if self.render_mode in (None, "rgb_array"):
            outcome = self._task.step(command)
            self._extend_trail()
            return outcome
        with contextlib.closing(self._task.step_in_parts(command, self.frames_per_stroke)) as parts:
            return self._draw_while_swimming(parts)

    def _draw_while_swimming(self, parts: Generator[float, None, Outcome]) -> Outcome:
        while True:
            try:
                time_in_stroke = next(parts)
            except StopIteration as finished:
                self._draw_frame()  # now that it is known whether a waypoint was reached
                return finished.value
            self._extend_trail()
            if time_in_stroke < self.simulator.stroke_time:
                self._draw_frame()

    def _extend_trail(self) -> None:
        if self.render_mode is not None:
            self._trail = np.concatenate([self._trail, self.simulator.hub_position()])

    def _frame(self) -> Frame:
        return Frame(
            positions=self.simulator.positions[0],
            command=self._command,
            trail=self._trail,
            waypoint_index=int(self._task.waypoint_index[0]),
            time=float(self.simulator.time[0]),
        )

    def _draw_frame(self) -> None:
        if self.render_mode == "human":
            self._get_renderer().show(self._frame(), fps=self.frames_per_stroke)
        elif self.render_mode == "rgb_array_list":
            self._frames.append(self._get_renderer().draw(self._frame()))

    def _get_renderer(self) -> Renderer:
        if self._renderer is None:
            robot = self.simulator.scene.of_robot(0).robot
            self._renderer = Renderer(
                limb_nodes(robot.n_limbs, robot.nodes_per_limb),
                self.waypoints,
                limb_length=robot.limb_length,
                rod_radius=robot.rod_radius,
                waypoint_radius=self._task.waypoint_radius,
            )
        return self._renderer

    def render(self) -> NDArray[np.uint8] | list[NDArray[np.uint8]] | None:  # type: ignore[override]
        """The picture, shape (720, 960, 3), or those of the last stroke ("rgb_array_list"), or None ("human")."""
        if self.render_mode is None:
            gym.logger.warn('render() without a render_mode draws nothing: make the environment with "rgb_array".')
            return None
        if self.render_mode == "rgb_array":
            return self._get_renderer().draw(self._frame())
        frames, self._frames = self._frames, []
        return frames if self.render_mode == "rgb_array_list" else None

    def close(self) -> None:
        """Close the window, if there is one, and end the simulator's threads."""
        self.simulator.close()
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}


def checked_options(options: dict[str, Any] | None, known: set[str]) -> dict[str, Any]:
    """Options of a reset; a name that means nothing is refused, not ignored."""
    if options is not None and not isinstance(options, dict):
        raise ValueError(f"options must be a dictionary with any of {sorted(known)}, or None, not {shown(options)}.")
    unknown = set(options or {}) - known
    if unknown:
        raise ValueError(f"Unknown reset option(s) {shown(sorted(unknown, key=str))}: known are {sorted(known)}.")
    return options or {}


def _of_one_robot(info: dict[str, NDArray[Any]]) -> dict[str, Any]:
    """Info of robot 0 as plain numbers, its vectors as arrays."""
    return {name: values[0] if values.ndim > 1 else values.tolist()[0] for name, values in info.items()}
