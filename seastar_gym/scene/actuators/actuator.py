"""Interface of actuators, with and without memory.

A command is a number in [-1, 1] per limb and stroke. It makes the actuator rotate the limb by delta_psi [rad], positive
anti-clockwise.

Where numbers of an actuator differ from robot to robot (see per_robot.py), curves have one more axis, shape
(*t.shape, n_robots), and commands the shape (n_robots, n_limbs). Durations are equal for all robots of a batch.
"""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene.checks import shown
from seastar_gym.scene.per_robot import Numbers

Floats = NDArray[np.float64]


@runtime_checkable
class Actuator(Protocol):
    """Actuator that rotates every limb by its command times one curve, which is zero at both ends of a stroke.

    peak_angle: Largest rotation [rad], a number or one for each robot.
    period: Length of a stroke [s].
    corners: Times within a stroke [s], from 0 to the period, that no time step may straddle.
    """

    @property
    def peak_angle(self) -> Numbers: ...

    @property
    def period(self) -> float: ...

    @property
    def corners(self) -> tuple[float, ...]: ...

    def delta_psi(self, t: ArrayLike) -> Floats:
        """Rotation by command 1 at time t [s] of a stroke that begins at rest [rad]. t may have any shape."""
        ...


@runtime_checkable
class StatefulActuator(Actuator, Protocol):
    """Actuator with memory: the rotation of a limb depends on its earlier commands, too.

    rest: State of an actuator at rest, shape (n_state,), or (n_robots, 1, n_state).
    """

    @property
    def rest(self) -> Floats: ...

    def respond(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """Rotations during a stroke [rad], shape (len(t), *S), and the state at t[-1], shape (*S, n_state).

        t: Increasing times since the stroke began [s]. The first is 0.
        commands: Commands of any shape S.
        state: State at t = 0, shape (*S, n_state).
        """
        ...

    def observe(self, state: Floats) -> Floats:
        """State as numbers of order one that are zero at rest, shape (..., n_state)."""
        ...


def is_actuator(value: object) -> bool:
    """Whether a value has the attributes of an actuator."""
    return isinstance(value, Actuator) and not isinstance(value, type)


def check_actuator(actuator: Actuator) -> None:
    """Refuse an actuator whose curve does not begin and end at zero, or contradicts its corners or peak angle.

    If the curve did not begin at zero, limbs would jump when their command changes.
    """
    corners, period = np.asarray(actuator.corners, dtype=float), actuator.period
    if corners.ndim != 1 or len(corners) < 2 or not np.isfinite(corners).all() or (np.diff(corners) <= 0.0).any():
        raise ValueError(f"An actuator's corners must be increasing times [s], not {shown(actuator.corners)}.")
    if corners[0] != 0.0 or corners[-1] != period:
        raise ValueError(
            f"An actuator's corners must go from 0 to its period ({shown(period)} s), not {shown(actuator.corners)}."
        )
    angles = np.asarray(actuator.delta_psi(corners), dtype=float)
    if angles.shape[:1] != corners.shape or angles.ndim > 2 or not np.isfinite(angles).all():
        raise ValueError(f"An actuator's delta_psi must be one finite angle [rad] per time, not {shown(angles)}.")
    peak = np.asarray(actuator.peak_angle, dtype=float)
    if not np.isfinite(peak).all() or (np.abs(angles).max(axis=0) > peak * (1.0 + 1e-12)).any():
        raise ValueError(f"An actuator's peak_angle must be its largest angle, not {shown(actuator.peak_angle)} rad.")
    if angles[0].any() or (angles[-1].any() and not isinstance(actuator, StatefulActuator)):
        raise ValueError("An actuator's curve must begin and end a stroke at 0 rad: otherwise limbs would jump.")
