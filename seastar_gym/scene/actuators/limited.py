"""`Limited`: an actuator with a largest angle and a largest rate of rotation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene.actuators.actuator import Actuator, ActuatorBase, Mirror, complete, is_actuator, stroke_at
from seastar_gym.scene.checks import shown
from seastar_gym.scene.number import Numbers, check_numbers, positive
from seastar_gym.scene.per_robot import batch_size, column
from seastar_gym.scene.serial import register_part

Floats = NDArray[np.float64]


@register_part
@dataclass(frozen=True)
class Limited(ActuatorBase):
    """Actuator that follows another one's curve within a largest angle and a largest rate of rotation.

    actuator: Actuator to follow, one without memory.
    largest_angle: Largest rotation [rad]. None means no limit.
    largest_rate: Largest rate of rotation [rad/s]. None means no limit.

    A slow limb may still be rotated when the next stroke begins, and continues from there: the state is its rotation
    [rad]. Between time steps the rotation is linear.
    """

    actuator: Actuator
    largest_angle: Annotated[Numbers | None, positive("rad")] = None
    largest_rate: Annotated[Numbers | None, positive("rad/s")] = None

    def __post_init__(self) -> None:
        if not is_actuator(self.actuator) or complete(self.actuator).has_memory:
            raise ValueError(f"Limited follows an actuator without memory, not {shown(self.actuator)}.")
        check_numbers(self)
        batch_size(self)

    @property
    def peak_angle(self) -> Numbers:
        """Largest rotation [rad]."""
        peak = self.actuator.peak_angle
        return peak if self.largest_angle is None else np.minimum(peak, self.largest_angle)

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
        """State at rest: no rotation [rad], shape (1,)."""
        return np.zeros(1)

    @property
    def mirror(self) -> Mirror:
        """What a mirror does to the state: the rotation changes its sign, see `actuator.mirrored`."""
        return ((0, -1),)

    @property
    def heating_power(self) -> float:
        """Electric power of the followed actuator [W], NaN if it does not say it."""
        return complete(self.actuator).heating_power

    def delta_psi(self, t: ArrayLike) -> Floats:
        """Rotation by command 1 at time t [s] of a stroke that begins at rest [rad]. t may have any shape."""
        times, n_robots = np.union1d(self.corners, t), batch_size(self)
        if n_robots is None:
            return np.asarray(self.respond(times, np.ones(()), self.rest)[0][np.searchsorted(times, t)])
        turned, _ = self.respond(times, np.ones((n_robots, 1)), self.rest)
        return np.asarray(turned[np.searchsorted(times, t), :, 0])

    def respond(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """Rotations and state as in `ActuatorBase`, exact if the followed curve is linear between the times t."""
        curve, peak, rate = stroke_at(self.actuator, t), column(self.peak_angle), column(self.largest_rate)
        wanted = curve.reshape(*curve.shape, *(1,) * (1 + commands.ndim - curve.ndim)) * commands
        wanted = np.clip(wanted, -peak, peak)
        turned = wanted if rate is None else np.empty_like(wanted)
        if rate is not None:
            turned[0] = state[..., 0]
            for k, duration in enumerate(np.diff(t), start=1):
                most = rate * duration
                turned[k] = turned[k - 1] + np.clip(wanted[k] - turned[k - 1], -most, most)
        return turned, turned[-1][..., None].copy()

    def observe(self, state: Floats) -> Floats:
        """Rotation as a fraction of the largest one, shape of `state`."""
        peak = np.asarray(column(self.peak_angle, 2))
        return state / np.where(peak > 0.0, peak, 1.0)

    def recall(self, numbers: Floats) -> Floats:
        """Rotation of which this share of the largest one is observed, shape of `numbers`."""
        return numbers * np.asarray(column(self.peak_angle, 2))

    def seconds_heated(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        """Time for which limbs are heated from t[0] to t[-1] [s], shape of `commands`: as of the followed actuator."""
        return complete(self.actuator).seconds_heated(t, commands, state)
