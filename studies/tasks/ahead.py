"""What controllers of the study know of a robot: where commands lead, by a map of means or by the simulator."""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.greedy import Displacements, displacement_map, turned, waypoints_of
from seastar_gym.controllers.planner import Branching, state_of
from seastar_gym.envs.commands import unless_strokes
from seastar_gym.envs.stations import heading_of
from seastar_gym.simulator import State
from studies.frame import Floats

Floats32 = NDArray[np.float32]

COASTING = 0.5
"""Time for which robots in time swim on before they are compared [s], see `seastar_gym.controllers.planner.Budget`."""
SPEED_IN_STROKES, SPEED_IN_TIME = 0.0043, 0.0075
"""Speed at which a robot swims any way [m/s]."""


class Robots:
    """The robots of a batch, as their controllers know them.

    table: Commands of all actions, shape (n_actions, n_limbs). period: Time between decisions [s]. speed: At which they
    swim any way [m/s].
    """

    def __init__(self, batch: Any):
        inner = batch.unwrapped
        self.inner, self.scene, self.n = inner, inner.scene, inner.num_envs
        self.table, self.period = inner.command_table, inner.decision_period
        self.in_strokes = unless_strokes(self.period, self.scene) is None
        self.speed = SPEED_IN_STROKES if self.in_strokes else SPEED_IN_TIME
        self._numbers = {command.tobytes(): k for k, command in enumerate(self.table + 0.0)}
        self._layout = inner.layout

    def map(self) -> Displacements:
        """Mean displacements of all actions."""
        return displacement_map(self.scene, self.inner.actions, None if self.in_strokes else self.period)

    def actions_of(self, commands: Floats) -> NDArray[np.int64]:
        """Numbers of commands, shape (n, n_limbs)."""
        return np.array([self._numbers[command.tobytes()] for command in commands + 0.0])

    def own(self, observations: Floats32) -> Floats:
        """Numbers that the task shows of its own, shape (n, size)."""
        return observations[:, self._layout.further].astype(np.float64)

    def targets(self, observations: Floats32) -> tuple[Floats, Floats]:
        """Both targets relative to the hub in the body frame [m], shape (n, 2) each."""
        return waypoints_of(observations, self.scene, self._layout)

    def states(self, observations: Floats32) -> State:
        """States of the robots in their body frames, with their hubs at the origin."""
        return state_of(observations, self.scene, self._layout)

    def heading(self) -> Floats:
        """Directions of the body frames in the world [rad]."""
        return heading_of(self.inner.simulator)


class Odometer:
    """Displacement and turn of robots from one look to the next, in the body frame of the former."""

    def __init__(self, robots: Robots):
        self._robots, self._hub, self._heading = robots, None, np.zeros(robots.n)

    def read(self) -> tuple[Floats, Floats] | None:
        """Displacements [m], shape (n, 2), and turns [rad], shape (n,), since the last reading; None at the first."""
        hub, heading = self._robots.inner.simulator.hub_position(), self._robots.heading()
        before, was = self._hub, self._heading
        self._hub, self._heading = hub, heading
        if before is None:
            return None
        turn = heading - was
        return turned(hub - before, -was), turn - 2.0 * np.pi * np.rint(turn / (2.0 * np.pi))


def few_commands(n_limbs: int) -> Floats:
    """No limb, every limb by itself, and every two limbs, either way each: shape (51, 5) for five limbs."""
    every = np.array(list(itertools.product((0.0, 1.0, -1.0), repeat=n_limbs)))
    return every[np.count_nonzero(every, axis=1) <= 2]


class Ahead:
    """Simulation of commands ahead of every robot, and search for the sequence that costs least.

    commands: Shape (n_commands, n_limbs), or (n, n_commands, n_limbs) where every robot has its own. In time, robots
    swim on for COASTING before their place is told.
    """

    def __init__(self, robots: Robots, commands: Floats, depth: int = 1, beam: int = 4):
        period = None if robots.in_strokes else robots.period
        self.commands, self._depth, self._beam = commands, depth, beam
        self.coasting = 0.0 if robots.in_strokes else COASTING
        self._swim_all = Branching(robots.scene, commands[..., None, :], 1, period)

    def _swum(self, states: State, n: int) -> State:
        """States of n robots after each of the commands, see `Branching`."""
        if self.commands.ndim == 2:
            return self._swim_all(states)
        return self._swim_all.each(states, np.repeat(self.commands, len(states.time) // n, axis=0)[..., None, :])

    def best(self, states: State, cost: Any) -> NDArray[np.intp]:
        """Number of the first command of the best sequence of every robot, shape (n,).

        cost: Function of hubs in the body frame where the search began [m], shape (n, m, 2), and of the number of
        decisions so far; its sum over the decisions is least.
        """
        n, k = len(states.time), self.commands.shape[-2]
        robots = np.arange(n)[:, None]
        first, total = np.tile(np.arange(k), (n, 1)), np.zeros((n, k))
        for decision in range(1, self._depth + 1):
            states = self._swum(states, n)
            hub = states.positions[:, 0]
            if self.coasting > 0.0:
                hub = self._swim_all.coasted(states, self.coasting)[:, 0]
            total = total + cost(hub.reshape(n, -1, 2), decision)
            if decision == self._depth:
                break
            kept = np.argsort(total, axis=1)[:, : self._beam]
            width = total.shape[1]
            states = states.of_robots((robots * width + kept).reshape(-1))
            first, total = (np.repeat(values[robots, kept], k, axis=1) for values in (first, total))
        return np.asarray(first[robots[:, 0], np.argmin(total, axis=1)])
