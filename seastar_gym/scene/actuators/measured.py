"""An actuator that was measured: angles at times, for instance filmed on the bench."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene.checks import require_number, require_numbers
from seastar_gym.scene.csv_rows import read_numbers
from seastar_gym.scene.per_robot import Numbers, require_each
from seastar_gym.scene.serial import register_part


@register_part
@dataclass(frozen=True)
class MeasuredCurve:
    """Rotation of a limb with command 1 over one stroke, linear between samples, the same in every stroke.

    times: Increasing, the first one 0, the last one the period [s]. No time step straddles a sample, so samples closer
        than the step shorten it: leave out those that a straight line says as well.
    angles: Rotation at those times [rad], 0 at both ends, so that limbs do not jump when their command changes.
    scale: What a robot's limbs make of these angles.
    """

    PER_ROBOT: ClassVar = ("scale",)
    times: tuple[float, ...]
    angles: tuple[float, ...]
    scale: Numbers = 1.0

    def __post_init__(self) -> None:
        require_each(self, "scale", partial(require_number, unit="1", zero_allowed=True))
        require_numbers("times", self.times, "s")
        require_numbers("angles", self.angles, "rad")
        if len(self.times) != len(self.angles) or len(self.times) < 2:
            raise ValueError(
                f"A curve needs as many angles as times, two or more, not {len(self.angles)} and {len(self.times)}."
            )
        if self.times[0] != 0.0 or (np.diff(self.times) <= 0.0).any():
            raise ValueError(f"times must begin at 0 and increase [s], not {self.times!r}.")
        if self.angles[0] != 0.0 or self.angles[-1] != 0.0:
            raise ValueError(
                f"A measured curve must begin and end at 0 rad, not at {self.angles[0]!r} and {self.angles[-1]!r}: "
                "otherwise limbs would jump when their command changes."
            )

    @classmethod
    def from_csv(cls, file: str | Path) -> "MeasuredCurve":
        """From a file with a time [s] and an angle [rad] in every line, below one line of names if it has any.

        Names have no digits: a mistyped first line is an error, see `seastar_gym.scene.csv_rows`.
        """
        if not Path(file).is_file():
            raise FileNotFoundError(f"There is no measured curve at {file}: give the path of a CSV file.")
        times, angles = zip(*read_numbers(file, "a time [s] and an angle [rad]", 2), strict=True)
        try:
            return cls(times=times, angles=angles)
        except ValueError as no_curve:
            raise ValueError(f"{file}: {no_curve}") from None

    @property
    def peak_angle(self) -> Numbers:
        """Largest rotation [rad], to either side."""
        return np.multiply(self.scale, max(map(abs, self.angles)))

    @property
    def period(self) -> float:
        """Length of a stroke [s]."""
        return self.times[-1]

    @property
    def corners(self) -> tuple[float, ...]:
        """The sample times [s]."""
        return self.times

    def delta_psi(self, t: ArrayLike) -> NDArray[np.float64]:
        """Rotation of a limb with command 1 at time t [s] of a stroke [rad]; t of any shape."""
        return np.multiply.outer(np.interp(np.asarray(t, float), self.times, self.angles), self.scale)
