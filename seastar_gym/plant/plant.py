"""`Plant`: what can be asked of a robot in a tank.

`SimulatedPlant`: a simulated robot in the place of one in a tank, seen as cameras see.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.delays import POSE, Tracker
from seastar_gym.envs.sight import Lateness, Sight
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import WirePair
from seastar_gym.scene.actuators.curves import SmaPulse
from seastar_gym.scene.actuators.wires import SmaWires
from seastar_gym.scene.checks import require_flag, require_kind, require_seed
from seastar_gym.simulator import Simulator


class PlantError(RuntimeError):
    """A plant that was stopped, and why, in one sentence."""


class Sighting(NamedTuple):
    """What a tracker saw in a picture."""

    captured_at: float
    """Time at which the picture was taken, on the plant's clock [s]."""
    seen_at: float
    """Time at which it was known here, on the same clock [s]."""
    pose: tuple[float, float, float]
    """Hub x, y [m] and heading of limb 1 [rad], anti-clockwise, in the tank."""
    markers: NDArray[np.float64] | None = None
    """Places of markers in the tank [m], shape (n_limbs, n, 2), from hub to tip; None where only the pose is seen."""


class Plant(Protocol):
    """A robot of `n_limbs` limbs with two wires each, and a tracker that sees it.

    Whoever drives it calls `sight` or `heat` again and again: a plant that hears nothing for 0.1 s stops by itself.
    """

    n_limbs: int

    def now(self) -> float:
        """Time on the plant's clock [s], which never goes back."""

    def wait(self, seconds: float) -> None:
        """Return after so many seconds on this clock."""

    def sight(self) -> Sighting | None:
        """The newest sighting, None before there is one; says that the driver lives. PlantError: it has stopped."""

    def heat(self, limbs: Sequence[int], seconds: float) -> None:
        """Heat a wire of every limb from now on: 1 the one for +, -1 the one for -, 0 none, for so many seconds.

        A pulse replaces what is left of the last one of the same wire. Other wires go on.
        """

    def stop(self) -> None:
        """Heat no wire any more."""


ROUNDING = 1e-9


def with_wires(scene: Scene) -> Scene:
    """The scene with the wires of which an `SmaPulse` is the strokes from rest; others as they are."""
    actuator = scene.actuator
    return replace(scene, actuator=SmaWires(**asdict(actuator))) if isinstance(actuator, SmaPulse) else scene


class SimulatedPlant:
    """Plant that is a simulator of one robot with wires, which moves on by its time steps as time goes by.

    simulator: Of one robot whose wires, such as `SmaWires`, can be heated for as long as pulses are.
    sight: How the robot is seen: rate, delays and errors. "nodes" it cannot be.
    seed: Of what is drawn. paced: Whether its clock is that of the wall, as for a robot in a tank. Otherwise its time
    goes by while somebody waits, as fast as it can be simulated.
    """

    def __init__(self, simulator: Simulator, sight: Sight | None = None, seed: int = 0, paced: bool = False):
        require_kind("simulator", simulator, Simulator, "a Simulator")
        sight = Sight() if sight is None else sight
        require_kind("sight", sight, Sight, "a Sight")
        require_seed(seed)
        require_flag("paced", paced)
        actuator = simulator.scene.actuator
        if simulator.n_robots != 1:
            raise ValueError(f"A simulated plant is one robot with wires, not {simulator.n_robots}.")
        if not isinstance(actuator, WirePair):
            kind = type(actuator).__name__
            raise ValueError(f"A simulated plant is one robot with wires: use ThermalSma or SmaWires, not {kind}.")
        if sight.sees == "nodes":
            raise ValueError('A tracker sees no nodes: use sees="pose", or markers.')
        self.simulator, self.n_limbs = simulator, simulator.scene.robot.n_limbs
        self._clock: Callable[[], float] | None = time.monotonic if paced else None
        self._begun = self._clock() if self._clock else 0.0
        rng, lateness = np.random.default_rng(seed), Lateness(sight.numbers, 1)
        lateness.draw(0, rng)
        self._tracker = Tracker(sight.rate, sight.sees, self.n_limbs, lateness.values)
        self._tracker.begin(np.ones(1, bool), [rng], simulator)
        self._steps, self._unpaced = 0, 0.0
        self._commands = np.zeros((1, self.n_limbs))

    def now(self) -> float:
        """Time on the plant's clock [s]; of a paced one that of `time.monotonic`."""
        return self._unpaced if self._clock is None else self._clock()

    def wait(self, seconds: float) -> None:
        """Return after so many seconds."""
        if self._clock is None:
            self._unpaced += seconds
        else:
            time.sleep(seconds)
        self.move_on()

    def move_on(self) -> None:
        """Simulate until now."""
        step = self.simulator.scene.numerics.step
        due = int((self.now() - self._begun) / step + ROUNDING) - self._steps
        if due <= 0:
            return
        for _ in self.simulator.advance_in_parts(due * step, self._commands, due):
            self._tracker.take(self.simulator)
        self._steps += due
        self._commands = np.zeros((1, self.n_limbs))

    def sight(self) -> Sighting:
        """The newest sighting."""
        self.move_on()
        tracker, elapsed = self._tracker, self.simulator.time
        tracker.look(elapsed)
        row, taken_at = tracker.now.rows[0], float(tracker.now.taken_at[0])
        (x, y), (c, s) = row[:2], row[2:POSE]
        markers = None
        if len(row) > POSE:
            places = row[POSE:].reshape(self.n_limbs, -1, 2) * self.simulator.scene.robot.limb_length
            markers = places @ np.array([[c, s], [-s, c]]) + [x, y]
        heading = float(np.arctan2(s, c))
        return Sighting(self._begun + taken_at, self.now(), (float(x), float(y), heading), markers)

    def heat(self, limbs: Sequence[int], seconds: float) -> None:
        """Heat wires, see `Plant`; from the next time step on. ValueError: for longer than the wires can be."""
        self.move_on()
        actuator = self.simulator.scene.actuator
        assert isinstance(actuator, WirePair)
        longest = float(actuator.heating_time)
        if not 0.0 <= seconds <= longest * (1.0 + ROUNDING):
            raise ValueError(f"These wires can be heated for 0 to {longest:g} s at a time, not {seconds:.3g} s.")
        signs = np.asarray(limbs, np.float64)
        self._commands[0] = np.where(signs != 0.0, signs * min(seconds / longest, 1.0), self._commands[0])

    def stop(self) -> None:
        """Heat no wire any more."""
        self.move_on()
        if not self.heated().any():
            return
        self._commands = np.zeros((1, self.n_limbs))
        state, actuators = self.simulator.get_state(), self.simulator.actuators
        actuators[..., -2:] = 0.0
        self.simulator.set_state(state._replace(actuators=actuators))

    def heated(self) -> NDArray[np.bool_]:
        """Wires that are heated now, for + and -, shape (n_limbs, 2)."""
        waiting = np.stack([self._commands[0] > 0.0, self._commands[0] < 0.0], axis=-1)
        return np.asarray((self.simulator.actuators[0, :, -2:] > 0.0) | waiting)
