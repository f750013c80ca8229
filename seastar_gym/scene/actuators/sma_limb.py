"""`SmaLimb`: a shape memory alloy actuator with the curves of measured limbs.

Every limb has two wires, one for each direction of rotation. A command heats the wire of its sign for a fraction of the
heating time (pulse width), after a delay. A wire has one temperature theta, above the water and in widths of the
transformation, and cools as Newton says:

    d theta/dt = (theta_inf - theta)/tau,    theta_inf = rise/(1 - exp(-heating_time/tau)) while heated, otherwise 0,

so that a full pulse lifts a cold wire by rise. The share of its shape that a wire has recovered is
logistic in temperature, less that in cold water, and 1 at most:

    share = (s(theta - middle) - s(-middle))/(1 - s(-middle)),    s(x) = 1/(1 + exp(-x)).

The limb rotates by the peak angle times share_+ - share_-. A measured limb is bent at rest, and its wire straightens it
from the rest curvature by curvature_change * share.

`python -m studies.fit` fits the numbers to 48 measured curves of limbs in water and says how far each
curve is from its fit. The repeated pulse of any period follows from them, warm wires included. The curves are of the
repository `softmachineslab/frog`, which states no licence; the package has the fitted numbers alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.actuators.base import SPENT, WIRE_POWER, WirePair
from seastar_gym.scene.checks import as_floats, is_whole_number, shown
from seastar_gym.scene.number import Numbers, batch_size, check_numbers, column, not_negative, positive
from seastar_gym.scene.serial import register_part

Floats = NDArray[np.float64]


class Measured(NamedTuple):
    """Numbers of a measured limb, as `SmaLimb` names them."""

    rest_curvature: float
    curvature_change: float
    rise: float
    middle: float
    time_constant: float
    heating_time: float
    delay: float


FREQUENCIES = {0: (0.4, 1.1), 10: (0.4, 1.2), 20: (0.4, 1.4), 30: (0.7, 1.4), 40: (1.5, 1.9), 50: (1.7, 2.3)}
"""Lowest and highest measured frequency of each material [Hz]."""
MEASURED: dict[int, Measured] = {
    0: Measured(124.8, 90.6, 10.73, 7.21, 0.700, 0.0500, 0.0240),
    10: Measured(130.5, 94.0, 9.76, 7.55, 0.782, 0.0300, 0.0258),
    20: Measured(126.9, 93.5, 8.64, 7.68, 0.746, 0.0341, 0.0207),
    30: Measured(127.0, 96.9, 7.09, 6.27, 0.616, 0.0313, 0.0163),
    40: Measured(121.2, 81.0, 11.55, 18.05, 0.839, 0.0139, 0.0177),
    50: Measured(118.2, 77.9, 10.37, 13.41, 0.628, 0.0158, 0.0151),
}
"""Fits of `python -m studies.fit`, by volume fraction of liquid metal in the limb's elastomer [%].

Root mean square error over the peak of the curve: 0.026, 0.027, 0.033 and 0.030 up to 30 %, 0.050 at 40 % and 0.065 at
50 %. Limbs of 40 and 50 % were measured at high frequencies only, that is warm: by these fits the first pulses hardly
move them.
"""


Widths: TypeAlias = Annotated[Numbers, positive("widths of the transformation")]
Curvature: TypeAlias = Annotated[Numbers, not_negative("1/m")]


@register_part
@dataclass(frozen=True)
class SmaLimb(WirePair):
    """Actuator of two wires per limb that heat, cool and recover their shape as measured. Defaults: `preset(0)`.

    The state of a limb is (theta_+, theta_-, w_+, w_-, r_+, r_-): temperatures above the water [widths of the
    transformation], the time until heat arrives and the time for which either wire is heated then [s]. Temperatures are
    observed, over the middle of the transformation. The rest is zero at ends of intervals that are not shorter than
    delay + heating_time. A command to a wire whose pulse is under way makes it as long as the new one from now on.

    Wires recover their shape within 5 to 20 ms, faster than the ramp of `SmaPulse`, so swims need finer time steps.

    peak_angle: Rotation if one wire has recovered its shape and the other not at all [rad].
    rise: What a full pulse adds to the temperature of a cold wire [widths].
    middle: Temperature at which half the material has transformed [widths].
    time_constant: tau of cooling [s].
    heating_time: Pulse width of a full command [s]. Pulses of partial commands may end within a time step.
    delay: Time from a command until heat arrives [s].
    period: Length of a stroke [s].
    rest_curvature: Curvature of the measured limb at rest [1/m]. It does not act on the robot: a limb with it is a
        `Limb(natural_curvature=...)`.
    curvature_change: By how much a wire that has recovered its shape straightens the measured limb [1/m].
    heating_power: Electric power of a heated wire [W], an assumption, see `base.WIRE_POWER`.
    """

    peak_angle: Annotated[Numbers, not_negative("rad")] = math.pi / 5
    rise: Widths = MEASURED[0].rise
    middle: Widths = MEASURED[0].middle
    time_constant: Annotated[Numbers, positive("s")] = MEASURED[0].time_constant
    heating_time: Annotated[float, positive("s")] = MEASURED[0].heating_time
    delay: Annotated[float, not_negative("s")] = MEASURED[0].delay
    period: Annotated[float, positive("s")] = 1.0
    rest_curvature: Curvature = MEASURED[0].rest_curvature
    curvature_change: Curvature = MEASURED[0].curvature_change
    heating_power: Annotated[float, not_negative("W")] = WIRE_POWER

    def __post_init__(self) -> None:
        check_numbers(self)
        batch_size(self)
        slowest, fastest = np.max(self.time_constant), np.min(self.time_constant)
        if not 1e-9 * slowest <= self.heating_time <= 100.0 * fastest:
            raise ValueError(
                f"heating_time must be between 1e-9 and 100 time constants, of {shown(self.time_constant)} s, not "
                f"{shown(self.heating_time)} s."
            )

    @classmethod
    def preset(
        cls,
        liquid_metal: int,
        *,
        period: float | None = None,
        peak_angle: Numbers = math.pi / 5,
        limb_length: Numbers | None = None,
    ) -> SmaLimb:
        """Measured limb.

        liquid_metal: Volume fraction of liquid metal in its elastomer [%], one of MEASURED.
        period: Length of a stroke [s]. None means 1 s, or the longest measured period if that is shorter. Periods
            outside the measured FREQUENCIES are extrapolated, with two to three times the error.
        limb_length: Length [m] of limbs that their wires bend all along by the measured change of curvature: the peak
            angle is then that change times the length, for `Seastar(along=AlongLimb())`. None means `peak_angle`.
        """
        if not is_whole_number(liquid_metal) or liquid_metal not in MEASURED:
            raise ValueError(
                f"Limbs were measured with {', '.join(map(str, MEASURED))} % of liquid metal, not "
                f"{shown(liquid_metal)}."
            )
        period = min(1.0, 1.0 / FREQUENCIES[liquid_metal][0]) if period is None else period
        if limb_length is not None:
            change = MEASURED[liquid_metal].curvature_change
            peak_angle = np.multiply(change, as_floats("limb_length", limb_length))
        return replace(cls(peak_angle, period=period), **MEASURED[liquid_metal]._asdict())

    @property
    def corners(self) -> tuple[float, ...]:
        """Times since a full command from rest [s] that no time step may straddle."""
        end = self.delay + self.heating_time
        end = self.period if math.isclose(end, self.period, rel_tol=1e-12) else end
        return tuple(sorted({0.0, self.delay, end, self.period}))

    @property
    def rest(self) -> Floats:
        """State at rest, shape (6,)."""
        return np.zeros(6)

    def share(self, temperature: Floats, n_axes: int = 2) -> Floats:
        """Share of their shape that wires of a temperature [widths] have recovered.

        n_axes: Number of axes after that of the robots, where robots have numbers of their own.
        """
        middle = column(self.middle, n_axes)
        cold = _logistic(-middle)
        return np.asarray((_logistic(temperature - middle) - cold) / (1.0 - cold))

    def curvature(self, temperature: Floats, n_axes: int = 2) -> Floats:
        """Curvature of the measured limb [1/m] whose wire has a temperature [widths]. n_axes: As in `share`."""
        change = column(self.curvature_change, n_axes) * self.share(temperature, n_axes)
        return np.asarray(column(self.rest_curvature, n_axes) - change)

    def temperatures(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        """Temperatures of the wires [widths], shape (len(t), *S, 2). Arguments as in `respond`."""
        waiting, left = self._pulse(t, commands, state)
        since, tau = (t - t[0]).reshape(-1, *(1,) * left.ndim), column(self.time_constant, 2)
        heated = np.clip(since - waiting, 0.0, left)
        cooled = np.maximum(since - waiting - heated, 0.0)
        lifted = column(self.rise, 2) * (np.expm1(-heated / tau) / np.expm1(-self.heating_time / tau))
        return np.asarray(state[..., :2] * np.exp(-since / tau) + lifted * np.exp(-cooled / tau))

    def respond(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """Rotations and state as in `ActuatorBase`, exact at all times t."""
        temperature, duration = self.temperatures(t, commands, state), t[-1] - t[0]
        share = self.share(temperature)
        waiting, left = self._pulse(t, commands, state)
        left = self._left_after(np.maximum(duration - waiting, 0.0), left)
        waiting = np.where(waiting - duration > SPENT * self.delay, waiting - duration, 0.0)
        turned = column(self.peak_angle) * (share[..., 0] - share[..., 1])
        return turned, np.concatenate([temperature[-1], waiting, left], axis=-1)

    def _pulse(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """Time from t[0] until every wire is heated, and time for which it is heated then [s], shape (*S, 2) each."""
        left = self._seconds_to_heat(t, commands, state)
        return np.where((left > 0.0) & (state[..., 4:] == 0.0), self.delay, state[..., 2:4]), left

    def observe(self, state: Floats) -> Floats:
        """Temperatures over the middle of the transformation, shape (..., 2)."""
        return np.asarray(state[..., :2] / column(self.middle, 2))

    def seconds_heated(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        """Time for which the wires of each limb are heated from t[0] to t[-1] [s], shape of `commands`."""
        waiting, left = self._pulse(t, commands, state)
        return np.asarray(np.clip(t[-1] - t[0] - waiting, 0.0, left).sum(axis=-1))


def _logistic(x: Numbers) -> Floats:
    """1/(1 + exp(-x))."""
    return np.asarray(0.5 + 0.5 * np.tanh(0.5 * np.asarray(x)))
