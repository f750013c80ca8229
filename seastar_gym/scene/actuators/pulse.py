"""`SmaPulse`: the shape memory alloy actuator of Fig. 13.5b, with linear ramps while it is heated and cools."""

import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene.checks import require_number
from seastar_gym.scene.per_robot import Numbers, require_each
from seastar_gym.scene.serial import register_part


def pulse(t: ArrayLike, heating_time: float, cooling_time: float) -> NDArray[np.float64]:
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
class SmaPulse(HeatingAndCooling):
    """Actuator of Fig. 13.5b: rotation rises linearly while the alloy is heated and falls linearly while it cools.

    peak_angle: Largest rotation [rad].
    heating_time: Delta t_1 [s].
    cooling_time: Delta t_2 [s].
    """

    PER_ROBOT: ClassVar = ("peak_angle",)
    peak_angle: Numbers = math.pi / 5
    heating_time: float = 0.1
    cooling_time: float = 0.9

    def __post_init__(self) -> None:
        require_each(self, "peak_angle", partial(require_number, unit="rad", zero_allowed=True))
        require_number("heating_time", self.heating_time, "s")
        require_number("cooling_time", self.cooling_time, "s")

    def delta_psi(self, t: ArrayLike) -> NDArray[np.float64]:
        """Rotation by command 1 at time t [s] of a stroke [rad]. t may have any shape."""
        return np.multiply.outer(pulse(t, self.heating_time, self.cooling_time), self.peak_angle)
