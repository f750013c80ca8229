"""Heading of the body frame, by the rotation of the rest shape that fits the nodes best, and where limbs begin."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Seastar

Floats = NDArray[np.float64]


def best_fit_heading(positions: Floats, rest: Floats) -> Floats:
    """Rotation of the rest shape about the hub that fits the nodes best in least squares [rad], shape (n_robots,).

    positions: Node positions [m], shape (n_robots, n_nodes, 2).
    rest: Node positions at rest [m], shape (n_nodes, 2), or those of every robot, shape (n_robots, n_nodes, 2).
    """
    if rest.ndim > 2:
        each = zip(positions[:, None], rest, strict=True)
        return np.concatenate([best_fit_heading(one, own) for one, own in each])
    x, y = np.moveaxis(positions - positions[:, :1], -1, 0)
    return np.asarray(np.arctan2(y @ rest[:, 0] - x @ rest[:, 1], x @ rest[:, 0] + y @ rest[:, 1]))


def root_places(robot: Seastar, orientation: Floats) -> Floats:
    """Places where limbs begin, from the hub [m], shape (..., n_limbs, 2), at orientations [rad], shape (...)."""
    x, y = np.array([limb.root for limb in robot.limb_shapes()]).T
    c, s = np.cos(orientation)[..., None], np.sin(orientation)[..., None]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)
