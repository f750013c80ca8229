"""A robot relative to the water: the current at places, and the kinetic energy that is no drift.

A uniform current is a translation: what swims in it has the errors of still water, though it is carried off. Where the
water differs from place to place, the current is that at every node.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.terms.current import current_velocity
from seastar_gym.model.currents import current_rows
from seastar_gym.scene import Scene
from seastar_gym.simd.numpy_lanes import Lanes

if TYPE_CHECKING:
    from seastar_gym.simulator.simulator import Simulator

Floats = NDArray[np.float64]


def velocity(scene: Scene, places: Floats) -> Floats:
    """Velocity of the water [m/s] at places [m], shape (..., 2). The first call in a process loads the plain kernels,
    so it is no call for a thread."""
    current = current_of(scene)
    if current is None:
        return np.zeros_like(places)
    found = current_velocity.plain(current_rows(current), Lanes(places[..., 0]), Lanes(places[..., 1]))
    return np.stack([np.broadcast_to(each.numbers, places.shape[:-1]) for each in found], axis=-1)


def kinetic_energy(simulator: "Simulator") -> Floats:
    """Kinetic energy relative to the water at every node [J], shape (n_robots,)."""
    if current_of(simulator.scene) is None:
        return simulator.kinetic_energy()
    over_ground, n_rows = simulator.v.copy(), 2 * simulator.scene.robot.n_nodes
    try:
        for group, (q, v) in enumerate(zip(simulator.q, simulator.v, strict=True)):
            current = simulator.coefficients.rods(group).current
            water = current_velocity.plain(current, Lanes(q[0:n_rows:2]), Lanes(q[1:n_rows:2]))
            for axis, speed in enumerate(water):
                v[axis:n_rows:2] -= speed.numbers
        return simulator.kinetic_energy()
    finally:
        simulator.v[:] = over_ground


def current_of(scene: Scene) -> Any:
    """Current of a scene, None for still water and in vacuum."""
    return None if scene.fluid is None else scene.fluid.current
