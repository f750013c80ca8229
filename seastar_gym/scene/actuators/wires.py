"""Wires of shape memory alloy, two for every limb: `SmaWires` with the linear heating and cooling of Fig. 13.5b, and
`ThermalSma` with temperatures, by Joule heating, cooling in water and hysteresis. The default of strokes, `SmaPulse`,
has no wires to remember, see curves.py.

`ThermalSma`: every limb has two wires, one for each direction of rotation. A command heats the wire of its sign for a
fraction of the heating time (pulse width), from now on, however warm it is; the other wire goes on with what is left of
its pulse. A wire is thin and has one temperature T. With its heat capacity C, the electric power P and the heat
transfer to the water h A per kelvin,

    C dT/dt = P - h A (T - T_water)    =>    T = T_inf + (T_0 - T_inf) exp(-t/tau),    tau = C/(h A),

where T_inf = T_water + P/(h A) while it is heated and T_water while it cools. Its austenite fraction xi lies between

    up(T), from 0 at A_s to 1 at A_f,    and    down(T), from 0 at M_f to 1 at M_s.

Heating raises it along the first line, cooling lowers it along the second, and between them it is constant. Within a
phase the temperature is monotone, so xi = clip(xi_0, up(T), down(T)) at any time. The limb rotates by the peak angle
times xi_+ - xi_-. Latent heat and the heat of the limb are neglected.

The defaults make a full command come closest to the pulse of Fig. 13.5b, from rest and in later strokes, rounded;
`python -m studies.scenes.thermal` at commit 055100c4 fitted them. The deviation is 6 to 7 % of the peak angle in the
root mean square and 16 % at most, at the end of a stroke, where an exponential has a tail and the pulse has none.
Latent heat, gradual transformation, natural convection or a shorter pulse reduce it to 5.3 % at best, and are not
modelled. The defaults are effective numbers, not those of one alloy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.actuators.base import WIRE_POWER, WirePair
from seastar_gym.scene.actuators.curves import HeatingAndCooling
from seastar_gym.scene.checks import require_flag, shown
from seastar_gym.scene.number import Numbers, batch_size, check_numbers, column, finite, not_negative, positive
from seastar_gym.scene.serial import register_part

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

COLD = 1e-9
"""Contraction below which a wire is cold: what rounding may leave of zero."""


@register_part
@dataclass(frozen=True)
class SmaWires(WirePair):
    """Actuator of two wires per limb, + and -, that contract linearly while they are heated and relax while they cool.

    A wire's contraction x rises by 1/heating_time while it is heated, up to 1, and falls by 1/cooling_time otherwise,
    down to 0. A limb rotates by the peak angle times x_+ - x_-. A command c heats the wire of its sign for
    |c| * heating_time from now on, however warm it is; the other wire, and both if c = 0, go on with what is under way.
    From rest and with commands 0 or +-1, strokes of heating_time + cooling_time are those of `SmaPulse`.

    The state of a limb is (x_+, x_-, r_+, r_-): contractions [1], and the time for which either wire is still heated
    [s]. The first two are observed. The rest is zero at ends of intervals that are not shorter than heating_time.

    No time step straddles the end of a full pulse of the last commands, nor the end of its cooling from rest. Corners
    that differ from limb to limb (partial or earlier commands, wires heated while they are warm) may lie within a step:
    rotations are exact at ends of steps and linear in between. With random commands in [-1, 1] every 0.2 s, steps of
    5 ms then cost 0.2 % of the path at most, against steps ten times shorter; with commands 0 and +-1 it is 0.1 %.

    peak_angle: Rotation if one wire is all contracted and the other not at all [rad].
    heating_time: Time in which a heated wire contracts [s].
    cooling_time: Time in which it relaxes [s].
    period: Length of a stroke [s]. None means heating_time + cooling_time.
    refractory: Whether a limb ignores commands until both its wires are cold.
    heating_power: Electric power of a heated wire [W], an assumption, see `base.WIRE_POWER`.
    """

    peak_angle: Annotated[Numbers, not_negative("rad")] = math.pi / 5
    heating_time: Annotated[float, positive("s")] = 0.1
    cooling_time: Annotated[float, positive("s")] = 0.9
    period: Annotated[float, positive("s")] = None  # type: ignore[assignment]  # a number after __post_init__
    refractory: bool = False
    heating_power: Annotated[float, not_negative("W")] = WIRE_POWER

    def __post_init__(self) -> None:
        check_numbers(self)
        if self.period is None:
            object.__setattr__(self, "period", self.heating_time + self.cooling_time)
            check_numbers(self)  # which refuses a sum beyond all floats
        require_flag("refractory", self.refractory)

    @property
    def corners(self) -> tuple[float, ...]:
        """Times since a full command from rest [s] that no time step may straddle."""
        cold = self.heating_time + self.cooling_time
        cold = self.period if math.isclose(cold, self.period, rel_tol=1e-12) else cold
        return tuple(sorted({0.0, self.heating_time, cold, self.period}))

    @property
    def rest(self) -> Floats:
        """State at rest, shape (4,)."""
        return np.zeros(4)

    def respond(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """Rotations and state as in `ActuatorBase`, exact at all times t."""
        since, left = t - t[0], self._seconds_to_heat(t, commands, state)
        contraction = self._contraction(since.reshape(-1, *(1,) * left.ndim), state[..., :2], left)
        turned = column(self.peak_angle) * (contraction[..., 0] - contraction[..., 1])
        return turned, np.concatenate([contraction[-1], self._left_after(since[-1], left)], axis=-1)

    def _seconds_to_heat(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        heard = np.where(self.refractory_wires(state)[..., 0], 0.0, commands) if self.refractory else commands
        return super()._seconds_to_heat(t, heard, state)

    def _contraction(self, since: Floats, before: Floats, left: Floats) -> Floats:
        """Contraction of wires after times `since` [s], from the one `before`, if they are heated for `left` [s]."""
        with np.errstate(over="ignore"):  # ramps that are steeper than any float are jumps
            early = since[: max(1, np.count_nonzero(since <= np.maximum.reduce(left, axis=None)))]
            rising = before + early / self.heating_time
            np.minimum(rising, 1.0, out=rising)
            if len(since) == 1:  # the beginning, where no wire has cooled yet
                return rising
            most = np.minimum(before + left / self.heating_time, 1.0)
            found = left + most * self.cooling_time - since
            found /= self.cooling_time
            np.maximum(found, 0.0, out=found)
        np.copyto(found[: len(early)], rising, where=early <= left)
        return found

    def observe(self, state: Floats) -> Floats:
        """Contractions of the two wires, shape (..., 2)."""
        return state[..., :2]

    def recall(self, numbers: Floats) -> Floats:
        """State of which these contractions are observed, with no pulse under way, shape (..., 4)."""
        return np.concatenate([numbers, np.zeros_like(numbers)], axis=-1)

    @property
    def can_be_refractory(self) -> bool:
        """Whether there ever are wires that cannot be heated."""
        return self.refractory

    def refractory_wires(self, state: Floats) -> Mask:
        """Wires that cannot be heated now, shape (..., 2): both of a limb until both are cold, or none."""
        warm = (state[..., :2] > COLD).any(axis=-1) | (state[..., 2:] > 0.0).any(axis=-1)
        return np.stack([warm & self.refractory, warm & self.refractory], axis=-1)


REACHED = 1e-9
"""Share of the largest rise in temperature that rounding may leave of it."""


Celsius: TypeAlias = Annotated[Numbers, finite("deg C")]
Seconds: TypeAlias = Annotated[float, positive("s")]


@register_part
@dataclass(frozen=True)
class ThermalSma(HeatingAndCooling, WirePair):
    """Actuator of two shape memory alloy wires per limb, with heat and hysteresis.

    The state of a limb is (T_+, T_-, xi_+, xi_-, r_+, r_-): temperatures [deg C], austenite fractions [1] and the time
    for which either wire is still heated [s]. The first four are observed. The rest is zero at ends of intervals that
    are not shorter than heating_time.

    peak_angle: Rotation if one wire is all austenite and the other all martensite [rad].
    heating_time: Pulse width of a full command [s]. Pulses of partial commands may end within a time step.
    cooling_time: Time from a full pulse to the end of the stroke [s].
    time_constant: tau = C/(h A) [s].
    steady_rise: P/(h A) [K], temperature above the water that constant heating tends to.
    water_temperature: T_water [deg C].
    austenite_start, austenite_finish: A_s and A_f [deg C].
    martensite_start, martensite_finish: M_s and M_f [deg C]. T_water <= M_f <= A_s < A_f and M_f < M_s <= A_f.
    largest_temperature: A pulse ends where the wire reaches it [deg C], and a wire that hot cannot be heated. None
        means no limit: a wire that is heated for ever tends to T_water plus the steady rise.
    heating_power: P [W], an assumption, see `base.WIRE_POWER`.
    """

    TEMPERATURES: ClassVar = (
        "water_temperature", "martensite_finish", "austenite_start", "martensite_start", "austenite_finish",
    )  # fmt: skip
    peak_angle: Annotated[Numbers, not_negative("rad")] = math.pi / 5
    heating_time: Seconds = 0.1
    cooling_time: Seconds = 0.9
    time_constant: Annotated[Numbers, positive("s")] = 0.42
    steady_rise: Annotated[Numbers, positive("K")] = 220.0
    water_temperature: Celsius = 20.0
    austenite_start: Celsius = 23.5
    austenite_finish: Celsius = 70.5
    martensite_start: Celsius = 56.0
    martensite_finish: Celsius = 21.5
    largest_temperature: Annotated[Numbers | None, finite("deg C")] = None
    heating_power: Annotated[float, not_negative("W")] = WIRE_POWER

    def __post_init__(self) -> None:
        check_numbers(self)
        batch_size(self)
        if self.heating_time / 100.0 > np.min(self.time_constant):
            raise ValueError("heating_time must be at most 100 time constants, after which nothing changes any more.")
        water, M_f, A_s, M_s, A_f = (np.asarray(getattr(self, name)) for name in self.TEMPERATURES)
        in_order = (water <= M_f) & (M_f <= A_s) & (A_s < A_f) & (M_f < M_s) & (M_s <= A_f)
        if not in_order.all():
            raise ValueError(
                f"Wires cool back only if T_water <= M_f <= A_s < A_f and M_f < M_s <= A_f [deg C], not with "
                f"T_water = {water}, M_f = {M_f}, A_s = {A_s}, A_f = {A_f} and M_s = {M_s}."
            )

        if self.largest_temperature is not None and np.any(self.largest_temperature <= water):
            raise ValueError(
                f"largest_temperature must be above the water's {water} deg C, not {shown(self.largest_temperature)}."
            )

    @property
    def rest(self) -> Floats:
        """State at rest: water temperature, no austenite, no heat; shape (6,), or (n_robots, 1, 6)."""
        water = column(self.water_temperature)
        return np.stack(np.broadcast_arrays(water, water, 0.0, 0.0, 0.0, 0.0), axis=-1)

    def respond(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """Rotations and state as in `ActuatorBase`, exact at all times t."""
        heated, t = self._seconds_to_heat(t, commands, state), t - t[0]
        tau, cold = column(self.time_constant, 2), column(self.water_temperature, 2)
        hot = cold + column(self.steady_rise, 2)
        start, before = state[..., :2], state[..., 2:4]
        with np.errstate(over="ignore"):  # so many time constants that nothing is left
            decay = np.exp(-t.reshape(-1, *(1,) * heated.ndim) / tau)
        growth = np.exp(heated / tau)
        hottest = hot + (start - hot) / growth
        after = self.transform(hottest, before)
        temperature = cold + (hottest - cold) * growth * decay
        austenite = self.transform(temperature, after)
        early = t < self.heating_time
        is_heated = t[early].reshape(-1, *(1,) * heated.ndim) < heated
        temperature[early] = np.where(is_heated, hot + (start - hot) * decay[early], temperature[early])
        austenite[early] = self.transform(temperature[early], np.where(is_heated, before, after))
        turned = column(self.peak_angle) * (austenite[..., 0] - austenite[..., 1])
        left = self._left_after(t[-1], heated)
        return turned, np.concatenate([temperature[-1], austenite[-1], left], axis=-1)

    def _seconds_to_heat(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        left = super()._seconds_to_heat(t, commands, state)
        return left if self.largest_temperature is None else np.minimum(left, self._time_to_limit(state[..., :2]))

    def _time_to_limit(self, temperature: Floats) -> Floats:
        """Time until heated wires reach the largest temperature [s], infinite if they never do."""
        limit, water = column(self.largest_temperature, 2), column(self.water_temperature, 2)
        hot = water + column(self.steady_rise, 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            time = column(self.time_constant, 2) * np.log((hot - temperature) / (hot - limit))
        return np.where(temperature >= limit, 0.0, np.where(hot > limit, time, np.inf))

    def transform(self, temperature: Floats, austenite: Floats) -> Floats:
        """Austenite fraction after the temperature [deg C] has changed monotonically, from the fraction before."""
        _, M_f, A_s, M_s, A_f = (column(getattr(self, name), 2) for name in self.TEMPERATURES)
        up = (temperature - A_s) / (A_f - A_s)
        down = (temperature - M_f) / (M_s - M_f)
        np.maximum(up, austenite, out=up)
        np.minimum(up, down, out=up)
        return np.clip(up, 0.0, 1.0, out=up)

    def observe(self, state: Floats) -> Floats:
        """Temperatures above the water over A_f - T_water, and austenite fractions, shape (..., 4)."""
        water, A_f = column(self.water_temperature, 2), column(self.austenite_finish, 2)
        warm = (state[..., :2] - water) / (A_f - water)
        return np.concatenate([warm, state[..., 2:4]], axis=-1)

    def recall(self, numbers: Floats) -> Floats:
        """State of which these numbers are observed, with no pulse under way, shape (..., 6)."""
        water, A_f = column(self.water_temperature, 2), column(self.austenite_finish, 2)
        temperatures = water + numbers[..., :2] * (A_f - water)
        return np.concatenate([temperatures, numbers[..., 2:], np.zeros_like(temperatures)], axis=-1)

    @property
    def can_be_refractory(self) -> bool:
        """Whether there ever are wires that cannot be heated."""
        return self.largest_temperature is not None

    def refractory_wires(self, state: Floats) -> NDArray[np.bool_]:
        """Wires that cannot be heated now, shape (..., 2): those at the largest temperature."""
        if self.largest_temperature is None:
            return np.zeros((*state.shape[:-1], 2), dtype=bool)
        limit, water = column(self.largest_temperature, 2), column(self.water_temperature, 2)
        return np.asarray(state[..., :2] >= limit - REACHED * (limit - water))
