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
from typing import Any, NamedTuple

import numpy as np

from seastar_gym.scene import Scene
from seastar_gym.scene.checks import shown
from seastar_gym.scene.per_robot import column
from seastar_gym.simulator.state import State
from seastar_gym.simulator.watch import Floats, Mask, Swimmers, Watch

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


class ErrorBars(Watch):
    """Error estimates of a batch of robots, and the twin that they come from.

    twin: As many robots of their `twin_scene`, at rest.
    """

    def __init__(self, twin: Swimmers, n_robots: int):
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

    def end(self, robots: Swimmers, failed: Mask) -> None:
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

    def save(self) -> Snapshot:
        return Snapshot(self.twin.get_state(), self._largest.copy())

    def restore(self, before: Any) -> None:
        """Undo an interval. Robots on which the solver failed before swim again in the twin, but have no estimate."""
        self.twin.set_state(before.twin)
        self._largest = before.largest

    def close(self) -> None:
        self.twin.close()
