"""`EnergyGrowth`: whether time stepping gathers energy, told while robots swim.

On some meshes the implicit midpoint rule resonates with some steps: the robot gathers energy for a hundred strokes, and
only then swims differently. The fidelities were tried (accuracy/endurance.py), and a certificate tells it of its
settings. Whoever chooses other numerics is told here: the kinetic energy relative to the water, over the largest in the
first strokes. Energies go with the square of commands, so each counts over that of the largest command so far.
"""

import warnings

import numpy as np

from seastar_gym.scene import Scene
from seastar_gym.scene.numerics import DAMPING, PRESETS, Resolution
from seastar_gym.simulator.watch import Floats, Mask, Swimmers, Watch

WINDOW = 20
"""First strokes of a swim, in periods of the actuator, whose largest energy later ones are compared with."""
ENOUGH = 20.0
"""Growth at which nothing more is to be learned: numerics that gather no energy have about 1."""
SMALLEST = 1e-3
"""Commands below this share count as this."""
EVERY = 5
"""Periods between energies that are taken later."""
FLOOR = 1e-18
"""Energy [J] that counts at least: equal limbs that turn alike end strokes at rest, with rounding, below 1e-20 J."""


def is_watched(scene: Scene) -> bool:
    """Whether a scene has numerics, or a robot, of which no fidelity is known to gather no energy."""
    robot = scene.robot
    return not scene.is_chapters or (
        Resolution(robot.discretisation, robot.nodes_per_limb, scene.numerics) not in PRESETS.values()
    )


class EnergyGrowth(Watch):
    """Growth of the kinetic energy of a batch of robots.

    period: Of the actuator [s]. Energies are taken once in a period while any robot swims its first strokes.
    """

    def __init__(self, n_robots: int, period: float):
        self._period, self._elapsed, self._duration, self._warned = period, 0.0, 0.0, False
        self._commands = np.zeros(n_robots)  # largest of the present interval
        self._begin = np.full(n_robots, np.nan)  # time of the first command [s], NaN before
        self._early, self._largest = np.zeros((2, n_robots))  # energy per squared command [J], command
        self._growth, self._is_early = np.ones(n_robots), np.ones(n_robots, bool)

    @property
    def told(self) -> Floats:
        """Growth of every robot's energy, shape (n_robots,); 1 in the first strokes."""
        return self._growth.copy()

    def lose(self) -> None:
        self._forget(slice(None))

    def reset(self, chosen: Mask, heading: Floats) -> None:
        self._forget(chosen)

    def _forget(self, chosen: Mask | slice) -> None:
        """Forget the swims of some robots."""
        self._begin[chosen] = np.nan
        self._early[chosen] = self._largest[chosen] = 0.0
        self._growth[chosen], self._is_early[chosen] = 1.0, True

    def begin(self, duration: float, commands: Floats | None) -> None:
        self._duration = duration
        self._commands = np.zeros(len(self._begin)) if commands is None else np.abs(commands).max(axis=1)

    def end(self, robots: Swimmers, failed: Mask) -> None:
        self._largest = np.maximum(self._largest, self._commands)
        self._elapsed += self._duration
        periods = 1 if self._is_early.any() else EVERY
        if self._elapsed >= periods * self._period * (1.0 - 1e-9):
            self._elapsed = 0.0
            self._note(robots.kinetic_energy(relative_to_water=True), robots.time)

    def _note(self, energy: Floats, time: Floats) -> None:
        commanded = self._largest > 0.0
        self._begin = np.where(commanded & np.isnan(self._begin), time - self._period, self._begin)
        is_known = commanded & np.isfinite(energy)  # no robot that failed
        scaled = np.where(is_known, energy, 0.0) / np.maximum(self._largest, SMALLEST) ** 2
        self._is_early = ~(time - self._begin > (WINDOW + 1e-9) * self._period)
        self._early = np.where(self._is_early, np.maximum(self._early, scaled), self._early)
        self._growth = np.where(self._is_early, 1.0, scaled / np.maximum(self._early, FLOOR))
        self._warn()

    def _warn(self) -> None:
        robot = int(self._growth.argmax())
        if self._warned or self._growth[robot] < ENOUGH:
            return
        self._warned = True
        warnings.warn(
            f"The kinetic energy of robot {robot} is {self._growth[robot]:.0f} times that of its first {WINDOW} "
            f"strokes: these numerics seem to gather energy. Use Numerics(..., damping={DAMPING:g}), shorter steps "
            "or another number of nodes per limb.",
            RuntimeWarning,
            stacklevel=2,
        )
