"""A robot as the water sees it: its start and its way relative to the current.

A uniform current is a translation: what swims in it has the errors of still water, though it is carried off. Where the
water differs from place to place, the current is that at the hub.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.model.currents import velocities_at
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]


def velocity(scene: Scene, places: Floats) -> Floats:
    """Velocity of the water [m/s] at places [m], shape (..., 2), as `velocities_at`; zero without a current."""
    current = _current(scene)
    return np.zeros_like(places) if current is None else velocities_at(current, places)


def with_the_water(scene: Scene, n_robots: int, threads: int | None = None, error_bars: bool = False) -> Simulator:
    """Robots at rest in the water: with the hub at the origin, and with the velocity of the water there."""
    simulator = Simulator(scene, n_robots, threads, error_bars)
    if _current(scene) is not None:
        state = simulator.get_state()
        simulator.set_state(state._replace(velocities=state.velocities + velocity(scene, np.zeros(2))))
    return simulator


def carried(scene: Scene, hub: Floats) -> Floats:
    """How far the water carries a hub in every stroke [m]: by its velocity where the stroke begins and where it ends.

    hub: At the ends of strokes from the origin [m], shape (strokes, n, 2), as is the result.
    """
    at_ends = velocity(scene, np.concatenate([np.zeros((1, *hub.shape[1:])), hub]))
    return scene.actuator.period * 0.5 * (at_ends[:-1] + at_ends[1:])


def _current(scene: Scene) -> Any:
    return None if scene.fluid is None else scene.fluid.current
