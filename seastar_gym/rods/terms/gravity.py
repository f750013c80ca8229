"""Gravity less buoyancy: F = (rho_m - rho_f) A dl g on every node, a constant force (see load.py)."""

from collections.abc import Callable

import numpy as np

from seastar_gym.rods.star import Floats, Mesh, Sections


def coefficients(
    mesh: Mesh, density: float, fluid_density: float, gravity: tuple[float, float] | None
) -> Floats | None:
    """Weight less buoyancy [N], shape (n_nodes, 2); gravity: Acceleration of free fall [m/s^2], None for none.

    In vacuum, where the fluid's density is zero, it is the whole weight.
    """
    if gravity is None:
        return None
    return np.outer(heaviness(mesh.at_nodes, volumes_of(mesh), density, fluid_density), gravity)


def volumes_of(mesh: Mesh) -> Callable[[Floats], Floats]:
    """How volumes at all nodes [m^3] follow from areas at the nodes of limbs [m^2]."""
    return lambda areas: mesh.per_node(areas) * mesh.dl


def heaviness(at: Sections, volumes: Callable[[Floats], Floats], density: float, fluid_density: float) -> Floats:
    """Mass less that of the displaced fluid [kg]. volumes: Of such areas."""
    hollow = density * volumes(at.inert - at.area) - fluid_density * volumes(at.displaced - at.area)
    return (density - fluid_density) * volumes(at.area) + hollow
