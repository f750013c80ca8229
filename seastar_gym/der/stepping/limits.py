"""What the solution of a stroke has to keep."""

from typing import NamedTuple

import numpy as np


class Limits(NamedTuple):
    """What a solution has to keep.

    tolerance: Largest node move of the last Newton update [m], one row.
    max_iterations: Newton steps per stage before a time step is halved.
    most_iterations: Newton steps per stroke before the robot has failed.
    adaptive: Whether time steps are adapted to their error.
    error_rate: Largest error per time [m/s], one row.
    """

    tolerance: np.ndarray
    max_iterations: int
    most_iterations: int
    adaptive: bool
    error_rate: np.ndarray
