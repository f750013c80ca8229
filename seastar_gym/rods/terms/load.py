"""Dead loads: forces on nodes that change neither with time nor with place. Other constant forces join them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import add_product, load, splat
from seastar_gym.rods.star import Mesh

Floats = NDArray[np.float64]


def total(*forces: Floats | None) -> Floats | None:
    """Sum of constant forces of shape (n_nodes, 2) [N] as rows per coordinate; None where there are none."""
    present = [force for force in forces if force is not None]
    return sum(present[1:], present[0]).reshape(-1) if present else None


def coefficients(mesh: Mesh, loads: Sequence[tuple[int, float, float]]) -> Floats | None:
    """Dead loads (node, F_x, F_y) [N] as forces on all nodes, shape (n_nodes, 2); loads on one node add up."""
    if not loads:
        return None
    forces = np.zeros((len(mesh.dl), 2))
    for node, *force in loads:
        forces[node] += force
    return forces


@kernel
def nodal_load(rods, node):
    """Dead load on a node [N]; zero, and gone when compiled, in scenes without loads."""
    if rods.load is None:
        return splat(0.0), splat(0.0)
    return load(rods.load, 2 * node), load(rods.load, 2 * node + 1)


@kernel
def load_power(rods, node, vx, vy):
    """Power of a node's dead load at a velocity (vx, vy) [W]."""
    if rods.load is None:
        return splat(0.0)
    return add_product(load(rods.load, 2 * node) * vx, load(rods.load, 2 * node + 1), vy)
