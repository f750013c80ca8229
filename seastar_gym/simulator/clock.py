"""`Clock`: the simulated time of every robot."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Clock:
    """Simulated time of every robot. Strokes are counted, so that rounding does not accumulate.

    period: Length of a stroke [s].
    start: Time at which the count of strokes began [s], shape (n_robots,).
    strokes: Strokes completed since `start`, shape (n_robots,).
    within: Time since the present stroke began [s], shape (n_robots,); zero between strokes, except for robots that
        failed within one.
    """

    def __init__(self, n_robots: int, period: float):
        self.period = period
        self.start = np.zeros(n_robots)
        self.strokes = np.zeros(n_robots, dtype=np.int64)
        self.within = np.zeros(n_robots)

    @property
    def time(self) -> Floats:
        """Simulated time [s], shape (n_robots,)."""
        return np.asarray(self.start + self.strokes * self.period + self.within)

    def set(self, chosen: NDArray[np.bool_] | slice, time: Floats | float) -> None:
        """Set the time [s] of the chosen robots, between strokes."""
        self.start[chosen] = time
        self.strokes[chosen] = 0
        self.within[chosen] = 0.0

    def begin_stroke(self) -> None:
        """Begin a stroke now, even where the last one was not completed."""
        self.start += self.within
        self.within[:] = 0.0

    def show(self, covered: Floats) -> None:
        """Show the time covered since the stroke began [s], shape (n_robots,)."""
        self.within[:] = covered

    def end_stroke(self, failed: NDArray[np.bool_], covered: Floats) -> None:
        """Count the stroke, or add the time covered [s] for robots that failed; shapes (n_robots,)."""
        self.strokes += ~failed
        self.within = np.where(failed, covered, 0.0)

    def copy(self) -> "Clock":
        """A clock of its own that shows the same time."""
        clock = Clock(len(self.start), self.period)
        clock.put(self)
        return clock

    def put(self, other: "Clock") -> None:
        """Show the time of another clock."""
        self.start[:], self.strokes[:], self.within[:] = other.start, other.strokes, other.within
