"""How a stroke ended and what it cost, robot by robot."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class SolverStatus(IntEnum):
    """Whether a robot's stroke was computed, and if not, why."""

    CONVERGED = 0
    NOT_CONVERGED = 1
    NOT_FINITE = 2
    ITERATION_LIMIT = 3

    @property
    def sentence(self) -> str:
        """What to tell the user."""
        return {
            SolverStatus.CONVERGED: "The stroke converged.",
            SolverStatus.NOT_CONVERGED: (
                "A time step did not converge even after it was halved to its floor; the robot stays at its last good "
                "state until it is reset: use a smaller Numerics.step, a softer robot or slower initial velocities."
            ),
            SolverStatus.NOT_FINITE: (
                "The robot's positions or velocities were not finite when the stroke began; it lies at rest where its "
                "hub was before, until it is reset: write finite numbers into Simulator.q and Simulator.v only."
            ),
            SolverStatus.ITERATION_LIMIT: (
                "The stroke took all Newton iterations that a robot has for one (see Numerics); the robot stays at its "
                "last good state until it is reset: use a smaller Numerics.step or peak angle, or slower initial "
                "velocities."
            ),
        }[self]


COUNTS = ("newton_iterations", "regularised", "backtracks", "steps", "halvings", "rejections", "energy_cuts")


class StrokeReport(NamedTuple):
    """What a stroke cost and how it ended; every array has shape (n_robots,).

    status: SolverStatus of every robot.
    newton_iterations, regularised, backtracks: Counts of Newton steps, of those that needed the convex matrix, and of
        those that the line search halved.
    steps, halvings, rejections: Counts of time steps taken, of those that did not converge or created energy and were
        halved (or, at the shortest, tried again), and of those whose error was too large and were halved
        (Numerics.path_tolerance).
    energy_cuts: Steps after which velocities were cut, because the energy had grown a little, see der/guard.py.
    covered: Time covered [s].
    smallest_opening_angle: Smallest angle between neighbouring limbs at the hub [rad]; below zero, limbs crossed.
    """

    status: NDArray[np.int64]
    newton_iterations: NDArray[np.int64]
    regularised: NDArray[np.int64]
    backtracks: NDArray[np.int64]
    steps: NDArray[np.int64]
    halvings: NDArray[np.int64]
    rejections: NDArray[np.int64]
    energy_cuts: NDArray[np.int64]
    covered: Floats
    smallest_opening_angle: Floats
