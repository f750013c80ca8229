"""`Drive`: the actuators of a batch of robots, from commands, which are checked here, to rotations of limbs.

Time steps of a stroke, and of any other interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import JUMP, Actuator, complete, stroke_at
from seastar_gym.scene.actuators.wires import SmaWires
from seastar_gym.scene.checks import as_floats
from seastar_gym.scene.number import column
from seastar_gym.simulator.wires import contracted

SAME_TIME = 1e-9
"""Fraction of a step. A shorter remainder before a corner is rounding of the division, not a step."""

ROUNDING = 1e-12
"""Fraction of a time. An end of a step that is no nearer to it is the next one."""


def step_times(corners: Sequence[float], step: float) -> np.ndarray:
    """Ends of the time steps [s] from the first corner to the last, shape (n_steps + 1,).

    All steps have the length `step` [s], except that the last one before a corner is shortened, since no step may
    straddle a corner. The ramp of Fig. 13.5b has its corners at 0, 0.1 and 1.0 s.
    """
    times = [np.array([corners[0]])]
    for begin, end in pairwise(corners):
        n_whole = int(np.floor((end - begin) / step + SAME_TIME))
        whole = begin + step * np.arange(1, n_whole + 1)
        if n_whole and end - whole[-1] <= SAME_TIME * step:
            whole = whole[:-1]
        times += [whole, np.array([end])]
    return np.concatenate(times)


def interval_times(corners: Sequence[float], step: float, begin: float, duration: float) -> np.ndarray:
    """Ends of the time steps [s] of an interval, from `begin` to begin + duration, shape (n_steps + 1,).

    They are those of `step_times` since the first corner, so that an interval in pieces has the steps of the whole,
    save that a step in which a piece ends is cut in two. What differs by rounding is one time.

    corners: Increasing times [s]; the first is not later than `begin`.
    """
    end, same = begin + duration, SAME_TIME * step
    end = max((corner for corner in corners if abs(corner - end) <= same), default=end)
    times = step_times([*(corner for corner in corners if corner < end), end], step)
    first = int(np.searchsorted(times, begin + same, side="right"))
    on_grid = begin - times[first - 1] <= same
    return times[first - 1 :] if on_grid else np.append(begin, times[first:])


def ends_of_parts(times: np.ndarray, parts: int) -> np.ndarray:
    """Steps with which about equal parts of an interval end, whose steps end at these times [s] since it began."""
    return ends_at(times, times[-1] * np.arange(1, parts + 1) / parts)


def ends_at(times: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Steps at whose ends these times [s] are first reached; other arguments as of `ends_of_parts`."""
    return np.unique(np.clip(np.searchsorted(times, wanted * (1.0 - ROUNDING)), 1, len(times) - 1))


Floats = NDArray[np.float64]

KNOWN_INTERVALS = 64
"""Largest number of intervals whose time steps are kept."""


class Steps(NamedTuple):
    """Time steps of an interval.

    times: Their ends since the commands were given [s]. phases: Phase of the drive then [s], 0 where commands are over.
    curve: Rotations by command 1 at these times [rad], empty for an actuator with memory.
    """

    times: Floats
    phases: list[float]
    curve: Floats


class Drive:
    """Actuators of a batch of robots, one for each limb.

    step: Length of a time step [s].
    strengths: Factor by which every limb's rotation is reduced, shape (n_robots, n_limbs).
    at_rest: State of the actuators at rest, of the shape of `state`.
    commands: Commands under way, shape (n_robots, n_limbs); 0 where none are.
    phase: Time since they were given [s], 0 if none are under way.
    steps: Time steps of the present interval.
    heating_time: Time for which each robot's wires are heated in the present interval [s], shape (n_robots,).
    """

    def __init__(self, actuator: Actuator, n_robots: int, n_limbs: int, step: float):
        self._step = step
        self.strengths = np.ones((n_robots, n_limbs))
        self.commands = self._given = np.zeros((n_robots, n_limbs))
        self.phase = 0.0
        self.steps, self.heating_time = Steps(np.zeros(1), [0.0], np.zeros(0)), np.zeros(n_robots)
        self._none = np.zeros((n_robots, n_limbs))  # commands where none are under way
        self.set_actuator(actuator)
        self.state = self.at_rest.copy()
        self._before = self._after = self.state  # at the beginning and the end of the present interval

    @property
    def state(self) -> Floats:
        """Present state of the actuators, shape (n_robots, n_limbs, n_state); n_state is 0 without memory.

        Within an interval the actuators are asked for it when somebody looks.
        """
        if self._until is not None:
            self.state = self._actuator.respond(self._until, self._given, self._before)[1]
        return self._state

    @state.setter
    def state(self, state: Floats) -> None:
        self._state = state
        self._until: Floats | None = None  # times of the present interval until now [s], if nobody has looked yet

    def set_actuator(self, actuator: Actuator) -> None:
        """Continue with an actuator that differs only in numbers that may differ from robot to robot."""
        self._actuator = complete(actuator)
        self._has_memory = self._actuator.has_memory
        # With memory: state at the end of the last interval, and rotations then of limbs of full strength.
        self._turned: tuple[Floats | None, Floats] = None, self.strengths
        self._intervals: dict[tuple[float, float, bool], Steps] = {}
        rest = self._actuator.rest
        self.at_rest = np.broadcast_to(rest, (*self.strengths.shape, rest.shape[-1]))

    def __copy__(self) -> Drive:
        """Drive of the same arrays, in a tenth of the time that `copy` would take otherwise."""
        twin = object.__new__(type(self))
        vars(twin).update(vars(self))
        return twin

    @property
    def longest(self) -> float:
        """Time for which commands are under way [s]."""
        return self._actuator.corners[-1]

    @property
    def heating_power(self) -> float:
        """Electric power of a heated wire [W], NaN if the actuator does not say it."""
        return self._actuator.heating_power

    def begin(self, duration: float, commands: Floats | None) -> tuple[Floats, Floats, Floats]:
        """Begin an interval [s] with these commands, or with those under way if they are None.

        Returns `times`, and the peaks, shape (n_robots, n_limbs), and the shape [rad] by whose product limbs rotate: at
        these times, shape (n_times,), (n_times, n_robots, 1) where a curve differs from robot to robot, or with memory
        (n_times, n_robots, n_limbs).
        """
        given, phase = (self.commands, self.phase) if commands is None else (commands, 0.0)
        steps, before = self._interval(phase, duration, commands is not None), self.state
        turned, after, heated = self._respond(steps, given, before)
        if commands is not None and self.phase > 0.0:
            self._refuse_jump(turned[0] if self._has_memory else self._none)
        if self._has_memory:
            self._turned = after, turned[-1]
        self.steps, self.commands, self.phase = steps, given, phase
        self._given, self._before, self._after = given, before, after
        self.heating_time = np.add.reduce(heated, axis=1)
        return steps.times, self.strengths if self._has_memory else given * self.strengths, turned

    def _respond(self, steps: Steps, given: Floats, before: Floats) -> tuple[Floats, Floats, Floats]:
        """Rotations of limbs of full strength or the curve, the state in the end, and times of heating of limbs [s]."""
        actuator, times = self._actuator, steps.times
        if type(actuator) is SmaWires:
            return contracted(actuator, times, given, before)
        turned, after = actuator.respond(times, given, before) if self._has_memory else (steps.curve, before)
        return turned, after, actuator.seconds_heated(times, given, before)

    def _refuse_jump(self, turned: Floats) -> None:
        """ValueError if limbs cannot begin anew from where they are.

        turned: Rotations of limbs of full strength that they would begin with [rad].
        """
        state, last = self._turned
        if self.state is state and turned.tobytes() == last.tobytes():
            return
        then, now = self.strengths * turned, self.strengths * last if self.state is state else self.rotations()
        jumps = np.abs(then - now) > JUMP * column(self._actuator.peak_angle)
        if np.count_nonzero(jumps):
            robot, limb = np.argwhere(jumps)[0]
            raise ValueError(
                f"With these commands limbs would jump, such as limb {limb + 1} of robot {robot} by "
                f"{abs(then[robot, limb] - now[robot, limb]):.4g} rad: advance without commands until the stroke under "
                f"way ends, in {self.longest - self.phase:.4g} s, or use an actuator with memory such as SmaWires."
            )

    def _interval(self, phase: float, duration: float, is_new: bool) -> Steps:
        """Time steps of an interval [s] that begins at a phase [s]. is_new: Whether commands are given with it."""
        key = phase, duration, is_new
        if key not in self._intervals:
            if len(self._intervals) >= KNOWN_INTERVALS:
                self._intervals.clear()
            corners = self._actuator.corners if is_new or phase > 0.0 else (0.0,)
            times = interval_times(corners, self._step, phase, duration)
            over = times >= self.longest - SAME_TIME * self._step
            curve = np.zeros(0) if self._has_memory else np.array(stroke_at(self._actuator, times), np.float64)
            curve = curve[:, :, None] if curve.ndim > 1 else curve
            self._intervals[key] = Steps(times, np.where(over, 0.0, times).tolist(), curve)
        return self._intervals[key]

    def advance(self, end: int) -> None:
        """Bring the actuators to the time step `end` of the present interval."""
        times = self.steps.times
        if end == len(times) - 1:
            self.state = self._after
        elif self._has_memory:
            self._until = times[: end + 1]
        self.phase = self.steps.phases[end]
        self.commands = self._given if self.phase > 0.0 else self._none

    def observe(self) -> Floats:
        """State as numbers of order one, shape (n_robots, k), limb after limb; k = 0 without memory."""
        seen = self._actuator.observe(self.state)
        return seen.reshape(len(seen), -1)

    def refractory_wires(self) -> NDArray[np.bool_]:
        """Wires that cannot be heated now, shape (n_robots, n_limbs, 2)."""
        known = self._actuator.refractory_wires(self.state)
        if known is not None:
            return known
        must_wait = not self._has_memory and bool(self.rotations().any())
        return np.full((*self.strengths.shape, 2), must_wait)

    def checked_strengths(self, strengths: ArrayLike) -> Floats:
        """A copy of the shape of `strengths`; ValueError for what are no shares from 0 to 1 of robots and limbs."""
        array, wanted = as_floats("limb_strengths", strengths), self.strengths.shape
        if array.shape not in ((), wanted[1:], wanted) or not ((array >= 0.0) & (array <= 1.0)).all():
            raise ValueError(f"limb_strengths must be numbers from 0 to 1 of shape {wanted[1:]} or {wanted}.")
        return np.broadcast_to(array, wanted).copy()

    def rotations(self) -> Floats:
        """Rotations of limbs between two intervals [rad], shape (n_robots, n_limbs)."""
        now = np.full(1, self.phase)
        if self._has_memory:
            return self.strengths * self._actuator.respond(now, self.commands, self.state)[0][0]
        if self.phase == 0.0:
            return np.zeros_like(self.strengths)
        return self.commands * self.strengths * column(stroke_at(self._actuator, now)[0])

    def put_at_rest(self, chosen: NDArray[np.bool_]) -> None:
        """Put the actuators of the chosen robots at rest. The others go on with what is under way."""
        self.state, self.commands = np.array(self.state), np.array(self.commands)
        self.state[chosen], self.commands[chosen] = self.at_rest[chosen], 0.0
        if chosen.all():
            self.phase = 0.0

    def put(self, state: Floats, commands: Floats, phase: Floats) -> None:
        """Put all actuators into a state, see `State`: shapes of `state` and `commands`, and (n_robots,)."""
        self.state, self.phase = state.copy(), float(phase.max())
        self.commands = np.where(phase[:, None] > 0.0, commands, 0.0)


def checked_commands(commands: ArrayLike, scene: Scene, strengths: Floats, name: str = "commands") -> Floats:
    """Commands as an array of the shape of `strengths`, (n_robots, n_limbs). ValueError if one cannot be followed."""
    array = as_floats(name, commands)
    if array.shape != strengths.shape:
        raise ValueError(f"{name} must have shape (n_robots, n_limbs) = {strengths.shape}, not {array.shape}.")
    shares = np.abs(array)
    if not np.maximum.reduce(shares, axis=None) <= 1.0:
        robot, limb = np.argwhere(~(shares <= 1.0))[0]
        raise ValueError(
            f"{name} must be numbers in [-1, 1]; robot {robot} has {array[robot, limb]:g} for limb {limb + 1}."
        )
    if scene.robot.hub_hinge == "turning":
        _check_turning_hub(strengths * array, scene)
    return array


def _check_turning_hub(shares: Floats, scene: Scene) -> None:
    """ValueError if limbs turned by these shares of the peak angle, shape (n_robots, n_limbs), close a hub hinge."""
    turn = column(scene.actuator.peak_angle) * (np.roll(shares, -1, axis=1) - shares)
    angle = np.array([limb.gap for limb in scene.robot.limb_shapes()]) + turn
    closed = np.minimum(angle, 2.0 * np.pi - angle) < 1e-9
    if closed.any():
        robot, limb = np.argwhere(closed)[0]
        raise ValueError(
            f'With hub_hinge="turning" the command of robot {robot} closes the hub hinge between limbs {limb + 1} '
            f'and {(limb + 1) % shares.shape[1] + 1}, where its curvature is infinite: use hub_hinge="opening".'
        )
