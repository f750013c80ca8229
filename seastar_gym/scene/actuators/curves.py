"""`SmaPulse`: the shape memory alloy actuator of Fig. 13.5b, with linear ramps while it is heated and cools.

`MeasuredCurve`: an actuator given by measured angles at times.

`Limited`: an actuator with a largest angle and a largest rate of rotation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.files import MOST_ROWS, UNITS, read_named_numbers, read_numbers, unit_of
from seastar_gym.scene.actuators.base import (
    WIRE_POWER,
    Actuator,
    ActuatorBase,
    Mirror,
    complete,
    is_actuator,
    share_of_pulse,
    stroke_at,
)
from seastar_gym.scene.checks import require_flag, require_number, require_numbers, shown
from seastar_gym.scene.number import MOST_ENTRIES, Numbers, batch_size, check_numbers, column, not_negative, positive
from seastar_gym.scene.serial import register_part

Floats = NDArray[np.float64]


def pulse(t: ArrayLike, heating_time: float, cooling_time: float) -> Floats:
    """Fraction of the peak angle at time t [s] of a stroke, in [0, 1]. t may have any shape.

    Zero at t = 0, one at t = heating_time, zero again at t = heating_time + cooling_time (Fig. 13.5b).
    """
    t = np.asarray(t, dtype=float)
    with np.errstate(over="ignore"):  # ramps that are steeper than any float are jumps
        rising = t / heating_time
        falling = (heating_time + cooling_time - t) / cooling_time
    return np.clip(np.minimum(rising, falling), 0.0, 1.0)


class HeatingAndCooling:
    """Stroke of two phases. heating_time: Delta t_1 [s]. cooling_time: Delta t_2 [s]."""

    heating_time: float
    cooling_time: float

    @property
    def period(self) -> float:
        """Length of a stroke, Delta t_0 [s]."""
        return self.heating_time + self.cooling_time

    @property
    def corners(self) -> tuple[float, float, float]:
        """Times within a stroke [s] that no time step may straddle."""
        return 0.0, self.heating_time, self.period


@register_part
@dataclass(frozen=True)
class SmaPulse(HeatingAndCooling, ActuatorBase):
    """Actuator of Fig. 13.5b: rotation rises linearly while the alloy is heated and falls linearly while it cools.

    peak_angle: Largest rotation [rad].
    heating_time: Delta t_1 [s].
    cooling_time: Delta t_2 [s].
    heating_power: Electric power of a heated wire [W], an assumption, see `base.WIRE_POWER`.
    """

    peak_angle: Annotated[Numbers, not_negative("rad")] = math.pi / 5
    heating_time: Annotated[float, positive("s")] = 0.1
    cooling_time: Annotated[float, positive("s")] = 0.9
    heating_power: Annotated[float, not_negative("W")] = WIRE_POWER

    def __post_init__(self) -> None:
        check_numbers(self)

    def delta_psi(self, t: ArrayLike) -> Floats:
        """Rotation by command 1 at time t [s] of a stroke [rad]. t may have any shape."""
        return np.multiply.outer(pulse(t, self.heating_time, self.cooling_time), self.peak_angle)

    def seconds_heated(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        """Time for which limbs are heated from t[0] to t[-1] [s], shape of `commands`; half a command counts half."""
        return share_of_pulse(t, commands, self.heating_time)


REST = 1e-3
"""Largest angle at the ends of a curve, over its largest one, that is taken for 0."""


@register_part
@dataclass(frozen=True)
class MeasuredCurve(ActuatorBase):
    """Actuator with a measured curve of rotation, linear between samples and equal in every stroke.

    times: Increasing times [s], from 0 to the period. No time step straddles a sample, so samples closer than the step
        shorten it: leave out samples on a straight line between others.
    angles: Rotation by command 1 at those times [rad]. It is 0 at both ends, to a thousandth of the largest, so that
        limbs do not jump when their command changes.
    scale: Factor of the angles [1].
    heating_power: Electric power of a heated wire [W], an assumption, see `base.WIRE_POWER`.
    """

    times: tuple[float, ...]
    angles: tuple[float, ...]
    scale: Annotated[Numbers, not_negative("1")] = 1.0
    heating_power: Annotated[float, not_negative("W")] = WIRE_POWER

    def __post_init__(self) -> None:
        check_numbers(self)
        require_numbers("times", self.times, "s")
        require_numbers("angles", self.angles, "rad")
        if len(self.times) != len(self.angles) or len(self.times) < 2:
            raise ValueError(
                f"A curve needs as many angles as times, two or more, not {len(self.angles)} and {len(self.times)}."
            )
        if self.times[0] != 0.0 or (np.diff(self.times) <= 0.0).any():
            raise ValueError(f"times must begin at 0 and increase [s], not {shown(self.times)}.")
        if max(abs(self.angles[0]), abs(self.angles[-1])) > REST * max(map(abs, self.angles)):
            raise ValueError(
                f"A measured curve must begin and end at 0 rad, not at {self.angles[0]} and {self.angles[-1]}: "
                "otherwise limbs would jump when their command changes. MeasuredCurve.from_csv has detrend."
            )
        object.__setattr__(self, "angles", (0.0, *self.angles[1:-1], 0.0))

    @classmethod
    def from_csv(cls, file: str | Path, detrend: bool = False, thin: float = 0.0) -> MeasuredCurve:
        """Curve from a CSV file with a time and an angle in every line.

        The first line may hold names with units, such as "time (ms),angle (deg)", else they are seconds and radians;
        names have no digits, so that a mistyped first line is an error. Times count from the first one.

        detrend: Take the straight line from the first angle to the last one away: an offset, or a drift.
        thin: Leave out samples that are within this angle of the curve without them [rad].
        """
        if not Path(file).is_file():
            raise FileNotFoundError(f"There is no measured curve at {file}: give the path of a CSV file.")
        require_flag("detrend", detrend)
        require_number("thin", thin, "rad", zero_allowed=True)
        most = MOST_ROWS if thin else MOST_ENTRIES
        names, lines = read_named_numbers(file, "a time [s] and an angle [rad]", 2, most)
        try:
            times, angles = _in_units(names, np.array(lines).T)
            times = times - times[0]
            if detrend:
                angles = angles - np.interp(times, times[[0, -1]], angles[[0, -1]])
            kept = _kept(times, angles, thin) if thin else slice(None)
            return cls(times=tuple(times[kept].tolist()), angles=tuple(angles[kept].tolist()))
        except ValueError as no_curve:
            raise ValueError(f"{file}: {no_curve}") from None

    @classmethod
    def from_curvatures(cls, file: str | Path, period: float, limb_length: float) -> MeasuredCurve:
        """Curve of limbs that are bent along their length, for `Seastar(along=AlongLimb())`.

        The limb bends by its change of curvature since phase 0 times its length. A line at phase 1, which is phase 0 of
        the next period, is left out.

        file: CSV file with a phase, from 0 to 1, and a mean curvature [1/m] in every line. The first line may hold
            names.
        period: Length of a stroke [s]. limb_length: Length of the limb [m].
        """
        require_number("period", period, "s")
        require_number("limb_length", limb_length, "m")
        lines = read_numbers(file, "a phase [1] and a curvature [1/m]", 2, MOST_ENTRIES)
        phases, curvatures = np.array([line for line in lines if line[0] != 1.0] or lines).T
        if phases[0] != 0.0 or phases[-1] >= 1.0 or (np.diff(phases) <= 0.0).any():
            raise ValueError(f"{file}: phases must begin at 0 and increase to 1 at most, not {shown(phases.tolist())}.")
        angles = limb_length * (curvatures - curvatures[0])
        return cls(times=(*(period * phases).tolist(), float(period)), angles=(*angles.tolist(), 0.0))

    @property
    def peak_angle(self) -> Numbers:
        """Largest rotation to either side [rad]."""
        return np.multiply(self.scale, max(map(abs, self.angles)))

    @property
    def period(self) -> float:
        """Length of a stroke [s]."""
        return self.times[-1]

    @property
    def corners(self) -> tuple[float, ...]:
        """Times of the samples [s], which no time step may straddle."""
        return self.times

    def delta_psi(self, t: ArrayLike) -> Floats:
        """Rotation by command 1 at time t [s] of a stroke [rad]. t may have any shape."""
        return np.multiply.outer(np.interp(np.asarray(t, float), self.times, self.angles), self.scale)

    @property
    def heating_time(self) -> float:
        """Time at which the curve is farthest from zero [s]. Until then the wire is taken to be heated."""
        return self.times[int(np.argmax(np.abs(self.angles)))]

    def seconds_heated(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        """Time for which limbs are heated from t[0] to t[-1] [s], shape of `commands`; half a command counts half."""
        return share_of_pulse(t, commands, self.heating_time)


def _in_units(names: tuple[str, ...], columns: Floats) -> Floats:
    """Times [s] and angles [rad], shape (2, n), of columns in any order whose names may end with a unit."""
    found: dict[str, Floats] = {}
    for default, name, numbers in zip(("time", "angle"), names or ("", ""), columns, strict=True):
        unit, known = unit_of(name), ("time", "angle")
        words = next((what for what in known if what in name.lower()), default)
        what = next((what for what in known if unit in UNITS[what]), words)
        if unit is not None and unit not in UNITS[what]:
            raise ValueError(f"{name} must be in {', '.join(UNITS['time'])} or {', '.join(UNITS['angle'])}.")
        found[what] = numbers * UNITS[what].get(unit or "", 1.0)
    if len(found) == 1:
        raise ValueError(f"one column must be a time and one an angle, not {' and '.join(names)}.")
    return np.array([found["time"], found["angle"]])


def _kept(times: Floats, angles: Floats, error: float) -> list[int]:
    """Samples whose broken line errs by no more than this angle at any other (Ramer, Douglas and Peucker)."""
    kept, pieces = {0, len(times) - 1}, [(0, len(times) - 1)]
    while pieces:
        begin, end = pieces.pop()
        straight = np.interp(times[begin : end + 1], times[[begin, end]], angles[[begin, end]])
        off = np.abs(angles[begin : end + 1] - straight)
        if off.max() > error:
            middle = begin + int(off.argmax())
            kept.add(middle)
            pieces += [(begin, middle), (middle, end)]
    return sorted(kept)


@register_part
@dataclass(frozen=True)
class Limited(ActuatorBase):
    """Actuator that follows another one's curve within a largest angle and a largest rate of rotation.

    actuator: Actuator to follow, one without memory.
    largest_angle: Largest rotation [rad]. None means no limit.
    largest_rate: Largest rate of rotation [rad/s]. None means no limit.

    A slow limb may still be rotated when the next stroke begins, and continues from there: the state is its rotation
    [rad]. Between time steps the rotation is linear.
    """

    actuator: Actuator
    largest_angle: Annotated[Numbers | None, positive("rad")] = None
    largest_rate: Annotated[Numbers | None, positive("rad/s")] = None

    def __post_init__(self) -> None:
        if not is_actuator(self.actuator) or complete(self.actuator).has_memory:
            raise ValueError(f"Limited follows an actuator without memory, not {shown(self.actuator)}.")
        check_numbers(self)
        batch_size(self)

    @property
    def peak_angle(self) -> Numbers:
        """Largest rotation [rad]."""
        peak = self.actuator.peak_angle
        return peak if self.largest_angle is None else np.minimum(peak, self.largest_angle)

    @property
    def period(self) -> float:
        """Length of a stroke [s]."""
        return self.actuator.period

    @property
    def corners(self) -> tuple[float, ...]:
        """Times within a stroke [s] that no time step may straddle."""
        return self.actuator.corners

    @property
    def rest(self) -> Floats:
        """State at rest: no rotation [rad], shape (1,)."""
        return np.zeros(1)

    @property
    def mirror(self) -> Mirror:
        """What a mirror does to the state: the rotation changes its sign."""
        return ((0, -1),)

    @property
    def heating_power(self) -> float:
        """Electric power of the followed actuator [W], NaN if it does not say it."""
        return complete(self.actuator).heating_power

    def delta_psi(self, t: ArrayLike) -> Floats:
        """Rotation by command 1 at time t [s] of a stroke that begins at rest [rad]. t may have any shape."""
        times, n_robots = np.union1d(self.corners, t), batch_size(self)
        if n_robots is None:
            return np.asarray(self.respond(times, np.ones(()), self.rest)[0][np.searchsorted(times, t)])
        turned, _ = self.respond(times, np.ones((n_robots, 1)), self.rest)
        return np.asarray(turned[np.searchsorted(times, t), :, 0])

    def respond(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """Rotations and state as in `ActuatorBase`, exact if the followed curve is linear between the times t."""
        curve, peak, rate = stroke_at(self.actuator, t), column(self.peak_angle), column(self.largest_rate)
        wanted = curve.reshape(*curve.shape, *(1,) * (1 + commands.ndim - curve.ndim)) * commands
        wanted = np.clip(wanted, -peak, peak)
        turned = wanted if rate is None else np.empty_like(wanted)
        if rate is not None:
            turned[0] = state[..., 0]
            for k, duration in enumerate(np.diff(t), start=1):
                most = rate * duration
                turned[k] = turned[k - 1] + np.clip(wanted[k] - turned[k - 1], -most, most)
        return turned, turned[-1][..., None].copy()

    def observe(self, state: Floats) -> Floats:
        """Rotation as a fraction of the largest one, shape of `state`."""
        peak = np.asarray(column(self.peak_angle, 2))
        return state / np.where(peak > 0.0, peak, 1.0)

    def recall(self, numbers: Floats) -> Floats:
        """Rotation of which this share of the largest one is observed, shape of `numbers`."""
        return numbers * np.asarray(column(self.peak_angle, 2))

    def seconds_heated(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        """Time for which limbs are heated from t[0] to t[-1] [s], shape of `commands`: as of the followed actuator."""
        return complete(self.actuator).seconds_heated(t, commands, state)
