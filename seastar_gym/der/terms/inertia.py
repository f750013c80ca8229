"""Inertia: lumped masses, with the Voronoi lengths that drag has, too; the hub carries half of every root edge."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.mesh import Mesh
from seastar_gym.der.star import n_nodes
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load, splat

HELD = 1e15
"""A held node has this many times its mass: it moves by about 1e-13 m in a stroke of the chapter's robot, which the
simulator takes back at its end, and the kernels need not know of it. With more, rounding would spoil the potential."""


def coefficients(mesh: Mesh, density: float, held_nodes: Sequence[int] = ()) -> NDArray[np.float64]:
    """Lumped mass, per node [kg]."""
    mass = density * mesh.per_node(lambda r: np.pi * r**2) * mesh.dl
    mass[list(held_nodes)] *= HELD
    return mass


@kernel
def kinetic_energy(rods, v, frame):
    """Kinetic energy [J] as seen from a frame that moves with the velocity `frame` [m/s]."""
    total = splat(0.0)
    for node in range(n_nodes(rods)):
        vx, vy = load(v, 2 * node) - frame[0], load(v, 2 * node + 1) - frame[1]
        total = add_product(total, 0.5 * load(rods.mass, node), vx * vx + vy * vy)
    return total
