"""One agent swims one episode: `swim`, and what can be measured on it afterwards."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy, require_fit, require_policy
from seastar_gym.envs.paths import cross_track_error, path_length
from seastar_gym.envs.seastar_swim import OneRobotEnv
from seastar_gym.evaluation.rollout import MOST_DECISIONS, Episodes, Info, rollout
from seastar_gym.scene.checks import require_callable, require_count, require_kind
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
