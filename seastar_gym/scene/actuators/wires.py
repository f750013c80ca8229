"""`SmaWires`: two shape memory alloy wires per limb with the linear heating and cooling of Fig. 13.5b."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.actuators.heating import WIRE_POWER, WirePair
from seastar_gym.scene.checks import require_flag
from seastar_gym.scene.number import Numbers, check_numbers, not_negative, positive
from seastar_gym.scene.per_robot import column
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
    heating_power: Electric power of a heated wire [W], an assumption, see `heating.WIRE_POWER`.
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
        since, left = t - t[0], self._left(t, commands, state)
        contraction = self._contraction(since.reshape(-1, *(1,) * left.ndim), state[..., :2], left)
        turned = column(self.peak_angle) * (contraction[..., 0] - contraction[..., 1])
        return turned, np.concatenate([contraction[-1], self._left_after(since[-1], left)], axis=-1)

    def _left(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        heard = np.where(self.refractory_wires(state)[..., 0], 0.0, commands) if self.refractory else commands
        return super()._left(t, heard, state)

    def _contraction(self, since: Floats, before: Floats, left: Floats) -> Floats:
        """Contraction of wires after times `since` [s], from the one `before`, if they are heated for `left` [s]."""
        with np.errstate(over="ignore"):  # ramps that are steeper than any float are jumps
            rising = np.minimum(before + since / self.heating_time, 1.0)
            if len(since) == 1:  # the beginning, where no wire has cooled yet
                return rising
            most = np.minimum(before + left / self.heating_time, 1.0)
            falling = np.maximum((left + most * self.cooling_time - since) / self.cooling_time, 0.0)
        return np.where(since <= left, rising, falling)

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
