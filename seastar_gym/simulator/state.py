"""State of all robots of a simulator: `State` as users get and set it, and the `Clock` that counts time.

With them are the heading of the body frame, by the rotation of the rest shape that fits the nodes best, and where limbs
begin.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Seastar
from seastar_gym.scene.checks import as_floats

Floats = NDArray[np.float64]


class Clock(NamedTuple):
    """Simulated time of every robot. Equal intervals are counted, so that rounding does not accumulate.

    start: Time at which that count began [s], shape (n_robots,).
    lost: What rounding has left out of `start` [s], shape (n_robots,).
    intervals: Intervals completed since `start`, shape (n_robots,).
    within: Time since the present interval began [s], shape (n_robots,); zero between intervals, except for robots that
        failed within one.
    duration: Length of the intervals that are counted now [s].
    """

    start: Floats
    lost: Floats
    intervals: NDArray[np.int64]
    within: Floats
    duration: float = 0.0

    @classmethod
    def at_zero(cls, n_robots: int) -> Clock:
        """Clock of robots that have not begun."""
        nothing = np.zeros(n_robots)
        return cls(nothing, nothing, np.zeros(n_robots, dtype=np.int64), nothing)

    @property
    def time(self) -> Floats:
        """Simulated time [s], shape (n_robots,)."""
        return np.asarray(self.start + self.intervals * self.duration + self.within + self.lost)

    def put(self, chosen: NDArray[np.bool_] | slice, time: Floats | float) -> Clock:
        """Clock on which the chosen robots have this time [s], between intervals."""
        start, lost = self.start.copy(), self.lost.copy()
        intervals, within = self.intervals.copy(), self.within.copy()
        start[chosen], lost[chosen], intervals[chosen], within[chosen] = time, 0.0, 0, 0.0
        return Clock(start, lost, intervals, within, self.duration)

    def begun(self, duration: float) -> Clock:
        """Clock of an interval of this length [s] that begins now, even where the last one was not completed."""
        clock = self
        if duration != clock.duration:
            counted = clock._added(np.asarray(clock.intervals * clock.duration))
            clock = counted._replace(intervals=np.zeros_like(clock.intervals), duration=duration)
        if any(clock.within.tolist()):
            clock = clock._added(clock.within)._replace(within=np.zeros_like(clock.within))
        return clock

    def _added(self, time: Floats) -> Clock:
        """Clock with a later start, which keeps what rounding leaves out [s] (Knuth's two-sum), shape (n_robots,)."""
        total = self.start + time
        added = total - self.start
        lost = self.lost + ((self.start - (total - added)) + (time - added))
        return self._replace(start=total, lost=lost)

    def ended(self, failed: NDArray[np.bool_], covered: Floats) -> Clock:
        """Clock after the interval, or after the time covered [s] for robots that failed; shapes (n_robots,)."""
        if any(failed.tolist()):
            return self._replace(intervals=self.intervals + ~failed, within=np.where(failed, covered, 0.0))
        return Clock(self.start, self.lost, self.intervals + 1, np.zeros(len(failed)), self.duration)


def best_fit_heading(positions: Floats, rest: Floats) -> Floats:
    """Rotation of the rest shape about the hub that fits the nodes best in least squares [rad], shape (n_robots,).

    positions: Node positions [m], shape (n_robots, n_nodes, 2).
    rest: Node positions at rest [m], shape (n_nodes, 2), or those of every robot, shape (n_robots, n_nodes, 2).
    """
    if rest.ndim > 2:
        each = zip(positions[:, None], rest, strict=True)
        return np.concatenate([best_fit_heading(one, own) for one, own in each])
    x, y = np.moveaxis(positions - positions[:, :1], -1, 0)
    return np.asarray(np.arctan2(y @ rest[:, 0] - x @ rest[:, 1], x @ rest[:, 0] + y @ rest[:, 1]))


def root_places(robot: Seastar, orientation: Floats) -> Floats:
    """Places where limbs begin, from the hub [m], shape (..., n_limbs, 2), at orientations [rad], shape (...)."""
    x, y = np.array([limb.root for limb in robot.limb_shapes()]).T
    c, s = np.cos(orientation)[..., None], np.sin(orientation)[..., None]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


class State(NamedTuple):
    """State of all robots of a simulator. Together with later commands it determines every later state.

    positions: Node positions [m], shape (n_robots, n_nodes, 2).
    velocities: Node velocities [m/s], shape (n_robots, n_nodes, 2).
    time: Simulated time [s], shape (n_robots,).
    actuators: State of every limb's actuator, shape (n_robots, n_limbs, n_state), where n_state is 0 for actuators
        without memory. `None` means at rest.
    commands: Commands under way, shape (n_robots, n_limbs). `None` means none.
    phase: Time since they were given [s], shape (n_robots,), 0 where none are under way. All robots that have commands
        under way share it. `None` means 0.
    orientation: Angle by which every robot's body has turned from rest [rad], shape (n_robots,). `None` means that of
        the rest shape that fits the nodes best; it is `None` without a body.
    spin: Its angular velocity [rad/s], shape (n_robots,). `None` means 0.
    """

    positions: Floats
    velocities: Floats
    time: Floats
    actuators: Floats | None = None
    commands: Floats | None = None
    phase: Floats | None = None
    orientation: Floats | None = None
    spin: Floats | None = None

    def of_robots(self, robots: NDArray[np.intp] | NDArray[np.bool_] | slice) -> State:
        """State of the chosen robots, in their order."""
        return State(*(None if part is None else part[robots] for part in self))  # type: ignore[arg-type]

    @classmethod
    def joined(cls, states: Sequence[State]) -> State:
        """States of the same kind of robots as one, in their order. A part that is `None` in one is `None` in all."""
        parts = zip(*states, strict=True)
        return cls(*(None if any(part is None for part in each) else np.concatenate(each) for each in parts))  # type: ignore[arg-type]


def checked_state(state: object, rest: Floats, actuators_at_rest: Floats, longest: float) -> list[Floats]:
    """Arrays of a state, at rest where it has None. ValueError if a shape or a number is wrong.

    rest: Node positions at rest [m], shape (n_nodes, 2), or those of every robot, shape (n_robots, n_nodes, 2).
    actuators_at_rest: Shape (n_robots, n_limbs, n_state). longest: Time for which commands may be under way [s].
    """
    if not isinstance(state, tuple | list) or not 3 <= len(state) <= len(State._fields):
        raise ValueError(f"A State of {', '.join(State._fields)} is needed, not {type(state).__name__}.")
    n_robots, n_limbs, _ = actuators_at_rest.shape
    nodes, each = (n_robots, *rest.shape[-2:]), np.zeros(n_robots)
    positions, velocities, time, actuators, commands, phase, orientation, spin = State(*state)
    arrays = [
        _checked_array("State.positions", positions, nodes),
        _checked_array("State.velocities", velocities, nodes),
        _checked_array("State.time", time, each.shape),
        _checked_array("State.actuators", actuators, actuators_at_rest.shape, actuators_at_rest),
        _checked_array("State.commands", commands, (n_robots, n_limbs), np.zeros((n_robots, n_limbs))),
        _checked_array("State.phase", phase, each.shape, each),
    ]
    _check_phase(arrays[-1], longest)
    fitting = best_fit_heading(arrays[0], rest)
    return [
        *arrays,
        _checked_array("State.orientation", orientation, each.shape, fitting),
        _checked_array("State.spin", spin, each.shape, each),
    ]


def _checked_array(name: str, value: object, wanted: tuple[int, ...], at_rest: Floats | None = None) -> Floats:
    array = as_floats(name, at_rest if value is None and at_rest is not None else value)
    if array.shape != wanted:
        raise ValueError(f"{name} must have shape {wanted}, not {array.shape}.")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite.")
    return array


def _check_phase(phase: Floats, longest: float) -> None:
    wrong = phase[(phase < 0.0) | (phase >= longest)]
    if len(wrong):
        raise ValueError(f"State.phase must be at least 0 and less than {longest:.4g} s, not {wrong[0]:.4g} s.")
    different = np.unique(phase[phase > 0.0])
    if len(different) > 1:
        raise ValueError(
            "State.phase must be one time for all robots that have commands under way, since they share time steps, "
            f"not {different[0]:.4g} s and {different[1]:.4g} s."
        )
