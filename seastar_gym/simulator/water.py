"""A robot relative to the water: the current at places, and velocities that are no drift.

A uniform current is a translation: what swims in it has the errors of still water, though it is carried off. Where the
water differs from place to place, the current is that at every node.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.terms.current import current_velocity
from seastar_gym.model.currents import current_rows
from seastar_gym.scene import Scene
from seastar_gym.simd.numpy_lanes import Lanes
from seastar_gym.simd.rows import aligned_rows
from seastar_gym.simulator.batch import Batch

Floats = NDArray[np.float64]


def velocity(scene: Scene, places: Floats) -> Floats:
    """Velocity of the water [m/s] at places [m], shape (..., 2). The first call in a process loads the plain kernels,
    so it is no call for a thread."""
    current = current_of(scene)
    if current is None:
        return np.zeros_like(places)
    found = current_velocity.plain(current_rows(current), Lanes(places[..., 0]), Lanes(places[..., 1]))
    return np.stack([np.broadcast_to(each.numbers, places.shape[:-1]) for each in found], axis=-1)


def relative_velocities(batch: Batch) -> Floats:
    """Velocities of a batch, rows as its own, less those of the water at every node [m/s]."""
    relative = aligned_rows(*batch.v.shape)
    relative[:] = batch.v
    for group, (q, v) in enumerate(zip(batch.q, relative, strict=True)):
        current = batch.coefficients.rods(group).current
        if current is None:
            return relative
        x, y = (Lanes(q[axis : batch.n_node_rows : 2]) for axis in (0, 1))
        for axis, water in enumerate(current_velocity.plain(current, x, y)):
            v[axis : batch.n_node_rows : 2] -= water.numbers
    return relative


def current_of(scene: Scene) -> Any:
    """Current of a scene, None for still water and in vacuum."""
    return None if scene.fluid is None else scene.fluid.current
