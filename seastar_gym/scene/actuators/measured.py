"""`MeasuredCurve`: an actuator given by measured angles at times."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene.actuators.actuator import ActuatorBase
from seastar_gym.scene.actuators.heating import WIRE_POWER, share_of_pulse
from seastar_gym.scene.checks import require_number, require_numbers, shown
from seastar_gym.scene.number import Numbers, check_numbers, not_negative
from seastar_gym.scene.serial import MOST_ENTRIES, register_part

Floats = NDArray[np.float64]


@register_part
@dataclass(frozen=True)
class MeasuredCurve(ActuatorBase):
    """Actuator with a measured curve of rotation, linear between samples and equal in every stroke.

    times: Increasing times [s], from 0 to the period. No time step straddles a sample, so samples closer than the step
        shorten it: leave out samples on a straight line between others.
    angles: Rotation by command 1 at those times [rad]. It is 0 at both ends, so that limbs do not jump when their
        command changes.
    scale: Factor of the angles [1].
    heating_power: Electric power of a heated wire [W], an assumption, see `heating.WIRE_POWER`.
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
        if self.angles[0] != 0.0 or self.angles[-1] != 0.0:
            raise ValueError(
                f"A measured curve must begin and end at 0 rad, not at {self.angles[0]} and {self.angles[-1]}: "
                "otherwise limbs would jump when their command changes."
            )

    @classmethod
    def from_csv(cls, file: str | Path) -> MeasuredCurve:
        """Curve from a CSV file with a time [s] and an angle [rad] in every line. The first line may hold names.

        Names have no digits, so a mistyped first line is an error, see `seastar_gym.scene.csv_rows`.
        """
        if not Path(file).is_file():
            raise FileNotFoundError(f"There is no measured curve at {file}: give the path of a CSV file.")
        from seastar_gym.scene.csv_rows import read_numbers  # only files need it

        times, angles = zip(*read_numbers(file, "a time [s] and an angle [rad]", 2, MOST_ENTRIES), strict=True)
        try:
            return cls(times=times, angles=angles)
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
        from seastar_gym.scene.csv_rows import read_numbers  # only files need it

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
