"""Swims through the water: from rest in it, and how far it carries a hub."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator
from seastar_gym.simulator.water import current_of, velocity

Floats = NDArray[np.float64]


def with_the_water(
    scene: Scene, n_robots: int, threads: int | None = None, error_bars: bool = False
) -> Simulator:
    """Robots at rest in the water: with the hub at the origin, and with the velocity of the water there."""
    simulator = Simulator(scene, n_robots, threads, error_bars)
    if current_of(scene) is not None:
        state = simulator.get_state()
        simulator.set_state(state._replace(velocities=state.velocities + velocity(scene, np.zeros(2))))
    return simulator


def carried(scene: Scene, hub: Floats) -> Floats:
    """How far the water carries a hub in every stroke [m]: by its velocity where the stroke begins and where it ends.

    hub: At the ends of strokes from the origin [m], shape (strokes, n, 2), as is the result.
    """
    at_ends = velocity(scene, np.concatenate([np.zeros((1, *hub.shape[1:])), hub]))
    return scene.actuator.period * 0.5 * (at_ends[:-1] + at_ends[1:])
