"""Heat that actuators are given: how long their wires are heated, and at what electric power."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WIRE_POWER = 7.6
"""Electric power of a heated wire [W], an assumption: the chapter names none.

A nickel-titanium wire as long as a limb (0.1 m) and 0.25 mm thick, of 6450 kg/m^3 and 460 J/(kg K), has the heat
capacity C = 14.6 mJ/K. Power that lifts it in the end by the 220 K of `ThermalSma`, with its time constant of 0.42 s,
is P = C * steady_rise / tau = 7.6 W. Heat then goes to the water at 440 W/(m^2 K), plausible for a thin wire in still
water. A pulse of 0.1 s costs 0.76 J.
"""


@runtime_checkable
class Heated(Protocol):
    """Actuator that says how long its wires are heated. The energy that others need is unknown (NaN).

    heating_power: Electric power of a heated wire [W].
    """

    @property
    def heating_power(self) -> float: ...

    def seconds_heated(self, t: Floats, commands: Floats, state: Floats) -> Floats:
        """Time for which the wires of each limb are heated from t[0] to t[-1] [s], shape S.

        Arguments as in `StatefulActuator.respond`. Actuators without memory have states of shape (*S, 0).
        """
        ...


def share_of_pulse(t: Floats, commands: Floats, heating_time: float) -> Floats:
    """Time heated from t[0] to t[-1] [s], shape of `commands`, of a pulse that a command scales as a whole.

    t: Times since the commands were given [s]. Half a command needs half the heat and counts as half the time.
    """
    begin, end = np.minimum(t[[0, -1]], heating_time)
    return np.abs(commands) * (end - begin)


# --- pairs of wires --------------------------------------------------------------------------------------------------

SPENT = 1e-12
"""Share of the heating time that rounding may leave of a pulse."""
Mirror = tuple[tuple[int, int], ...]
MIRRORED_WIRES: Mirror = ((1, 1), (0, 1))
"""What a mirror does to numbers of a limb's two wires: they change places, see `actuator.mirrored`."""


def pulse_left(t: Floats, commands: Floats, left: Floats, heating_time: float) -> Floats:
    """Time for which every wire is heated from t[0] on [s], shape (*S, 2).

    Commands that are new at t[0] = 0 heat the wire of their sign; the other goes on with what is left of its pulse.

    t: Times since the commands were given [s]. commands: Shape S. left: The same before these commands, shape (*S, 2).
    """
    if t[0] > 0.0:
        return left
    wanted = heating_time * np.stack([np.maximum(commands, 0.0), np.maximum(-commands, 0.0)], axis=-1)
    return np.where(wanted > 0.0, wanted, left)


def left_after(duration: float, left: Floats, heating_time: float) -> Floats:
    """What is left of pulses after a while [s], shape of `left`."""
    after = left - duration
    return np.where(after > SPENT * heating_time, after, 0.0)


def seconds_of_wires(duration: float, left: Floats) -> Floats:
    """Time for which both wires together are heated within a while [s], shape S, if `left` (*S, 2) is left."""
    return np.minimum(left, duration).sum(axis=-1)
