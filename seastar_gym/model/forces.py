"""Constant forces on nodes: every force here is one function, and `constant_forces` adds them up."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.model.mesh import Mesh
from seastar_gym.scene.scene import Scene

Floats = NDArray[np.float64]


def constant_forces(scene: Scene, mesh: Mesh, density: float, fluid_density: float) -> Floats | None:
    """Sum of all constant forces [N], shape (2 n_nodes,), or None in scenes without any."""
    found = [dead_loads(scene, mesh), weight_less_buoyancy(scene, mesh, density, fluid_density)]
    forces = [force for force in found if force is not None]
    return sum(forces[1:], forces[0]).reshape(-1) if forces else None


def dead_loads(scene: Scene, mesh: Mesh) -> Floats | None:
    """Loads on nodes [N], shape (n_nodes, 2); loads on one node add up."""
    if not scene.loads:
        return None
    forces = np.zeros((len(mesh.dl), 2))
    for node, *force in scene.loads:
        forces[node] += force
    return forces


def weight_less_buoyancy(scene: Scene, mesh: Mesh, density: float, fluid_density: float) -> Floats | None:
    """(rho_m - rho_f) A dl_i g on every node [N], shape (n_nodes, 2); in vacuum the whole weight."""
    if scene.gravity is None:
        return None
    volume = mesh.per_node(lambda r: np.pi * r**2) * mesh.dl
    return np.outer((density - fluid_density) * volume, scene.gravity)
