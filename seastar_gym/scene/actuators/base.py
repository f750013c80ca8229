"""Interface of actuators, with and without memory.

A command is a number in [-1, 1] per limb, given at the beginning of an interval of time. It makes the actuator rotate
the limb by delta_psi [rad], positive anti-clockwise. A stroke is the interval of one period.

`Actuator` is what a class has to have. What else may be asked of one is in `ActuatorBase`, with the answers of an
actuator that says nothing: no memory, energy that is not known, and wires that can always be heated. A class of one's
own may say more, derived from that base or not.

Where numbers of an actuator differ from robot to robot (see scene/number.py), curves have one more axis, shape
(*t.shape, n_robots), and commands the shape (n_robots, n_limbs). Durations are equal for all robots of a batch.

`WirePair` has what pairs of wires share that are heated: for how long, and at what electric power.
"""

from __future__ import annotations

import math
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene.checks import shown
from seastar_gym.scene.number import Numbers, batch_size

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Mirror: TypeAlias = tuple[tuple[int, int], ...]

JUMP = 1e-9
"""Rotation over the peak angle. A limb that would turn by more at once would jump."""


@runtime_checkable
class Actuator(Protocol):
    """Actuator that rotates every limb by its command times one curve, which is zero at both ends of a stroke.

    After its period, such an actuator is at rest.

    peak_angle: Largest rotation [rad], a number or one for each robot.
    period: Length of a stroke [s].
    corners: Times since commands were given [s], from 0 to the period, that no time step may straddle. Those of an
        actuator with memory may go on after the period.
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


class ActuatorBase(Actuator):
    """Base of actuators, with the answers of one that remembers nothing and says no more than it has to.

    has_memory: Whether the rotation of a limb depends on its earlier commands, too: whether the class has `respond`.
    rest: State of an actuator at rest, shape (n_state,), or (n_robots, 1, n_state); n_state is 0 without memory.
    mirror: (index, sign) for each number of the state: number k of the mirrored limb is sign times number `index` of
        the limb. The same holds for the numbers of `observe`. None: it is not known.
    heating_power: Electric power of a heated wire [W]; NaN: it is not known.
    can_be_refractory: Whether there ever are wires that cannot be heated.
    """

    @property
    def has_memory(self) -> bool:
        return type(self).respond is not ActuatorBase.respond

    @property
    def rest(self) -> Floats:
        return np.zeros(0)

    @property
    def mirror(self) -> Mirror | None:
        return None if self.has_memory else ()

    @property
    def heating_power(self) -> float:
        return math.nan

    @property
    def can_be_refractory(self) -> bool:
        return False

    def respond(self, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats]:
        """Rotations during an interval [rad], shape (len(t), *S), and the state at t[-1], shape (*S, n_state).

        t: Increasing times since the commands were given [s]. Where the first is 0, the commands are new. Where it is
            later, an earlier interval has begun with them, and its end is in the state. They are 0 where nothing is
            under way.
        commands: Commands of any shape S.
        state: State at t[0], shape (*S, n_state).
        """
        raise NotImplementedError(f"{type(self).__name__} has no memory.")

    def observe(self, state: Floats) -> Floats:
        """State as numbers of order one that are zero at rest, shape (..., k): of the first k numbers of the state."""
        return state

    def recall(self, numbers: Floats) -> Floats | None:
        """State of which these numbers, shape (..., k), are observed, the rest as at rest; None: it is not known."""
        return None

    def seconds_heated(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        """Time for which the wires of each limb are heated from t[0] to t[-1] [s], shape S; NaN: it is not known.

        Arguments as in `respond`.
        """
        return np.full_like(commands, math.nan)

    def refractory_wires(self, state: Floats) -> Mask | None:
        """Wires for + and - that cannot be heated now, shape (*S, 2); None: it is not known.

        state: Shape (*S, n_state).
        """
        return None


class Adapted(ActuatorBase):
    """Actuator of a class that is not derived from `ActuatorBase`, with the base's answers where it has none."""

    def __init__(self, own: Actuator):
        self.own = own

    def __getattribute__(self, name: str) -> Any:
        """What the actuator has of this name, or else the base."""
        if name != "own" and not name.startswith("_") and hasattr(self.own, name):
            return getattr(self.own, name)
        return super().__getattribute__(name)

    @property
    def has_memory(self) -> bool:
        return all(hasattr(self.own, name) for name in ("rest", "respond", "observe"))


def complete(actuator: Actuator) -> ActuatorBase:
    """Actuator that answers everything that may be asked of one."""
    return actuator if isinstance(actuator, ActuatorBase) else Adapted(actuator)  # type: ignore[abstract]


def stroke_at(actuator: Actuator, t: Floats) -> Floats:
    """Rotation by command 1 at times t [s] since it was given [rad], of an actuator that rests after its period."""
    return np.asarray(actuator.delta_psi(np.minimum(t, actuator.period)))


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
    has_memory = complete(actuator).has_memory
    last = period if has_memory and period in corners else corners[-1]
    if corners[0] != 0.0 or last != period:
        raise ValueError(
            f"An actuator's corners must go from 0 to its period ({shown(period)} s), not {shown(actuator.corners)}."
        )
    angles = np.asarray(actuator.delta_psi(corners), dtype=float)
    if angles.shape[:1] != corners.shape or angles.ndim > 2 or not np.isfinite(angles).all():
        raise ValueError(f"An actuator's delta_psi must be one finite angle [rad] per time, not {shown(angles)}.")
    peak = np.asarray(actuator.peak_angle, dtype=float)
    if not np.isfinite(peak).all() or (np.abs(angles).max(axis=0) > peak * (1.0 + 1e-12)).any():
        raise ValueError(f"An actuator's peak_angle must be its largest angle, not {shown(actuator.peak_angle)} rad.")
    if angles[0].any() or (angles[-1].any() and not has_memory):
        raise ValueError("An actuator's curve must begin and end a stroke at 0 rad: otherwise limbs would jump.")


WIRE_POWER = 7.6
"""Electric power of a heated wire [W], an assumption: the chapter names none.

A nickel-titanium wire as long as a limb (0.1 m) and 0.25 mm thick, of 6450 kg/m^3 and 460 J/(kg K), has the heat
capacity C = 14.6 mJ/K. Power that lifts it in the end by the 220 K of `ThermalSma`, with its time constant of 0.42 s,
is P = C * steady_rise / tau = 7.6 W. Heat then goes to the water at 440 W/(m^2 K), plausible for a thin wire in still
water. A pulse of 0.1 s costs 0.76 J.
"""


def share_of_pulse(t: Floats, commands: Floats, heating_time: float) -> Floats:
    """Time heated from t[0] to t[-1] [s], shape of `commands`, of a pulse that a command scales as a whole.

    t: Times since the commands were given [s]. Half a command needs half the heat and counts as half the time.
    """
    return np.abs(commands) * (min(t[-1], heating_time) - min(t[0], heating_time))


SPENT = 1e-12
"""Share of the heating time that rounding may leave of a pulse."""
SIGNS = np.array([1.0, -1.0])
"""Signs of the commands that heat either wire."""


class WirePair(ActuatorBase):
    """Two wires per limb, one for each direction of rotation.

    Numbers of the state come in pairs, (+, -). The last pair is the time for which either wire is heated [s], so that a
    command heats the wire of its sign for a fraction of the heating time (pulse width), and the other goes on with what
    is left of its pulse.
    """

    heating_time: float

    @property
    def mirror(self) -> Mirror:
        """What a mirror does to the state: the wires change places."""
        return tuple((k ^ 1, 1) for k in range(self.rest.shape[-1]))

    def delta_psi(self, t: ArrayLike) -> Floats:
        """Rotation by command 1 at time t [s] of a stroke that begins at rest [rad]. t may have any shape."""
        t, n_robots = np.asarray(t, dtype=float), batch_size(self)
        from_start = np.append(0.0, t.ravel())
        if n_robots is None:
            return self.respond(from_start, np.ones(()), self.rest)[0][1:].reshape(t.shape)
        rest = np.broadcast_to(self.rest, (n_robots, 1, self.rest.shape[-1]))
        return self.respond(from_start, np.ones((n_robots, 1)), rest)[0][1:].reshape(*t.shape, n_robots)

    def _seconds_to_heat(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        """Time for which every wire is heated from t[0] on [s], shape (*S, 2).

        Commands that are new at t[0] = 0 heat the wire of their sign.
        """
        if t[0] > 0.0:
            return state[..., -2:]
        wanted = self.heating_time * np.maximum(commands[..., None] * SIGNS, 0.0)
        return np.where(wanted > 0.0, wanted, state[..., -2:])

    def _left_after(self, duration: float | Floats, left: Floats) -> Floats:
        """What is left of pulses after a while [s], shape of `left`."""
        after = left - duration
        return np.where(after > SPENT * self.heating_time, after, 0.0)

    def seconds_heated(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        """Time for which the wires of each limb are heated from t[0] to t[-1] [s], shape of `commands`."""
        return np.asarray(np.minimum(self._seconds_to_heat(t, commands, state), t[-1] - t[0]).sum(axis=-1))
