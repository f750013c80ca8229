"""`ThermalSma`: a shape memory alloy actuator with Joule heating, cooling in water and hysteresis.

Every limb has two wires, one for each direction of rotation. A command heats one of them for a fraction of the heating
time (pulse width). A wire is thin and has one temperature T. With its heat capacity C, the electric power P and the
heat transfer to the water h A per kelvin,

    C dT/dt = P - h A (T - T_water)    =>    T = T_inf + (T_0 - T_inf) exp(-t/tau),    tau = C/(h A),

where T_inf = T_water + P/(h A) while it is heated and T_water while it cools. Its austenite fraction xi lies between

    up(T), from 0 at A_s to 1 at A_f,    and    down(T), from 0 at M_f to 1 at M_s.

Heating raises it along the first line, cooling lowers it along the second, and between them it is constant. Within a
phase the temperature is monotone, so xi = clip(xi_0, up(T), down(T)) at any time. The limb rotates by the peak angle
times xi_+ - xi_-. Latent heat and the heat of the limb are neglected.

The defaults make a full command come closest to the pulse of Fig. 13.5b, from rest and in later strokes, rounded;
`python -m studies.scenes.thermal` fits them. The deviation is 6 to 7 % of the peak angle in the root mean square and
16 % at most, at the end of a stroke, where an exponential has a tail and the pulse has none. Latent heat, gradual
transformation, natural convection or a shorter pulse reduce it to 5.3 % at best, and are not modelled. The defaults are
effective numbers, not those of one alloy.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene.actuators.pulse import HeatingAndCooling
from seastar_gym.scene.checks import require_finite, require_number
from seastar_gym.scene.per_robot import Numbers, batch_size, column, require_each
from seastar_gym.scene.serial import register_part

Floats = NDArray[np.float64]


@register_part
@dataclass(frozen=True)
class ThermalSma(HeatingAndCooling):
    """Actuator of two shape memory alloy wires per limb, with heat and hysteresis.

    The state of a limb is (T_+, T_-, xi_+, xi_-): temperatures [deg C] and austenite fractions [1] of its two wires.

    peak_angle: Rotation if one wire is all austenite and the other all martensite [rad].
    heating_time: Pulse width of a full command [s]. Pulses of partial commands may end within a time step.
    cooling_time: Time from a full pulse to the end of the stroke [s].
    time_constant: tau = C/(h A) [s].
    steady_rise: P/(h A) [K], temperature above the water that constant heating tends to.
    water_temperature: T_water [deg C].
    austenite_start, austenite_finish: A_s and A_f [deg C].
    martensite_start, martensite_finish: M_s and M_f [deg C]. T_water <= M_f <= A_s < A_f and M_f < M_s <= A_f.
    """

    TEMPERATURES: ClassVar = (
        "water_temperature", "martensite_finish", "austenite_start", "martensite_start", "austenite_finish",
    )  # fmt: skip
    PER_ROBOT: ClassVar = ("peak_angle", "time_constant", "steady_rise", *TEMPERATURES)
    peak_angle: Numbers = math.pi / 5
    heating_time: float = 0.1
    cooling_time: float = 0.9
    time_constant: Numbers = 0.42
    steady_rise: Numbers = 220.0
    water_temperature: Numbers = 20.0
    austenite_start: Numbers = 23.5
    austenite_finish: Numbers = 70.5
    martensite_start: Numbers = 56.0
    martensite_finish: Numbers = 21.5

    def __post_init__(self) -> None:
        require_each(self, "peak_angle", partial(require_number, unit="rad", zero_allowed=True))
        for name, unit in (("heating_time", "s"), ("cooling_time", "s")):
            require_number(name, getattr(self, name), unit)
        for name, unit in (("time_constant", "s"), ("steady_rise", "K")):
            require_each(self, name, partial(require_number, unit=unit))
        for name in self.TEMPERATURES:
            require_each(self, name, partial(require_finite, unit="deg C"))
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

    @property
    def rest(self) -> Floats:
        """State at rest: water temperature, no austenite; shape (4,), or (n_robots, 1, 4)."""
        water = column(self.water_temperature)
        return np.stack(np.broadcast_arrays(water, water, 0.0, 0.0), axis=-1)

    def delta_psi(self, t: ArrayLike) -> Floats:
        """Rotation by command 1 at time t [s] of a stroke that begins at rest [rad]. t may have any shape."""
        t, n_robots = np.asarray(t, dtype=float), batch_size(self)
        if n_robots is None:
            return self.respond(t.ravel(), np.ones(()), self.rest)[0].reshape(t.shape)
        return self.respond(t.ravel(), np.ones((n_robots, 1)), self.rest)[0].reshape(*t.shape, n_robots)

    def respond(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """Rotations and state as in `StatefulActuator`, exact at all times t."""
        heated = self.heating_time * np.stack([np.maximum(commands, 0.0), np.maximum(-commands, 0.0)], axis=-1)
        tau, cold = column(self.time_constant, 2), column(self.water_temperature, 2)
        hot = cold + column(self.steady_rise, 2)
        start, before = state[..., :2], state[..., 2:]
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
        return turned, np.concatenate([temperature[-1], austenite[-1]], axis=-1)

    def transform(self, temperature: Floats, austenite: Floats) -> Floats:
        """Austenite fraction after the temperature [deg C] has changed monotonically, from the fraction before."""
        _, M_f, A_s, M_s, A_f = (column(getattr(self, name), 2) for name in self.TEMPERATURES)
        up = (temperature - A_s) / (A_f - A_s)
        down = (temperature - M_f) / (M_s - M_f)
        np.maximum(up, austenite, out=up)
        np.minimum(up, down, out=up)
        return np.clip(up, 0.0, 1.0, out=up)

    def observe(self, state: Floats) -> Floats:
        """Temperatures above the water over A_f - T_water, and austenite fractions, shape of `state`."""
        water, A_f = column(self.water_temperature, 2), column(self.austenite_finish, 2)
        warm = (state[..., :2] - water) / (A_f - water)
        return np.concatenate([warm, state[..., 2:]], axis=-1)
