"""`Lag`: commands on their way from decisions to wires."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.randomization import Distribution
from seastar_gym.envs.sight import Drawn, bounds_of
from seastar_gym.scene.actuators.actuator import Actuator
from seastar_gym.scene.actuators.heating import WirePair

Floats = NDArray[np.float64]

GRID = 0.01
"""Drawn delays are rounded up to multiples of this time [s], so that all robots of a batch swim the same steps."""
ROUNDING = 1e-9


class Piece(NamedTuple):
    """Part of a decision, from one time at which commands may reach wires to the next."""

    begin: float
    """Time since the decision [s]."""
    duration: float
    """[s]"""
    commands: Floats
    """Commands that reach the wires at its beginning, shape (n_robots, n_limbs); 0 for what goes on."""


class Lag:
    """Commands of `n_robots` robots that reach their wires some time after the decision.

    delay: That time [s], or its distribution. period: Time between decisions [s].
    """

    def __init__(self, delay: Drawn, period: float, actuator: Actuator, n_robots: int, n_limbs: int):
        self._grid = GRID if isinstance(delay, Distribution) else None
        self._period = period
        low, high = bounds_of(delay)
        possible = [low] if self._grid is None else GRID * np.arange(_whole(low / GRID), _whole(high / GRID) + 1)
        places = [self._place(one) for one in possible]
        self._begins = sorted({0.0, *(rest for _, rest in places)})
        if len(self._begins) > 1 and not isinstance(actuator, WirePair):
            raise ValueError(
                f"action_delay must be whole decisions of {period:g} s for a {type(actuator).__name__}, whose strokes "
                "begin with decisions: use wires, such as SmaWires."
            )
        self._waiting = np.zeros((n_robots, 1 + max(whole for whole, _ in places), n_limbs))  # the latest first
        self._decisions, self._begin = np.zeros((2, n_robots), np.int64)

    def _place(self, delay: float) -> tuple[int, float]:
        """Whole decisions of a delay [s], and the rest of it [s]."""
        if self._grid is not None:
            delay = GRID * _whole(delay / GRID)
        decisions = math.floor(delay / self._period + ROUNDING)
        rest = delay - decisions * self._period
        return decisions, round(rest, 9) if rest > ROUNDING * self._period else 0.0

    def begin(self, robots: NDArray[np.bool_], delays: Floats) -> None:
        """Begin the episodes of the robots in a mask, with nothing on its way. delays: [s], shape (n_robots,)."""
        self._waiting[robots] = 0.0
        for robot in np.flatnonzero(robots):
            self._decisions[robot], rest = self._place(float(delays[robot]))
            self._begin[robot] = self._begins.index(rest)

    def pieces(self, commands: Floats) -> list[Piece]:
        """Pieces of the decision of these commands, shape (n_robots, n_limbs)."""
        arriving = self._with(commands)[np.arange(len(commands)), self._decisions]
        return [
            Piece(begin, end - begin, np.where((self._begin == k)[:, None], arriving, 0.0))
            for k, (begin, end) in enumerate(pairwise([*self._begins, self._period]))
        ]

    def send(self, commands: Floats) -> None:
        """The decision of these commands is over."""
        self._waiting = self._with(commands)

    def _with(self, commands: Floats) -> Floats:
        return np.concatenate([commands[:, None], self._waiting[:, :-1]], axis=1)


def _whole(count: float) -> int:
    """Number of steps of a grid, rounded up."""
    return math.ceil(count - ROUNDING)
