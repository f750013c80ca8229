"""`SmaPulse`: the shape memory alloy actuator of Fig. 13.5b, with linear ramps while it is heated and cools."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene.actuators.actuator import ActuatorBase
from seastar_gym.scene.actuators.heating import WIRE_POWER, share_of_pulse
from seastar_gym.scene.number import Numbers, check_numbers, not_negative, positive
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
    heating_power: Electric power of a heated wire [W], an assumption, see `heating.WIRE_POWER`.
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
