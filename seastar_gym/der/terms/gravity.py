"""Gravity less buoyancy: F = (rho_m - rho_f) A dl g on every node, a constant force (see load.py)."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.mesh import Mesh


def coefficients(
    mesh: Mesh, density: float, fluid_density: float, gravity: tuple[float, float] | None
) -> NDArray[np.float64] | None:
    """Weight less buoyancy [N], shape (n_nodes, 2); gravity: Acceleration of free fall [m/s^2], None for none.

    In vacuum, where the fluid's density is zero, it is the whole weight.
    """
    if gravity is None:
        return None
    volume = mesh.per_node(lambda r: np.pi * r**2) * mesh.dl
    return np.outer((density - fluid_density) * volume, gravity)
