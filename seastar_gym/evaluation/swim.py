"""One agent swims one episode, `swim`, or many side by side, `swim_many`, nominal or disturbed.

Disturbances are a current, a weak limb, noise on observations and lost strokes. A uniform current is a change of frame:
the robots swim in still water, towards waypoints that drift the other way, and observations and positions are carried
back. So every robot of a batch has a current in a direction of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy, actions_of, require_fit, require_policy
from seastar_gym.controllers.search import turned
from seastar_gym.envs.commands import decisions_in
from seastar_gym.envs.layout import VELOCITY_SCALE
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.paths import WAYPOINT_RADIUS, cross_track_error, path_length
from seastar_gym.envs.robots import Flags, Outcome, Robots
from seastar_gym.envs.seastar_swim import OneRobotEnv
from seastar_gym.envs.sight import Drawn, Sight
from seastar_gym.envs.stations import heading_of
from seastar_gym.envs.vector import ManyRobotsEnv
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.envs.waypoints import Path as SwimPath
from seastar_gym.evaluation.rollout import MOST_DECISIONS, Episodes, Info, rollout
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_callable, require_count, require_kind, require_number
from seastar_gym.scene.number import column
from seastar_gym.simulator import SolverStatus

Floats = NDArray[np.float64]
TIME_LIMIT = 400.0
"""Time after which a swim that is evaluated ends, unless another limit is given [s]."""
RECORDED = ("hub_position", "waypoint_index", "time", "limbs_heated", "heating_time", "energy", "solver_status")
"""Entries of info that make a `Swim`."""


@dataclass(frozen=True, eq=False)
class Swim:
    """Record of one agent on one path.

    hub, waypoint_index and time are those at the start and after every stroke, strokes + 1 of them. In a timed
    environment, a stroke is a decision.
    """

    agent: str
    waypoints: Floats
    """[m], shape (n, 2)."""
    hub: Floats
    """Hub positions [m], shape (strokes + 1, 2)."""
    waypoint_index: NDArray[np.int64]
    """Waypoints reached, shape (strokes + 1,)."""
    time: Floats
    """Simulated time [s], shape (strokes + 1,)."""
    limbs_heated: NDArray[np.int64]
    """Limbs whose heating began, shape (strokes,)."""
    heating_time: Floats
    """Time for which wires were heated, summed over limbs [s], shape (strokes,)."""
    energy: Floats
    """Electric energy of that heat [J], shape (strokes,)."""
    solver_message: str | None
    """Why the solver gave up, where it did."""

    @property
    def strokes(self) -> int:
        """Strokes swum."""
        return len(self.limbs_heated)

    @property
    def counted_in(self) -> str:
        """What `strokes` are to be called: decisions, if they are not a second apart."""
        in_strokes = len(self.time) < 2 or math.isclose(self.time[1] - self.time[0], 1.0)
        return "strokes" if in_strokes else "decisions"

    @property
    def result(self) -> str:
        """Strokes, or decisions, to the last waypoint, or how many waypoints were reached; a few words."""
        if self.finished:
            return f"{self.strokes} {self.counted_in}"
        return f"{self.waypoints_reached} of {len(self.waypoints)} waypoints"

    @property
    def waypoints_reached(self) -> int:
        """Waypoints reached at the end."""
        return int(self.waypoint_index[-1])

    @property
    def finished(self) -> bool:
        """Whether the last waypoint was reached."""
        return self.waypoints_reached == len(self.waypoints)

    @cached_property
    def cross_track_errors(self) -> Floats:
        """Distance [m] of the hub from the path at the end of every stroke, shape (strokes,).

        The path there is the leg that the hub is on and the one before: a waypoint counts as reached a waypoint radius
        early, and a hub that then still follows the old leg into the corner does not stray.
        """
        corners = np.concatenate([np.zeros((1, 2)), self.waypoints])
        leg = np.minimum(self.waypoint_index[1:], len(self.waypoints) - 1)
        now = cross_track_error(self.hub[1:], corners[leg], corners[leg + 1])
        leg = np.maximum(leg - 1, 0)
        return np.minimum(now, cross_track_error(self.hub[1:], corners[leg], corners[leg + 1]))

    @property
    def hub_path_length(self) -> float:
        """Length [m] of the hub's way from one second to the next, or from stroke to stroke if those are longer.

        Within a stroke the hub swings to and fro, which is no way swum.
        """
        every = max(1, round(1.0 / (self.time[1] - self.time[0]))) if len(self.time) > 1 else 1
        return float(path_length(self.hub[0], np.concatenate([self.hub[::every], self.hub[-1:]])))

    @property
    def heated_per_metre(self) -> float | None:
        """Limbs heated per metre of the hub's way [1/m]; None where the hub did not move."""
        return self._per_metre(self.limbs_heated)

    @property
    def seconds_heated(self) -> float | None:
        """Time for which wires were heated, summed over limbs [s]; None where the actuator does not say it."""
        total = float(self.heating_time.sum())
        return total if math.isfinite(total) else None

    @property
    def joules_per_metre(self) -> float | None:
        """Electric energy per metre of the hub's way [J/m]; None where it is unknown or the hub did not move."""
        found = self._per_metre(self.energy)
        return found if found is not None and math.isfinite(found) else None

    def _per_metre(self, of_strokes: NDArray[Any]) -> float | None:
        length = self.hub_path_length
        return float(of_strokes.sum() / length) if length > 0.0 else None


def swim(
    agent: str,
    policy: Policy,
    env: OneRobotEnv,
    *,
    max_strokes: int,
    seed: int | None = None,
    reset_options: dict[str, Any] | None = None,
    watch: Callable[[OneRobotEnv], None] | None = None,
) -> Swim:
    """One episode, with deterministic actions, to the last waypoint or for `max_strokes` strokes.

    ValueError, before it begins, where the policy was made for another robot.
    watch: Called with `env` after its reset and after every stroke, to film it for instance.
    """
    require_kind("agent", agent, str, "a text")
    require_policy(policy)
    require_kind("env", env, OneRobotEnv, "an environment of waypoints, without wrappers: gym.make(...).unwrapped")
    require_count("max_strokes", max_strokes, 1, MOST_DECISIONS)
    if watch is not None:
        require_callable("watch", watch)
    assert env.observation_space.shape is not None
    n_seen, task = env.observation_space.shape[0], getattr(env, "task", None)
    require_fit(policy, env.scene, env.actions, env.decision_period, n_seen, task, env.sight)

    def look(info: Info) -> None:
        if watch is not None:
            watch(env)

    found = rollout(
        env, policy, seeds=seed, options=reset_options, until=max_strokes, record=RECORDED, on_step=look
    )  # fmt: skip
    (done,) = swims_of(agent, found)
    return done


def swims_of(agent: str, found: Episodes) -> list[Swim]:
    """Swims of an agent, from episodes along waypoints in which RECORDED was kept."""
    return [_swim_of(agent, found, robot) for robot in range(len(found.decisions))]


def _swim_of(agent: str, found: Episodes, robot: int) -> Swim:
    end = found.decisions[robot] + 1
    of = {name: values[:end, robot].copy() for name, values in found.entries.items()}
    status = SolverStatus(of["solver_status"][-1])
    return Swim(
        agent=agent,
        waypoints=found.waypoints[robot],
        hub=of["hub_position"],
        waypoint_index=of["waypoint_index"],
        time=of["time"],
        limbs_heated=of["limbs_heated"][1:],
        heating_time=of["heating_time"][1:],
        energy=of["energy"][1:],
        solver_message=None if status is SolverStatus.CONVERGED else status.sentence,
    )


CURRENT_DIRECTIONS = 8


@dataclass(frozen=True)
class Disturbance:
    """Strengths of the disturbances of a batch; zeros disturb nothing.

    current: Speed of the current [m/s], which has the direction of i/8 of a full turn for robot i.
    weakness: Share of its strength that limb i mod n of robot i lacks.
    noise: Standard deviation of the observed position of the hub and of every station [m].
    lost: Probability that a stroke fails.
    """

    current: float = 0.0
    weakness: float = 0.0
    noise: float = 0.0
    lost: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("current", "m/s"), ("weakness", "1"), ("noise", "m"), ("lost", "1")):
            require_number(f"Disturbance.{name}", getattr(self, name), unit, zero_allowed=True)
        if max(self.weakness, self.lost) > 1.0:
            raise ValueError("weakness and lost must be at most 1.")


DISTURBANCES = {
    "none": Disturbance(),
    "current of 0.5 mm/s": Disturbance(current=0.5e-3),
    "current of 1.5 mm/s": Disturbance(current=1.5e-3),
    "a limb at half strength": Disturbance(weakness=0.5),
    "1 mm of noise": Disturbance(noise=1e-3),
    "every tenth stroke lost": Disturbance(lost=0.1),
}


class DisturbedRobots(Robots):
    """Robots that are disturbed; positions are those in the world, where the waypoints stand still.

    rng: Draws noise and lost strokes. task, options, n_robots, threads: See `Robots`.
    """

    task: AlongPath

    def __init__(
        self,
        disturbance: Disturbance,
        rng: np.random.Generator,
        task: AlongPath,
        options: SwimOptions,
        n_robots: int,
        threads: int | None,
    ):
        super().__init__(task, options, n_robots, threads)
        self.disturbance, self._rng = disturbance, rng
        robots, n_limbs = np.arange(self.n_robots), self.scene.robot.n_limbs
        angles = 2.0 * np.pi / CURRENT_DIRECTIONS * robots
        self._current = disturbance.current * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        left = np.where(robots[:, None] % n_limbs == np.arange(n_limbs), 1.0 - disturbance.weakness, 1.0)
        self.simulator.set_limb_strengths(self.simulator.limb_strengths * left)
        self._carried = np.zeros((self.n_robots, 2))

    def reset(self, robots: Flags, generators: list[np.random.Generator], asked: Any = None) -> None:
        """Begin an episode of the robots in a mask, at rest in the world where it is that of all."""
        super().reset(robots, generators, asked)
        if robots.all():  # a state is put into all robots
            state = self.simulator.get_state()
            self.simulator.set_state(state._replace(velocities=state.velocities - self._current[:, None]))
        self._carried[robots] = 0.0

    def facts(self, hub: Floats | None = None) -> dict[str, NDArray[Any]]:
        """What is known of every robot now, with its place in the world."""
        facts = super().facts(hub)
        return facts | {"hub_position": facts["hub_position"] + self._carried}

    def observe(self) -> NDArray[np.float32]:
        """Observations of the disturbed robots, shape (n_robots, size)."""
        seen, at = super().observe(), self.layout
        if self.disturbance.current > 0.0:
            axes = heading_of(self.simulator)
            seen[:, at.hub_velocity] += turned(self._current, -axes) / VELOCITY_SCALE
        if self.disturbance.noise > 0.0:
            n_places = 1 + seen[:, at.positions].shape[1] // 2
            error = self._rng.normal(0.0, self.disturbance.noise, (len(seen), n_places, 2))
            error /= column(self.scene.robot.limb_length, 2)
            seen[:, at.positions] += (error[:, 1:] - error[:, :1]).reshape(len(seen), -1)
            seen[:, at.waypoints] -= np.tile(error[:, 0], 2)
        return seen

    def step(self, commands: Floats) -> Outcome:
        """One decision of every robot; returns its outcome, with the commands that were followed and not lost.

        Robots whose solver gave up stay where they are: their swims are as long as those of others who do not arrive.
        """
        lost = self._rng.random(len(commands)) < self.disturbance.lost
        drift = self._current * self.decision_period
        self.task.move_waypoints(self, -drift)
        self._carried += drift
        outcome = super().step(np.where(lost[:, None], 0.0, commands))
        return outcome._replace(terminated=outcome.info["is_success"])


HELD_OUT_SEED = 1_000
"""Seed of the paths that policies are measured on; trainings draw theirs from small seeds."""
MOST_SWIMS, LARGEST_SEED = 1_000_000, 2**63
"""Most swims side by side, and the largest seed of their paths."""


def swim_many(
    agent: str,
    policy: Policy,
    path: SwimPath,
    n_swims: int,
    scene: Scene,
    disturbance: Disturbance = Disturbance(),
    *,
    max_strokes: int | None = None,
    waypoint_radius: float = WAYPOINT_RADIUS,
    seed: int = 0,
    threads: int | None = None,
    decision_period: float | None = None,
    sight: Sight | None = None,
    action_delay: Drawn = 0.0,
) -> list[Swim]:
    """Swims of `n_swims` robots side by side, each to its last waypoint or for `max_strokes` strokes, or decisions.

    The path "random" has random headings. max_strokes: None means the decisions of 400 s. waypoint_radius:
    Radius of the waypoints [m]. decision_period: Time between decisions [s]. None means a stroke. sight,
    action_delay: As of the environments.
    """
    require_kind("agent", agent, str, "a text")
    require_policy(policy)
    require_kind("scene", scene, Scene, "a Scene")
    require_kind("disturbance", disturbance, Disturbance, "a Disturbance")
    require_count("n_swims", n_swims, 1, MOST_SWIMS)
    if max_strokes is not None:
        require_count("max_strokes", max_strokes, 1, MOST_DECISIONS)
    require_count("seed", seed, 0, LARGEST_SEED)
    actions = actions_of(policy, scene.robot.n_limbs)
    with_heading = isinstance(path, str) and path == "random"
    task = AlongPath(path, waypoint_radius=waypoint_radius, random_heading=with_heading)
    options = SwimOptions(
        actions, scene=scene, decision_period=decision_period, sight=sight, action_delay=action_delay
    )  # fmt: skip
    robots = DisturbedRobots(disturbance, np.random.default_rng([seed, n_swims]), task, options, n_swims, threads)
    require_fit(policy, scene, actions, decision_period, robots.layout.size, sight=sight)
    batch, limit = ManyRobotsEnv(robots), max_strokes or decisions_in(TIME_LIMIT, decision_period, scene)
    batch.np_random = tuple(np.random.default_rng([seed, swim]) for swim in range(n_swims))
    swims = swims_of(agent, rollout(batch, policy, until=limit, record=RECORDED))
    batch.close()
    return swims
