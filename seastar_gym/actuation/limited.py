"""An actuator that can turn no farther and no faster than its drive allows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.actuation.actuator import Actuator, StatefulActuator, is_actuator
from seastar_gym.checks import require_number

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Limited:
    """Follows another actuator's curve as far and as fast as it can.

    actuator: What is followed, one that remembers nothing.
    largest_angle: Where the limb stops [rad], None for no stop. largest_rate: How fast it turns [rad/s], None for any.

    A limb that is slow may still be turned when the next stroke begins, and goes on from there: the state is its
    rotation [rad]. A partial command asks less of it. Between time steps the rotation is linear.
    """

    actuator: Actuator
    largest_angle: float | None = None
    largest_rate: float | None = None

    def __post_init__(self) -> None:
        if not is_actuator(self.actuator) or isinstance(self.actuator, StatefulActuator):
            raise ValueError(f"Limited follows an actuator that remembers nothing, not {self.actuator!r}.")
        if self.largest_angle is not None:
            require_number("largest_angle", self.largest_angle, "rad")
        if self.largest_rate is not None:
            require_number("largest_rate", self.largest_rate, "rad/s")

    @property
    def peak_angle(self) -> float:
        """Largest rotation [rad]."""
        peak = self.actuator.peak_angle
        return peak if self.largest_angle is None else min(peak, self.largest_angle)

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
        """Not turned."""
        return np.zeros(1)

    def delta_psi(self, t: ArrayLike) -> Floats:
        """Rotation of a limb with command 1 at time t [s] of a stroke that begins at rest [rad]; t of any shape."""
        times = np.union1d(self.corners, t)
        turned, _ = self.respond(times, np.ones(()), self.rest)
        return np.asarray(np.interp(np.asarray(t, float), times, turned))

    def respond(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """See StatefulActuator: exact at the times t where the followed curve is linear between them."""
        wanted = np.multiply.outer(self.actuator.delta_psi(t), commands)
        wanted = np.clip(wanted, -self.peak_angle, self.peak_angle)
        turned = wanted if self.largest_rate is None else np.empty_like(wanted)
        if self.largest_rate is not None:
            turned[0] = state[..., 0]
            for k, most in enumerate(self.largest_rate * np.diff(t), start=1):
                turned[k] = turned[k - 1] + np.clip(wanted[k] - turned[k - 1], -most, most)
        return turned, turned[-1][..., None].copy()

    def observe(self, state: Floats) -> Floats:
        """Rotation over the largest one."""
        return state / (self.peak_angle or 1.0)
