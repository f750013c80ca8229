"""Heat that actuators are given, how long and at what electric power, and pairs of wires that are heated."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene.actuators.actuator import ActuatorBase, Mirror
from seastar_gym.scene.per_robot import batch_size

Floats = NDArray[np.float64]

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
        """What a mirror does to the state: the wires change places, see `actuator.mirrored`."""
        return tuple((k ^ 1, 1) for k in range(self.rest.shape[-1]))

    def delta_psi(self, t: ArrayLike) -> Floats:
        """Rotation by command 1 at time t [s] of a stroke that begins at rest [rad]. t may have any shape."""
        t, n_robots = np.asarray(t, dtype=float), batch_size(self)
        from_start = np.append(0.0, t.ravel())
        if n_robots is None:
            return self.respond(from_start, np.ones(()), self.rest)[0][1:].reshape(t.shape)
        rest = np.broadcast_to(self.rest, (n_robots, 1, self.rest.shape[-1]))
        return self.respond(from_start, np.ones((n_robots, 1)), rest)[0][1:].reshape(*t.shape, n_robots)

    def _left(self, t: Floats, commands: Floats, state: Floats) -> Floats:
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
        return np.asarray(np.minimum(self._left(t, commands, state), t[-1] - t[0]).sum(axis=-1))
