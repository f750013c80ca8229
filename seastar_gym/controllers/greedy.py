"""Greedy agent: it chooses commands by a map of the mean displacement that each of them makes.

    seastar evaluate --agents greedy planner pentagon

The map has the displacement of the hub in the body frame and the turn of the robot, per stroke of every command, once
the repeated command swims steadily. It is computed once for every scene and kept in the user's cache folder. In a timed
environment, commands are repeated at every decision, which heats the same wires over and over: the map knows no lag.
"""

from __future__ import annotations

import hashlib
import os
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import can_be_decided_by, observed
from seastar_gym.envs.commands import Actions, checked_decision_period, command_table, decisions_in
from seastar_gym.envs.layout import OBSERVATION_LAYOUT, Layout
from seastar_gym.envs.options import RewardWeights
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.stations import heading_of
from seastar_gym.files import beside
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_kind, require_number
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]

SETTLING_STROKES, MEASURED_STROKES = 6, 4
"""A repeated command swims steadily, to 1 %, after about six strokes."""


class Displacements(NamedTuple):
    """Mean displacements of the hub [m] in the body frame, shape (n, 2), and turns [rad], shape (n,), of n gaits."""

    hub: Floats
    turn: Floats


def turned(vectors: Floats, angles: Floats) -> Floats:
    """Vectors, shape (n, 2), turned by angles [rad], shape (n,)."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1)


def measure_gaits(
    scene: Scene, commands: Floats, settling: int, measured: int, decision_period: float | None = None
) -> Displacements:
    """Mean displacement and turn per stroke of periodic gaits, in the body frame when the measured strokes begin.

    commands: Commands of every gait, shape (n, period, n_limbs). settling, measured: Numbers of strokes before and
    during the measurement; `measured` is a multiple of the period. decision_period: Time between commands [s], called a
    stroke here. None means a stroke of the actuator.
    """
    simulator, duration = Simulator(scene, len(commands)), checked_decision_period(decision_period, scene)
    for stroke in range(settling + measured):
        if stroke == settling:
            hub, heading = simulator.hub_position(), heading_of(simulator)
        simulator.advance(duration, commands[:, stroke % commands.shape[1]])
    turn = heading_of(simulator) - heading
    turn -= 2.0 * np.pi * np.rint(turn / (2.0 * np.pi))
    return Displacements(turned(simulator.hub_position() - hub, -heading) / measured, turn / measured)


def displacement_map(scene: Scene, actions: Actions = "joint", decision_period: float | None = None) -> Displacements:
    """Map of a scene for the commands of an action mode, from the cache or measured now."""
    asked: tuple[Any, ...] = scene, actions, SETTLING_STROKES, MEASURED_STROKES, OBSERVATION_LAYOUT
    if decision_period is not None:
        asked = *asked, decision_period
    settling, measured_strokes = (
        decisions_in(n * scene.actuator.period, decision_period, scene) for n in (SETTLING_STROKES, MEASURED_STROKES)
    )
    key = hashlib.sha256(repr(asked).encode()).hexdigest()[:24]
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "seastar-gym"
    file = cache / f"displacements-{key}.npz"
    with suppress(OSError, ValueError, KeyError, EOFError, BadZipFile), np.load(file, allow_pickle=False) as known:
        return Displacements(known["hub"], known["turn"])
    commands = command_table(actions, scene.robot.n_limbs)[:, None]
    measured = measure_gaits(scene, commands, settling, measured_strokes, decision_period)
    with beside(file) as part, part.open("wb") as stream:
        np.savez(stream, hub=measured.hub, turn=measured.turn)
    return measured


def waypoints_of(
    observations: NDArray[np.float32], scene: Scene, layout: Layout | None = None
) -> tuple[Floats, Floats]:
    """Current and next waypoint [m] relative to the hub in the body frame, (n, 2) each.

    layout: Of the observations. None means that of waypoints without headings.
    """
    at, length = Layout.of(scene) if layout is None else layout, scene.robot.limb_length
    observations = np.atleast_2d(observed(observations, at.size))
    current, after = observations[:, at.current_waypoint], observations[:, at.next_waypoint]
    return length * current.astype(np.float64), length * after.astype(np.float64)


def require_search(scene: Scene, waypoint_radius: float, reward: object, decision_period: float | None) -> None:
    """ValueError for what no policy can search with."""
    require_kind("scene", scene, Scene, "a Scene")
    if scene.n_robots is not None:
        raise ValueError("scene must be that of one robot.")
    require_number("waypoint_radius", waypoint_radius, "m")
    require_kind("reward", reward, RewardWeights, "RewardWeights")
    checked_decision_period(decision_period, scene)


class Searcher(ABC):
    """Base of policies that choose actions by observations alone, for one robot or for many."""

    batched = True
    actions: Actions
    decision_period: float | None = None
    """Time between decisions [s]. None means a stroke."""
    scene: Scene
    """Scene that the policy knows."""

    @property
    def n_limbs(self) -> int:
        """Number of limbs of the robot that it drives."""
        return self.scene.robot.n_limbs

    @abstractmethod
    def choose(self, observations: NDArray[np.float32]) -> NDArray[np.int64]:
        """Actions, shape (n,), for observations of shape (n, size)."""

    def predict(
        self,
        observation: NDArray[np.float32],
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[np.int64], None]:
        """Actions for observations of shape (size,) or (n, size), and None: there is no state.

        A robot whose observation has a number that is NaN, infinite or beyond 1e30 rests, by action 0.
        """
        observations = np.atleast_2d(observed(observation, 1))
        known = can_be_decided_by(observations)
        chosen = np.zeros(len(observations), np.int64)
        if known.any():
            chosen[known] = self.choose(observations[known])
        return (chosen[0] if np.ndim(observation) == 1 else chosen), None


class GreedyPolicy(Searcher):
    """Agent that chooses the command whose mean displacement leaves the shortest rewarded route.

    scene: Scene in which displacements are measured; that of the environment, for a fair comparison.
    waypoint_radius: Radius of the waypoints [m]. reward: Reward whose route is shortened. decision_period: Of the
    environment [s]. None means a stroke.
    """

    actions = "joint"

    def __init__(
        self,
        scene: Scene,
        waypoint_radius: float = WAYPOINT_RADIUS,
        reward: RewardWeights = RewardWeights(),
        decision_period: float | None = None,
    ):
        require_search(scene, waypoint_radius, reward, decision_period)
        self.scene, self.waypoint_radius, self.reward = scene, waypoint_radius, reward
        self.decision_period = decision_period
        self._hub = displacement_map(scene, self.actions, decision_period).hub

    def choose(self, observations: NDArray[np.float32]) -> NDArray[np.int64]:
        """Actions, shape (n,), for observations of shape (n, size)."""
        current, following = (waypoint[:, None] for waypoint in waypoints_of(observations, self.scene))
        return np.argmin(self.reward.way_to_next(self._hub, current, following, self.waypoint_radius), axis=1)
