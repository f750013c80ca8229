"""Tolerances and bounds of the solution of a stroke."""

from typing import NamedTuple

import numpy as np


class Limits(NamedTuple):
    """Tolerances and bounds that the kernels keep.

    tolerance: Largest displacement of a node in the last Newton update [m], one row.
    max_iterations: Newton steps of a stage before its time step is halved.
    most_iterations: Newton steps of a stroke before the robot has failed.
    adaptive: Whether time steps are adapted to their error.
    error_rate: Largest error per time [m/s], one row.
    """

    tolerance: np.ndarray
    max_iterations: int
    most_iterations: int
    adaptive: bool
    error_rate: np.ndarray
