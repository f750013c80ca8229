"""What a robot in vacuum keeps."""

import numpy as np

from seastar_gym.der.rods import Rods


def momenta(rods: Rods, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear [kg m/s] and angular momentum about the origin [kg m^2/s] of robots at q, v, shape (n_robots, n_nodes, 2).

    The linear one is that of lumped masses. With consistent masses, limbs that turn have edges whose differences in
    velocity count less, see inertia.py.
    """
    spin = cross(q, v) @ rods.mass
    if rods.edge_mass is not None:
        tails = np.arange(len(rods.edge_mass))
        tails[:: rods.nodes_per_limb - 1] = 0
        spin -= cross(q[:, 1:] - q[:, tails], v[:, 1:] - v[:, tails]) @ rods.edge_mass
    return np.einsum("n,rnd->rd", rods.mass, v), spin


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
