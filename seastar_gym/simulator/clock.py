"""`Clock`: the simulated time of every robot."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

COUNTED = ("start", "lost", "intervals", "within")
"""Arrays of a clock. None is written into: `dict(vars(clock))` is what it shows, however long it is kept."""


class Clock:
    """Simulated time of every robot. Equal intervals are counted, so that rounding does not accumulate.

    duration: Length of the intervals that are counted now [s].
    start: Time at which that count began [s], shape (n_robots,).
    lost: What rounding has left out of `start` [s], shape (n_robots,).
    intervals: Intervals completed since `start`, shape (n_robots,).
    within: Time since the present interval began [s], shape (n_robots,); zero between intervals, except for robots that
        failed within one.
    """

    def __init__(self, n_robots: int):
        self.duration = 0.0
        self.start = np.zeros(n_robots)
        self.lost = np.zeros(n_robots)
        self.intervals = np.zeros(n_robots, dtype=np.int64)
        self.within = np.zeros(n_robots)

    @property
    def time(self) -> Floats:
        """Simulated time [s], shape (n_robots,)."""
        return np.asarray(self.start + self.intervals * self.duration + self.within + self.lost)

    def set(self, chosen: NDArray[np.bool_] | slice, time: Floats | float) -> None:
        """Set the time [s] of the chosen robots, between intervals."""
        for name, value in zip(COUNTED, (time, 0, 0, 0), strict=True):
            counted = getattr(self, name).copy()
            counted[chosen] = value
            setattr(self, name, counted)

    def begin(self, duration: float) -> None:
        """Begin an interval of this length [s] now, even where the last one was not completed."""
        if duration != self.duration:
            self._add(np.asarray(self.intervals * self.duration))
            self.intervals = np.zeros_like(self.intervals)
            self.duration = duration
        if np.count_nonzero(self.within):
            self._add(self.within)
            self.within = np.zeros_like(self.within)

    def _add(self, time: Floats) -> None:
        """Add to the start, and keep what rounding leaves out [s] (Knuth's two-sum), shape (n_robots,)."""
        total = self.start + time
        added = total - self.start
        self.lost = self.lost + ((self.start - (total - added)) + (time - added))
        self.start = total

    def advance_to(self, covered: Floats) -> None:
        """Advance to this time since the interval began [s], shape (n_robots,)."""
        self.within = covered

    def end(self, failed: NDArray[np.bool_], covered: Floats) -> None:
        """Count the interval, or add the time covered [s] for robots that failed; shapes (n_robots,)."""
        if np.count_nonzero(failed):
            self.intervals, self.within = self.intervals + ~failed, np.where(failed, covered, 0.0)
        else:
            self.intervals, self.within = self.intervals + 1, np.zeros(len(failed))
