"""`SeastarSwim-v0`: the environment of one robot, robot 0 of a batch of one. Its docstring is what users read."""

from collections import deque
from functools import cache
from typing import Any, Literal
from weakref import WeakSet

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from seastar_gym.accuracy.certificate import Certificate
from seastar_gym.envs import IDS
from seastar_gym.envs.attributes import RobotsEnv, arguments_of, checked_options
from seastar_gym.envs.commands import Actions, sampling_mask
from seastar_gym.envs.headings import HeadingTargets
from seastar_gym.envs.instances import Split
from seastar_gym.envs.options import Plain
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.randomization import DomainRandomization
from seastar_gym.envs.rendering import BatchPictures, Frame
from seastar_gym.envs.rewards import RewardWeights
from seastar_gym.envs.robots import Robots, Task
from seastar_gym.envs.sight import Drawn, Sight
from seastar_gym.envs.vector import FRAMES_PER_SECOND, ManyRobotsEnv, swimmers
from seastar_gym.envs.waypoints import Path
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_choice, require_seed
from seastar_gym.scene.numerics import Fidelity

MOST_FRAMES = 100
"""Largest number of pictures that wait for `render`, or those of one decision if they are more; 2 MB each."""
ROUNDING = 1e-9
"""Fraction of a time that is no time."""
MANY = 4
"""Environments of one robot that are open in a process at once, at which it is told that a batch is faster."""
_open: WeakSet[gym.Env[Any, Any]] = WeakSet()
Observation = NDArray[np.float32]
RenderMode = Literal["human", "rgb_array", "rgb_array_list"]


class OneRobotEnv(RobotsEnv, gym.Env[Observation, Any]):
    """Environment of one robot that is there already; `SeastarSwimEnv` documents all of it."""

    metadata = {"render_modes": ["human", "rgb_array", "rgb_array_list"], "render_fps": FRAMES_PER_SECOND}

    def __init__(self, robots: Robots, render_mode: RenderMode | None = None, frames_per_stroke: int | None = None):
        if render_mode is not None:
            require_choice("render_mode", render_mode, tuple(self.metadata["render_modes"]))
        self.render_mode = render_mode
        self._batch = ManyRobotsEnv(robots, None, AutoresetMode.DISABLED, render_mode, frames_per_stroke)
        self.action_space, self.observation_space = self._take(robots)
        self.frames_per_stroke = self._batch.frames_per_stroke
        self.metadata = {**self.metadata, "render_fps": self._batch.metadata["render_fps"]}
        self._frames: deque[NDArray[np.uint8]] = deque(maxlen=max(MOST_FRAMES, self.frames_per_stroke + 1))
        self._is_made = True
        _open.add(self)
        if len(_open) >= MANY:
            _tell_of_batches()

    @property
    def waypoints(self) -> NDArray[np.float64]:
        """Waypoints of the current episode [m], shape (n, 2)."""
        return self._batch.waypoints[0]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; returns its first observation and info.

        seed: Seed of paths, headings and drawn numbers. options: {"path": name or waypoints [m]} for this episode, or
        for tasks {"instance": number of the episode}.
        """
        require_seed(seed)
        super().reset(seed=None if seed is None else int(seed))
        asked = checked_options(options, {self.task.option}).get(self.task.option)
        self._batch.np_random = (self.np_random,)
        self._batch.begin(np.ones(1, bool), asked)
        self._frames.clear()
        self._draw_now()
        return self._robots.observe()[0], _of_one_robot(self._robots.first_info())

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Swim for one decision; returns observation, reward, terminated, truncated and info."""
        if not self._batch.is_running or self._batch.needs_reset[0]:
            raise gym.error.ResetNeeded(
                "The episode has not begun, is over or was interrupted: call reset() before step()."
            )
        actions = action[None] if isinstance(action, np.ndarray) else [action]
        look = None if self.render_mode in (None, "rgb_array") else self._look
        (seen, reward, terminated, _), info, *_ = self._batch.advance(actions, look, self.frames_per_stroke)
        self._draw_now()
        return seen[0], reward.item(), terminated.item(), False, _of_one_robot(info)

    def _look(self, time_in_decision: float) -> None:
        if time_in_decision < self.decision_period * (1.0 - ROUNDING):
            self._draw_now()  # the end is drawn once it is known whether a waypoint was reached

    def _draw_now(self) -> None:
        if self.render_mode in ("human", "rgb_array_list"):
            self.draw_frame()

    @property
    def pictures(self) -> BatchPictures:
        """What draws the robot, robot 0 of a batch."""
        return self._batch.pictures

    def frame(self) -> Frame:
        """What a picture shows now."""
        return self.pictures.frames([0])[0]

    def picture(self) -> NDArray[np.uint8]:
        """Picture of now, shape (720, 960, 3)."""
        return self.pictures.draw([0])[0]

    def draw_frame(self) -> None:
        """Draw a picture of now, into the window or for `render`: at a reset, and at the ends of parts of decisions."""
        if self.render_mode == "human":
            self.pictures.show(self.metadata["render_fps"])
            return
        if len(self._frames) == self._frames.maxlen:
            gym.logger.warn(f"Nobody calls render(): of its pictures, the last {len(self._frames)} are kept.")
        self._frames.append(self.picture())

    def render(self) -> NDArray[np.uint8] | list[NDArray[np.uint8]] | None:  # type: ignore[override]
        """Picture, shape (720, 960, 3); "rgb_array_list": the last MOST_FRAMES since the last call; "human": None."""
        if self.render_mode is None:
            gym.logger.warn('render() without a render_mode draws nothing: make the environment with "rgb_array".')
            return None
        if self.render_mode == "rgb_array":
            return self.picture()
        frames = list(self._frames)
        self._frames.clear()
        return frames if self.render_mode == "rgb_array_list" else None

    def action_masks(self) -> NDArray[np.bool_]:
        """Actions that the wires can follow now, shape (k,), see the table of masks."""
        return self._robots.action_masks()[0]

    def sampling_mask(self) -> Any:
        """`action_masks` in the form that `action_space.sample(mask=...)` takes, see `seastar_gym.envs.commands`."""
        return sampling_mask(self.action_space, self.action_masks())

    def close(self) -> None:
        """Close the window, if there is one, and end the simulator's threads."""
        _open.discard(self)
        self.simulator.close()
        self.pictures.close()


class SeastarSwimEnv(OneRobotEnv):
    """Environment of a five-limb soft robot that swims along waypoints, driven by shape memory alloy (SMA) actuators.

    The robot lies in a plane, and all its limbs meet in the hub. Limbs, nodes and angles are numbered and measured
    anti-clockwise; node {i,j} is node j of limb i, counted from the hub. n is the number of limbs.

    ## Action space
    A step is one decision. In `SeastarSwim-v0` it is a stroke of 1 s: commanded limbs are heated for 0.1 s and turn
    about the hub by up to 36 degrees, then they cool for 0.9 s and turn back (Fig. 13.5b). `actions` chooses how a
    command is written:

    | `actions`      | space                       | index  | range      | meaning                                     |
    |----------------|-----------------------------|--------|------------|---------------------------------------------|
    | `"limbs"`      | `MultiDiscrete([3] * n)`    | 0..n-1 | 0..2       | limb: 0 rest, 1 anti-clockwise, 2 clockwise |
    | `"joint"`      | `Discrete(3**n)`            | -      | 0..3**n-1  | number of a command: every combination      |
    | `"pairs"`      | `Discrete(1 + n*(n - 1))`   | -      | 0..n*(n-1) | number of a command: none, or a + and a -   |
    | `"continuous"` | `Box(-1, 1, (n,), float32)` | 0..n-1 | -1..1      | limb: share of a full command, + or -       |

    `"pairs"` learns best: 172.6 strokes on held-out paths, where `"limbs"` takes 196.8 (docs/training.md). `"limbs"` is
    the default because it is the plainest form, for any robot.

    Actions have no unit. `env.command_table[number]` is the command of every limb: 0, 1 (+) or -1 (-). A share is the
    width of the heating pulse, of 0.1 s at most, for wires (`SmaWires`, `ThermalSma`), and scales the rotation of other
    actuators.

    ## Time between decisions
    `decision_period` is the time of a step. Decisions within a stroke need actuators that remember what is under way:
    wires, one for each direction of every limb, that cool while others are heated. The registered ids are

    <ids>

    `SeastarSwimHeading-v0` asks for headings, along the legs of the path. The threshold is `reward_threshold` of the
    spec: about the mean return of the best rule in docs/control.md that is not told what is hidden; for `Station`, a
    little more. `Prizes` ends by itself a decision before its time limit.

    ## Tasks
    With a `task`, the robot swims for something else than the waypoints of a `path`. What a task asks for, observes and
    rewards stands in its docstring: `Miswired`, `Prey`, `Station`, `FailBlind`, `ObstTrap`, `Prizes`, `SimToReal`.
    Actions, masks and everything else are as described here, and pictures show what the robot is not told.

    An episode of a task is a number, and what is drawn for it follows from its split and its number alone. A reset
    draws the number, from two billion in the split "train", from a thousand in "test". `info["instance"]` tells it, and
    `reset(options={"instance": number})` swims a certain one. The splits share no episode.

    Random paths have splits, too: with `path="random", split="test"`, episodes are numbered likewise, and no seed of
    the split "train" draws one of them.

    ## Headings
    With `headings`, a waypoint is reached when the hub is within its radius and the robot's heading is within
    `HeadingTargets.tolerance`, by default 10 degrees, of the target heading. The heading is the direction of the body
    frame, that of limb 1 at rest: limb 1 is distinguished from the others, as if it carried a camera.

    ## Masks
    Some wires cannot be heated now: those of `SmaWires(refractory=True)` until their limb is cold, those of a
    `ThermalSma` with a `largest_temperature` while they are that hot. A command to such a wire does nothing and costs
    nothing. With these actuators, `info` has `action_mask` (int8, 1 for actions that are followed as a whole) and
    `masked_limbs` (int, commands of this decision that were not followed). `env.action_masks()` is the mask as
    booleans, the form of MaskablePPO in sb3-contrib, with any actuator; `env.sampling_mask()` is the same in the form
    of Gymnasium, for `env.action_space.sample(mask=env.sampling_mask())`, None for `"continuous"`:

    | `actions`            | shape          | meaning                                            |
    |----------------------|----------------|----------------------------------------------------|
    | `"limbs"`            | `(3 * n,)`     | limb after limb, actions 0, 1 and 2                |
    | `"joint"`, `"pairs"` | `(n_actions,)` | number of a command                                |
    | `"continuous"`       | `(2 * n,)`     | limb after limb, its wires for + and for -         |

    ## Observation space
    `Box(-inf, inf, (186,), float32)` for five limbs. A limb is seen at nine stations, evenly spaced from hub to tip,
    whatever its nodes; {i,k} is station k of limb i, for the chapter's robot a node. Vectors are seen in a body frame:
    its origin is the hub, and its x axis turns with the robot, see `seastar_gym.envs.observation`. Lengths are in units
    of the limb's length:

    | index    | meaning                                                              | unit      | range       |
    |----------|----------------------------------------------------------------------|-----------|-------------|
    | 0..89    | positions of stations {1,1}..{5,9} relative to the hub: x, y, ..     | 0.1 m     | (-inf, inf) |
    | 90..179  | velocities of stations {1,1}..{5,9} relative to the hub: x, y, ..    | 0.025 m/s | (-inf, inf) |
    | 180..181 | velocity of the hub: x, y                                            | 0.025 m/s | (-inf, inf) |
    | 182..183 | current waypoint relative to the hub: x, y                           | 0.1 m     | (-inf, inf) |
    | 184..185 | next waypoint relative to the hub: x, y; on the last leg the current | 0.1 m     | (-inf, inf) |

    A robot with n limbs has 9 n stations. If a scene's actuators have a memory, it comes before the waypoints, limb
    after limb, unless `observe_actuators` is False:

    | actuator     | numbers of a limb                                          | unit              | range      |
    |--------------|------------------------------------------------------------|-------------------|------------|
    | `SmaWires`   | contractions of wires +, -                                 | 1                 | 0..1       |
    | `ThermalSma` | temperatures of wires +, - above the water, then austenite | A_f - T_water; 1  | 0..; 0..1  |
    | `Limited`    | rotation                                                   | the largest one   | -1..1      |

    With `headings`, the turns to them come after the memory, before the waypoints, anti-clockwise positive:

    | numbers                                                     | unit | range |
    |-------------------------------------------------------------|------|-------|
    | cosine, sine of the turn to the current waypoint's heading  | 1    | -1..1 |
    | cosine, sine of the turn to the next waypoint's heading     | 1    | -1..1 |

    So an observation has 196 numbers in the timed environments, 200 with headings. It is Markov unless decisions are
    shorter than heating pulses. `seastar_gym.envs.observation.Layout` names all these places.

    ## Sight and delays
    A camera sees less, and late. With `sight`, a `Sight`, an observation is computed from the last two pictures that
    were available when a decision was made: positions and waypoints are relative to the hub and heading of the last
    one, and velocities are differences of the two. Further entries come last, before the waypoints:

    | `Sight.sees`                 | stations and hub, index          | further entries, in this order                |
    |------------------------------|----------------------------------|-----------------------------------------------|
    | `"pose"`                     | none                             | velocity of the hub; rate of turn; age        |
    | 1, 3 or 9 markers, k = 10    | 0..k m-1 places, k m..2 k m-1    | rate of turn; age                             |
    | times their number m         | velocities, 2 k m..2 k m+1 hub   |                                               |
    | `"nodes"`                    | all, as in the table above       | age                                           |

    | entry                                                                         | unit      | range       |
    |-------------------------------------------------------------------------------|-----------|-------------|
    | mean velocity of the hub between the two pictures: x, y                       | 0.025 m/s | (-inf, inf) |
    | mean rate of turn between them, anti-clockwise positive                       | rad/s     | (-inf, inf) |
    | age of the last picture                                                       | s         | 0..         |

    The frame is that of the last picture; k = 10 for five limbs. The memory of the actuators follows from the commands
    and is not delayed. `action_delay` is the time from a decision to the heating. Rewards and the end of an episode use
    the true position. `info` has `sight_age`, and drawn numbers, such as `sight.delay` and `action_delay`.

    ## Reward
    The sum of these terms, with the weights of `RewardWeights`; each term is in `info`, too:

    | term              | meaning                                                      | default weight |
    |-------------------|--------------------------------------------------------------|----------------|
    | `reward_progress` | decrease of the length of the route to the last waypoint [m] | 200 per metre  |
    | `reward_waypoint` | waypoints reached in the decision                            | 1 per waypoint |
    | `reward_effort`   | minus the time for which wires were heated, in pulses        | 0.01 per pulse |
    | `reward_time`     | minus the duration of the decision [s]                       | 0 per second   |
    | `reward_heading`  | decrease of what is left to turn [rad], only with `headings` | 8 per radian   |

    A pulse heats one wire for 0.1 s, as a full command of a stroke does. Where an actuator does not say how long it is
    heated, a command counts as its share of a pulse.

    The route is the shortest one that passes the current waypoint within 0.7 of its radius (`RewardWeights.aim`) on the
    way to the next, and leads from centre to centre after that. What is left to turn is the sum of the turn to
    the current waypoint's heading and of those from each heading to the next, each the shorter way round.

    ## Info
    A reset gives the same entries as a step, with zeros for counts and an empty message.

    | name                     | type       | unit | meaning                                                          |
    |--------------------------|------------|------|------------------------------------------------------------------|
    | `time`                   | float      | s    | simulated time since the reset                                   |
    | `hub_position`           | array (2,) | m    | position of the hub in the world: x, y                           |
    | `waypoint_index`         | int        | 1    | number of waypoints reached so far                               |
    | `distance`               | float      | m    | distance of the hub from the current waypoint                    |
    | `cross_track_error`      | float      | m    | distance of the hub from the current leg of the path             |
    | `path_error`             | float      | 1    | promised for random commands, as a fraction of the hub's path    |
    | `gait_error`             | float      | 1    | promised for repeated, held and alternating commands             |
    | `typical_error`          | float      | 1    | median error of random commands                                  |
    | `typical_gait_error`     | float      | 1    | median error of repeated, held and alternating commands          |
    | `space_error`            | float      | 1    | largest measured part of these that more nodes would remove      |
    | `time_error`             | float      | 1    | largest measured part that shorter time steps would remove       |
    | `error_estimate`         | float      | m    | estimate of the hub's error, only with `error_bars`              |
    | `energy_growth`          | float      | 1    | of the kinetic energy since the first 20 strokes, see below      |
    | `batch_real_time_factor` | float      | 1    | simulated time per computing time, of a large batch on one core  |
    | `heading`                | float      | rad  | direction of the body frame in the world, only with `headings`   |
    | `heading_error`          | float      | rad  | turn to the asked heading, -pi to pi, only with `headings`       |
    | `is_success`             | bool       | -    | whether the last waypoint is reached                             |
    | `limbs_heated`           | int        | 1    | number of limbs whose heating began in the decision              |
    | `heating_time`           | float      | s    | time for which wires were heated in it, summed over limbs        |
    | `energy`                 | float      | J    | electric energy of that heat                                     |
    | `energy_per_metre`       | float      | J/m  | energy over the decrease of the route's length, since the reset  |
    | `newton_iterations`      | int        | 1    | Newton iterations of the decision                                |
    | `solver_status`          | int        | -    | `SolverStatus` of the decision, 0: converged, see below          |
    | `smallest_opening_angle` | float      | rad  | between neighbouring limbs, below 0: they crossed; pi on a body  |
    | `largest_overlap`        | float      | 1    | depth to which limbs press, only with contact, see below         |
    | `reward_progress`        | float      | 1    | term of the reward                                               |
    | `reward_waypoint`        | float      | 1    | term of the reward                                               |
    | `reward_effort`          | float      | 1    | term of the reward                                               |
    | `reward_time`            | float      | 1    | term of the reward                                               |
    | `reward_heading`         | float      | 1    | term of the reward, only with `headings`                         |

    `SolverStatus(info["solver_status"]).sentence` says what to do about a status other than 0.
    `energy_per_metre` is infinite where the route has not become shorter; heat and energy are NaN for actuators without
    a heating power.
    Errors from `path_error` to `time_error` are those of docs/accuracy.md for the chapter's robot at a fidelity. They
    are NaN for other robots and scenes, unless a `certificate` has them, and for what was not measured. `Station`,
    `FailBlind` and `SimToReal`, which draw the robot or the water, have no such entries. Decisions within a stroke have
    errors every 0.1 to 0.5 s, and no `batch_real_time_factor`. One robot alone is slower than a batch (docs/speed.md).
    `error_estimate` is of the current run, of any robot: the true error since the reset, of space and time, lies below
    it in about 95 % of strokes (docs/numerics.md); NaN after a failure.
    `energy_growth` is 1 in the first 20 strokes; a value well above 1 means that the time stepping adds energy
    (docs/numerics.md). The chapter's scene at a fidelity has no such entry.
    `largest_overlap`, at the ends of time steps, is over the distance at which limbs touch: 1 where centre lines meet.
    With `randomization`, `info` also has the drawn numbers, by name.

    ## Starting state
    The robot rests with its hub at the origin and limb 1 along +x, or in a random direction with `random_heading`.

    ## Episode end
    `terminated`: the last waypoint is reached, or the solver failed, which has never been seen within a scene's limits;
    the observation then shows the last valid state. `truncated`: the time limit of the id is over.

    ## Arguments
    path: Name of a path - "pentagon", "square", "triangle", "line", "figure-eight", "random", or one that
        `seastar_gym.envs.paths.register_path` added - or waypoints [m], shape (n, 2), from the origin.
        `reset(options={"path": ...})` chooses another path for one episode.
    actions: How commands are written: "limbs", "joint", "pairs" or "continuous", see above.
    fidelity: Accuracy of the simulation: "rapid", "fast", "balanced" (default), "accurate", "reference" or
        "chapter". It chooses nodes per limb, discretisation and numerics, as far as `scene` names none, see `Scene.at`.
        It is refused if it contradicts the numerics that `scene` names.
    scene: Robot, actuators, fluid and numerics; by default the chapter's robot in water.
    reward: Weights of the reward's terms.
    waypoint_radius: Distance of the hub [m] within which a waypoint is reached.
    random_heading: Whether the robot is turned at random at the start of every episode.
    randomization: Distributions of numbers of the scene that are drawn at the start of every episode.
    certificate: Measured errors of the scene for `info`: a `Certificate`, or a file of `seastar certify`. Refused if it
        belongs to another scene, version or time between decisions.
    error_bars: Whether `info` has `error_estimate`, from a finer copy of the robot that is simulated alongside. The
        trajectory stays bit-identical; a step takes three to five times as long.
    decision_period: Time between decisions [s]. None means a stroke, the period of the actuator. If no `scene` is given
        and the time is not 1 s, the robot has `SmaWires` and limbs that damp as soft silicone does. Actuators without
        memory refuse a time in which limbs would not come to rest.
    observe_actuators: Whether observations have the memory of the actuators.
    headings: Target headings at the waypoints, a `HeadingTargets`: along the legs, at random, or given angles. None
        means none.
    device: Where robots are simulated: "cpu", or "cuda" for an NVIDIA GPU, which is bit-identical and pays for batches
        of thousands, see `Simulator`.
    sight: Camera through which robots are seen, a `Sight`. None means that all nodes are seen, without delay.
    action_delay: Time from a decision to the heating [s], or a distribution of it, drawn at the start of every episode
        and rounded up to 0.01 s. Actuators other than wires need a multiple of the decision period.
    task: Name of a task, or a task with numbers of your own, as an object or in plain form; `path`, `reward`,
        `waypoint_radius`, `random_heading` and `headings` are then its own. None means waypoints.
    split: Which episodes of a task, or of random paths, are drawn: "train" or "test".
    render_mode: "rgb_array": `render` returns a picture of the end of the decision. "rgb_array_list": `render` returns
        `frames_per_stroke` pictures of every decision since the last call, the last 100 at most or those of one
        decision. "human": a window shows as many; without a display, a warning says so. `metadata["render_fps"]` is
        the rate of these pictures in simulated time: with "rgb_array", decisions per second.
    frames_per_stroke: Number of pictures of a decision, at equal intervals; the last shows its end. None means ten per
        second of simulated time, and one at least.

    `path`, `random_heading`, `reward` and `waypoint_radius` can be changed later, as in a curriculum, by
    `env.unwrapped.path = ...` or `set_attr` of a batch, and hold from the next episode on. Other arguments are refused.
    `scene`, `reward`, `randomization`, `headings` and `sight` may be given as plain data, as written by
    `Scene.to_dict` and `seastar_gym.scene.serial.to_dict`, in any mappings and sequences. `env.spec` stores this form,
    so `gym.make(EnvSpec.from_json(env.spec.to_json()))` is the same environment.
    """

    def __init__(
        self,
        path: Path = "pentagon",
        actions: Actions = "limbs",
        fidelity: Fidelity | None = None,
        scene: Scene | Plain | None = None,
        reward: RewardWeights | Plain = RewardWeights(),
        waypoint_radius: float = WAYPOINT_RADIUS,
        random_heading: bool = False,
        randomization: DomainRandomization | Plain | None = None,
        certificate: Certificate | str | None = None,
        error_bars: bool = False,
        decision_period: float | None = None,
        observe_actuators: bool = True,
        headings: HeadingTargets | Plain | None = None,
        device: str = "cpu",
        sight: Sight | Plain | None = None,
        action_delay: Drawn | Plain = 0.0,
        task: Task | Plain | str | None = None,
        split: Split = "train",
        *,
        render_mode: RenderMode | None = None,
        frames_per_stroke: int | None = None,
    ):
        robots = swimmers(
            1, 1, task, split, path=path, actions=actions, fidelity=fidelity, scene=scene, reward=reward,
            waypoint_radius=waypoint_radius, random_heading=random_heading, randomization=randomization,
            certificate=certificate, error_bars=error_bars, decision_period=decision_period,
            observe_actuators=observe_actuators, headings=headings, device=device, sight=sight,
            action_delay=action_delay,
        )  # fmt: skip
        super().__init__(robots, render_mode, frames_per_stroke)

    _arguments = arguments_of(__init__)


def table_of_ids() -> str:
    """Table of the registered ids, see `seastar_gym.envs.IDS`."""
    head = "id", "`task`", "decision period [s]", "`actions`", "time limit [s]", "decisions", "threshold"
    rows = [
        (f"`{id}`", f'`"{row.task}"`' if row.task else "-", f"{row.decision_period}", f'`"{row.actions}"`',
         f"{row.seconds:g}", f"{row.decisions}", "-" if row.threshold is None else f"{row.threshold:g}")
        for id, row in IDS.items()
    ]  # fmt: skip
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    cells = [[cell.ljust(width) for cell, width in zip(row, widths, strict=True)] for row in (head, *rows)]
    first, *others = [f"| {' | '.join(row)} |" for row in cells]
    return "\n    ".join([first, f"|{'|'.join('-' * (width + 2) for width in widths)}|", *others])


SeastarSwimEnv.__doc__ = str(SeastarSwimEnv.__doc__).replace("<ids>", table_of_ids())


@cache
def _tell_of_batches() -> None:
    """One sentence per process."""
    gym.logger.warn(
        f"{MANY} environments of one robot are open in this process, stepped one after the other: gym.make_vec(id, "
        'num_envs=128, vectorization_mode="vector_entry_point") steps 128 robots in one compiled call, which '
        "seastar_gym.adapters.stable_baselines3.BatchVecEnv hands to Stable-Baselines3."
    )


def _of_one_robot(info: dict[str, NDArray[Any]]) -> dict[str, Any]:
    """Info of robot 0 as plain numbers, its vectors as arrays, copies."""
    return {name: values[0].copy() if values.ndim > 1 else values.item() for name, values in info.items()}
