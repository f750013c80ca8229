"""Periodic gaits in time, and how they swim once they swim steadily.

A gait is an array of pulses, shape (n_slots, n_limbs): in slot k of its period, which begins at k times the length of a
slot, the wire of every limb is heated by that share of a full pulse, + anti-clockwise.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.stations import heading_of
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]

CHUNK = 2048
"""Gaits that are simulated in one batch."""
SETTLING, MEASURED = 4, 4
"""Periods before and during the measurement: from rest, a gait swims as it will go on, to 1 %, after about four."""
STRAIGHT = np.radians(0.3)
"""Largest turn of a straight gait [rad/s]."""
NO_WAY = 1e-9
"""Speed [m/s] below which a gait does not swim."""


class Swimming(NamedTuple):
    """How gaits swim; arrays over gaits.

    velocity: Mean velocity of the hub in the body frame [m/s], shape (n, 2). turn: Mean rate of turning [rad/s].
    pulses: Full pulses per second, as heating time over that of one pulse [1/s]. power: Mean electric power [W].
    """

    velocity: Floats
    turn: Floats
    pulses: Floats
    power: Floats

    @property
    def speed(self) -> Floats:
        """Speed [m/s], shape (n,)."""
        return np.asarray(np.hypot(*self.velocity.T))

    @property
    def is_straight(self) -> NDArray[np.bool_]:
        """Whether gaits keep their heading, shape (n,)."""
        return np.abs(self.turn) < STRAIGHT

    @property
    def energy_per_metre(self) -> Floats:
        """Electric energy per metre of way [J/m], shape (n,); infinite for a gait that does not swim."""
        return np.where(self.speed > NO_WAY, self.power / np.maximum(self.speed, NO_WAY), np.inf)

    def of(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "Swimming":
        """The chosen gaits, in their order."""
        return Swimming(*(part[chosen] for part in self))


def joined(parts: list[Swimming]) -> Swimming:
    """All gaits of several groups, in their order."""
    return Swimming(*map(np.concatenate, zip(*parts, strict=True)))


def measure(scene: Scene, gaits: Floats, slot: float, settling: int = SETTLING, measured: int = MEASURED) -> Swimming:
    """How gaits swim, shape (n_gaits, n_slots, n_limbs), whose slots are that long [s].

    settling, measured: Numbers of periods before and during the measurement.
    """
    chunks = [gaits[begin : begin + CHUNK] for begin in range(0, len(gaits), CHUNK)]
    return joined([_measure(scene, chunk, slot, settling, measured) for chunk in chunks])


def _measure(scene: Scene, gaits: Floats, slot: float, settling: int, measured: int) -> Swimming:
    simulator, n_slots = Simulator(scene, len(gaits)), gaits.shape[1]
    heated, energy = np.zeros((2, len(gaits)))
    for period in range(settling + measured):
        if period == settling:
            hub, heading = simulator.hub_position(), heading_of(simulator)
            heated[:], energy[:] = 0.0, 0.0
        for k in range(n_slots):
            report = simulator.advance(slot, gaits[:, k])
            heated += report.heating_time
            energy += report.energy
    seconds = measured * n_slots * slot
    turn = heading_of(simulator) - heading
    turn -= 2.0 * np.pi * np.rint(turn / (2.0 * np.pi))
    way = (simulator.hub_position() - hub) @ [1.0, 1.0j] * np.exp(-1j * heading)
    return Swimming(
        np.stack([way.real, way.imag], axis=1) / seconds,
        turn / seconds,
        heated / seconds / scene.actuator.heating_time,  # type: ignore[attr-defined]
        energy / seconds,
    )


def timed(events: dict[float, str], period: float, slot: float, n_limbs: int = 5, level: float = 1.0) -> Floats:
    """Gait of one period [s] from its events: what is heated, such as "2+,5-", by the time when it is [s].

    level: Share of a full pulse. ValueError if a time is no whole number of slots.
    """
    gait = np.zeros((round(period / slot), n_limbs))
    for time, limbs in events.items():
        k = round(time / slot)
        if not np.isclose(k * slot, time):
            raise ValueError(f"An event at {time:.4g} s is not at the beginning of a slot of {slot:.4g} s.")
        for limb in limbs.split(","):
            gait[k, int(limb[:-1]) - 1] = level if limb[-1] == "+" else -level
    return gait


def events_of(gait: ArrayLike, slot: float) -> str:
    """Text of a gait: times [s] and what is heated then, such as "0: 2+,5-; 0.6: 3+,4-", with levels below 1."""
    parts = []
    for k, row in enumerate(np.asarray(gait)):
        limbs = [
            f"{limb}{'+' if share > 0 else '-'}" + ("" if abs(share) > 0.995 else f"({abs(share):.2f})")
            for limb, share in enumerate(row, start=1)
            if share
        ]
        if limbs:
            parts.append(f"{k * slot:.3g}: {','.join(limbs)}")
    return "; ".join(parts)
