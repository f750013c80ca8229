"""Velocities of robots relative to the water: those that are no drift."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.terms.current import current_velocity
from seastar_gym.simd.numpy_lanes import Lanes
from seastar_gym.simd.rows import aligned_rows
from seastar_gym.simulator.batch import Batch


def relative_velocities(batch: Batch) -> NDArray[np.float64]:
    """Velocities of a batch, rows as its own, less those of the water at every node [m/s]."""
    relative = aligned_rows(*batch.v.shape)
    relative[:] = batch.v
    for group, (q, v) in enumerate(zip(batch.q, relative, strict=True)):
        current = batch.coefficients.rods(group).current
        if current is None:
            break
        x, y = (Lanes(q[axis : batch.n_node_rows : 2]) for axis in (0, 1))
        for axis, water in enumerate(current_velocity.plain(current, x, y)):
            v[axis : batch.n_node_rows : 2] -= water.numbers
    return relative
