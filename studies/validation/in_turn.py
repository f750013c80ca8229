"""`InTurn`: limbs that follow a curve in two turns, some of them a part of a period after the others."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene import MeasuredCurve
from seastar_gym.scene.actuators.actuator import ActuatorBase
from studies.frame import Floats

LATE = 0.5
"""Size of the command of limbs that are late; that of the others is 1."""
SAME = 1e-4
"""Times that are nearer to each other are one corner [periods]."""


@dataclass(frozen=True)
class InTurn(ActuatorBase):
    """A curve that late limbs follow `lag` periods after the others, in every stroke by the same command.

    Late limbs rest until their first turn. The state of a limb is 1 once a stroke is over, and 0 before.
    """

    curve: MeasuredCurve
    lag: float

    @property
    def peak_angle(self) -> NDArray[np.float64]:
        return np.asarray(self.curve.peak_angle)

    @property
    def period(self) -> float:
        return self.curve.period

    @property
    def corners(self) -> tuple[float, ...]:
        own = np.asarray(self.curve.times)
        both = np.sort(np.append(own[:-1], np.mod(own[:-1] + self.lag * self.period, self.period)))
        apart = np.diff(both, append=self.period) > SAME * self.period
        return (0.0, *both[apart & (both > SAME * self.period)].tolist(), self.period)

    @property
    def rest(self) -> Floats:
        return np.zeros(1)

    def delta_psi(self, t: ArrayLike) -> Floats:
        """Rotation of limbs that are not late [rad]."""
        return self.curve.delta_psi(t)

    def respond(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """Rotations and state as in `ActuatorBase`."""
        begun = np.broadcast_to(state[..., 0], commands.shape)
        since = t - self.lag * self.period
        late = _column(self.curve.delta_psi(np.mod(since, self.period)), commands)
        waits = (since < 0.0).reshape(-1, *(1,) * commands.ndim) & (begun < 1.0)
        first = _column(self.curve.delta_psi(t), commands)
        turned = np.where(np.abs(commands) > LATE, first, np.where(waits, 0.0, late))
        return turned * np.sign(commands), np.where(t[-1] < self.period, begun, 1.0)[..., None]


def _column(curve: Floats, commands: Floats) -> Floats:
    """Curve of every robot, or of all, beside its limbs' commands."""
    return curve.reshape(*curve.shape, *(1,) * (1 + commands.ndim - curve.ndim))
