"""`ErrorBars`: how far the hub may be from where it is with infinitely many nodes and infinitely short steps.

A twin of the simulator swims along: the same scene with edges and time steps half as long, the same commands and
resets. The two are never brought together, so their distance has the errors of all intervals since the reset, of
space and of time. The estimate is

    factor * (largest distance of the two hubs at ends of intervals since the reset + newton_tolerance * limb_length).

With errors of second order, the error is 4/3 of the distance. Undamped limbs ring longer than steps resolve, and errors
of space and time may cancel in one robot and not in the other, so the factors are larger: those that cover the true
error in about 95 % of strokes of the robot that needs the largest, as `python -m studies.accuracy.error_bars` at commit
055100c4 measured (docs/numerics.md).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.checks import shown
from seastar_gym.scene.per_robot import column
from seastar_gym.simulator.state import State

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

FACTORS: dict[str, float] = {
    "implicit-midpoint": 4.5, "sdirk2": 5.0, "sdirk3": 7.5, "implicit-euler": 9.0,
}  # fmt: skip
"""Estimate over distance of the two hubs."""
FACTOR_OF_CHAPTER = 3.5
"""The same for the chapter's discretisation, where errors of space prevail, of first order, whatever the scheme."""
OF_ONE_MESH = (
    "Held nodes and loads belong to one mesh, so this scene has no twin of shorter edges that would tell its error: "
    "use error_bars=False."
)


class Swimmers(Protocol):
    """What a twin does, as a `Simulator` does it."""

    scene: Scene

    def advance(self, duration: float, commands: ArrayLike | None = None) -> object: ...
    def reset(self, mask: ArrayLike | None = None, heading: ArrayLike = 0.0) -> None: ...
    def get_state(self) -> State: ...
    def set_state(self, state: State) -> None: ...
    def set_scene(self, scene: Scene, mask: ArrayLike | None = None) -> None: ...
    def set_limb_strengths(self, strengths: ArrayLike) -> None: ...
    def hub_position(self) -> Floats: ...
    @property
    def failed(self) -> Mask: ...
    def close(self) -> None: ...


class Snapshot(NamedTuple):
    """Copies of what an interval changes, made before it."""

    twin: State
    largest: Floats


def twin_scene(scene: Scene) -> Scene:
    """The scene with edges and time steps half as long; steps that are adapted become equal ones."""
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
    numerics = replace(scene.numerics, step=0.5 * scene.numerics.step, path_tolerance=None)
    return replace(scene, robot=robot, numerics=numerics)


def factor(scene: Scene) -> float:
    """Estimate over distance for a scene."""
    return FACTOR_OF_CHAPTER if scene.robot.discretisation == "chapter" else FACTORS[scene.numerics.scheme]


class ErrorBars:
    """Error estimates of a batch of robots, and the twin that they come from.

    twin: As many robots of their `twin_scene`, at rest.
    """

    def __init__(self, twin: Swimmers, n_robots: int):
        self.twin = twin
        self._largest = np.zeros(n_robots)  # distance of the two hubs since the reset [m], NaN where unknown

    @property
    def estimate(self) -> Floats:
        """Estimate of the hub's error [m], shape (n_robots,); 0 at rest, NaN where unknown until the next reset."""
        scene = self.twin.scene
        floor = scene.numerics.newton_tolerance * column(scene.robot.limb_length, n_axes=0)
        return np.asarray(factor(scene) * np.where(self._largest > 0.0, self._largest + floor, self._largest))

    def compare(self, hub: Floats, failed: Mask) -> None:
        """Compare hubs [m], shape (n_robots, 2), with those of the twin, after an interval of both."""
        distance = np.linalg.norm(hub - self.twin.hub_position(), axis=1)
        known = ~(failed | self.twin.failed)
        self._largest = np.maximum(self._largest, np.where(known, distance, np.nan))  # NaN stays until the reset

    def reset(self, chosen: Mask, heading: Floats) -> None:
        """Put robots at rest, see `Simulator.reset`."""
        self.twin.reset(chosen, heading)
        self._largest[chosen] = 0.0

    def lose(self) -> None:
        """Know no estimate until the next reset: robots were put into a state that has no like on the twin's mesh."""
        self.twin.reset()
        self._largest[:] = np.nan

    def save(self) -> Snapshot:
        """Copies for `restore`."""
        return Snapshot(self.twin.get_state(), self._largest.copy())

    def restore(self, before: Snapshot) -> None:
        """Undo an interval. Robots on which the solver failed before swim again in the twin, but have no estimate."""
        self.twin.set_state(before.twin)
        self._largest = before.largest
