"""What is told of robots beside their state: a `Watch` is asked around every interval.

`EnergyGrowth` tells whether time stepping gathers energy. On some meshes the implicit midpoint rule resonates with some
steps: the robot gathers energy for a hundred strokes, and only then swims differently. The fidelities were tried
(accuracy/measure.py), and a certificate tells it of its settings. Whoever chooses other numerics is told here: the
kinetic energy relative to the water, over the largest in the first strokes. Energies go with the square of commands, so
each counts over that of the largest command so far.

`ErrorBars` tell how far the hub may be from where it is with infinitely many nodes and infinitely short steps. A twin
of the simulator swims along: the same scene with edges and time steps half as long, the same commands and resets. The
two are never brought together, so their distance has the errors of all intervals since the reset, of space and of time.
The estimate is

    factor * (largest distance of the two hubs at ends of intervals since the reset + newton_tolerance * limb_length).

With errors of second order, the error is 4/3 of the distance. Undamped limbs ring longer than steps resolve, and errors
of space and time may cancel in one robot and not in the other, so the factors are larger: those that cover the true
error in about 95 % of strokes of the robot that needs the largest, as `studies.accuracy.error_bars` of commit 055100c4
measured (docs/numerics.md).
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.rods.step import Scheme
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import shown
from seastar_gym.scene.number import column
from seastar_gym.scene.numerics import DAMPING, PRESETS, Resolution
from seastar_gym.simulator.state import State

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Watch:
    """Watches the robots of a `Simulator`, and tells a number of each in every report. It moves none of them."""

    @property
    def told(self) -> Floats:
        """What it tells now, shape (n_robots,), a copy."""
        raise NotImplementedError

    def begin(self, duration: float, commands: Floats | None) -> None:
        """Begin an interval [s] with commands, shape (n_robots, n_limbs), None for none."""

    def end(self, robots: Any, failed: Mask) -> None:
        """End an interval of a `Simulator`. failed: Robots whose solver has given up, shape (n_robots,)."""

    def reset(self, chosen: Mask, heading: Floats) -> None:
        """Some robots were put at rest, see `Simulator.reset`."""

    def lose(self) -> None:
        """All robots were put into a new state."""

    def checked(self, scene: Scene) -> Any:
        """What `set_scene` needs of a scene. ValueError if it cannot be watched."""

    def set_scene(self, scene: Any, chosen: Mask) -> None:
        """The chosen robots have numbers of another scene, of which `checked` returned this."""

    def set_limb_strengths(self, strengths: Floats) -> None:
        """Limbs have these strengths from now on, shape (n_robots, n_limbs)."""

    def save(self) -> Any:
        """What `restore` needs to undo an interval."""

    def restore(self, before: Any) -> None:
        """Undo an interval."""

    def close(self) -> None:
        """End what it has started."""


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


def may_gather(scheme: Scheme) -> bool:
    """Whether a step leaves oscillations that are too fast for it more of their amplitude than DAMPING does."""
    n = scheme.n_stages
    kept = abs(1.0 - scheme.b @ np.linalg.solve(scheme.a.reshape(n, n), np.ones(n)))
    return bool(kept > (1.0 - DAMPING) / (1.0 + DAMPING) * (1.0 + 1e-9))


class EnergyGrowth(Watch):
    """Growth of the kinetic energy of a batch of robots.

    It warns of a scheme that may gather energy. Otherwise growth is of commands, such as one that was held in the first
    strokes.

    period: Of the actuator [s]. Energies are taken once in a period while any robot swims its first strokes.
    """

    def __init__(self, n_robots: int, period: float, scheme: Scheme):
        self._period, self._elapsed, self._duration = period, 0.0, 0.0
        self._may_warn = may_gather(scheme)
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
        self._commands = np.zeros(len(self._begin)) if commands is None else np.maximum.reduce(np.abs(commands), axis=1)

    def end(self, robots: Any, failed: Mask) -> None:
        self._largest = np.maximum(self._largest, self._commands)
        self._elapsed += self._duration
        periods = 1 if any(self._is_early.tolist()) else EVERY
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
        if not self._may_warn or self._growth[robot] < ENOUGH:
            return
        self._may_warn = False
        warnings.warn(
            f"The kinetic energy of robot {robot} is {self._growth[robot]:.0f} times that of its first {WINDOW} "
            f"strokes: these numerics seem to gather energy. Use Numerics(..., damping={DAMPING:g}), shorter steps "
            "or another number of nodes per limb.",
            RuntimeWarning,
            stacklevel=2,
        )


FACTORS: dict[str, float] = {"implicit-midpoint": 4.5, "sdirk2": 5.0, "implicit-euler": 9.0}
"""Estimate over distance of the two hubs."""
FACTOR_OF_CHAPTER = 3.5
"""The same for the chapter's discretisation, where errors of space prevail, of first order, whatever the scheme."""
OF_ONE_MESH = (
    "Held nodes and loads belong to one mesh, so this scene has no twin of shorter edges that would tell its error: "
    "use error_bars=False."
)


def twin_scene(scene: Scene) -> Scene:
    """The scene with edges and time steps half as long."""
    if not isinstance(scene, Scene):
        raise ValueError(f"A Scene is needed, not {shown(scene)}.")
    if scene.held_nodes or scene.loads:
        raise ValueError(OF_ONE_MESH)
    if scene.numerics.scheme not in FACTORS:
        raise ValueError(
            f"Nobody has measured how far the twin's errors go with the scheme {shown(scene.numerics.scheme)}: use "
            f"error_bars=False, or one of {', '.join(map(repr, FACTORS))}."
        )
    robot = replace(scene.robot, nodes_per_limb=2 * scene.robot.nodes_per_limb - 1)
    numerics = replace(scene.numerics, step=0.5 * scene.numerics.step)
    return replace(scene, robot=robot, numerics=numerics)


def factor(scene: Scene) -> float:
    """Estimate over distance for a scene."""
    return FACTOR_OF_CHAPTER if scene.robot.discretisation == "chapter" else FACTORS[scene.numerics.scheme]


class ErrorBars(Watch):
    """Error estimates of a batch of robots, and the twin that they come from.

    twin: `Simulator` of as many robots of their `twin_scene`, at rest.
    """

    def __init__(self, twin: Any, n_robots: int):
        self.twin = twin
        self._largest = np.zeros(n_robots)  # distance of the two hubs since the reset [m], NaN where unknown

    @property
    def told(self) -> Floats:
        """Estimate of the hub's error [m], shape (n_robots,); 0 at rest, NaN where unknown until the next reset."""
        scene = self.twin.scene
        floor = scene.numerics.newton_tolerance * column(scene.robot.limb_length, n_axes=0)
        return np.asarray(factor(scene) * np.where(self._largest > 0.0, self._largest + floor, self._largest))

    def begin(self, duration: float, commands: Floats | None) -> None:
        self.twin.advance(duration, commands)

    def end(self, robots: Any, failed: Mask) -> None:
        distance = np.linalg.norm(robots.hub_position() - self.twin.hub_position(), axis=1)
        known = ~(failed | self.twin.failed)
        self._largest = np.maximum(self._largest, np.where(known, distance, np.nan))  # NaN stays until the reset

    def reset(self, chosen: Mask, heading: Floats) -> None:
        self.twin.reset(chosen, heading)
        self._largest[chosen] = 0.0

    def lose(self) -> None:
        """Know no estimate until the next reset: the state has no like on the twin's mesh."""
        self.twin.reset()
        self._largest[:] = np.nan

    def checked(self, scene: Scene) -> Scene:
        return twin_scene(scene)

    def set_scene(self, scene: Any, chosen: Mask) -> None:
        self.twin.set_scene(scene, chosen)

    def set_limb_strengths(self, strengths: Floats) -> None:
        self.twin.set_limb_strengths(strengths)

    def save(self) -> tuple[State, Floats]:
        return self.twin.get_state(), self._largest.copy()

    def restore(self, before: Any) -> None:
        """Undo an interval. Robots on which the solver failed before swim again in the twin, but have no estimate."""
        state, self._largest = before
        self.twin.set_state(state)

    def close(self) -> None:
        self.twin.close()
