"""Coefficients of the fluid's terms, for the kernels der/drag.py and der/added_mass.py; vacuum has density zero."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.model.mesh import Mesh

Floats = NDArray[np.float64]


def drag_per_length(density: float, coefficient: float, radius: float) -> float:
    """1/2 rho_f C_d D of (13.8), per length and squared speed, of a limb of that radius [kg/m^2]."""
    return 0.5 * density * coefficient * 2.0 * radius


def drag(mesh: Mesh, density: float, coefficient: float) -> Floats:
    """Of flow that any direction may have, 1/2 rho_f C D dl, per node [kg/m]."""
    return mesh.per_node(lambda r: drag_per_length(density, coefficient, r)) * mesh.dl


def cross_drag(mesh: Mesh, density: float, C_d: float, C_t: float) -> Floats:
    """What flow across an edge adds to drag with C_t, 1/2 rho_f (C_d - C_t) D l/2, per half edge [kg/m]."""
    added = [drag_per_length(density, C_d, r) - drag_per_length(density, C_t, r) for r in mesh.radius_at_edges]
    return mesh.per_half_edge(np.array(added) * 0.5 * mesh.l)


def added_mass(mesh: Mesh, density: float, C_a: float) -> Floats:
    """Fluid that an edge accelerates across itself, rho_f C_a pi r_0^2 l/2, per half edge [kg]."""
    area = np.array([np.pi * r**2 for r in mesh.radius_at_edges])
    return mesh.per_half_edge(density * C_a * area * 0.5 * mesh.l)
