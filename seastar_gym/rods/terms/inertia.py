"""Inertia: lumped masses, with the Voronoi lengths that drag has, too; the hub carries half of every root edge."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import add_product, load, splat, subtract_product
from seastar_gym.rods.star import Mesh, edge_vector, tail_node

HELD = 1e15
"""A held node has this many times its mass: it moves by about 1e-13 m in a stroke of the chapter's robot, which the
simulator takes back at its end, and the kernels need not know of it. With more, rounding would spoil the potential."""


class Inertia(NamedTuple):
    """Masses.

    node: Lumped, per node [kg]; with a body, per place, see star.py.
    edge: What consistent masses take from lumped ones, per edge [kg]; None for lumped masses.
    """

    node: NDArray[np.float64]
    edge: NDArray[np.float64] | None


def coefficients(mesh: Mesh, density: float, consistent: bool) -> Inertia:
    """Masses of limbs of a density [kg/m^3]; consistent: Those of velocities that are linear along edges."""
    node: NDArray[np.float64] = density * mesh.per_node(mesh.at_nodes.inert) * mesh.dl
    return Inertia(node, edge_coefficients(mesh, density) if consistent else None)


def hold(mass: NDArray[np.float64], nodes: Sequence[int]) -> None:
    """Hold nodes by their masses, in place."""
    mass[list(nodes)] *= HELD


def edge_coefficients(mesh: Mesh, density: float) -> NDArray[np.float64]:
    """mu = rho_m A l/6, per edge [kg]: with consistent masses an edge has mu |d_head - d_tail|^2/2 less inertia.

    An edge whose halves weigh a and b may have less than a b/(a + b) less, or its kinetic energy would not be positive.
    Only limbs that taper by a lot from one node to the next come to that.
    """
    area, at_nodes = mesh.at_edges.inert, mesh.at_nodes.inert
    tail, head = at_nodes[:, :-1].ravel(), at_nodes[:, 1:].ravel()
    most = MOST_TAKEN * density * (0.5 * mesh.l) / (1.0 / tail + 1.0 / head)
    return np.minimum(density * area * mesh.l / 6.0, most)


MOST_TAKEN = 0.9
"""Largest mu over a b/(a + b). In a limb of one radius it is 2/3."""


@kernel
def subtract_edge_inertia(rods, stage, e, tail, head, slopes):
    """(E, f, K) of an edge less mu |d_head - d_tail|^2/2, d = v - v_hat; unchanged for lumped masses."""
    if rods.inertia.edge is None:
        return slopes
    energy, (fx, fy), (xx, xy, yy) = slopes
    mu = load(rods.inertia.edge, e)
    dx, dy = head.dx - tail.dx, head.dy - tail.dy
    mu_over_gamma = mu * stage.inverse_gamma
    stiffness = mu_over_gamma * stage.inverse_gamma
    return (
        subtract_product(energy, 0.5 * mu, add_product(dx * dx, dy, dy)),
        (subtract_product(fx, mu_over_gamma, dx), subtract_product(fy, mu_over_gamma, dy)),
        (xx - stiffness, xy, yy - stiffness),
    )


@kernel
def kinetic_energy(rods, v, frame):
    """Kinetic energy [J] as seen from a frame that moves with the velocity `frame` [m/s]."""
    total = splat(0.0)
    for node in range(rods.n_nodes):
        vx, vy = load(v, 2 * node) - frame[0], load(v, 2 * node + 1) - frame[1]
        total = add_product(total, 0.5 * load(rods.inertia.node, node), vx * vx + vy * vy)
    return subtract_edge_energy(rods, v, total)


@kernel
def subtract_edge_energy(rods, v, energy):
    """Kinetic energy less mu |v_head - v_tail|^2/2 of the edges [J]; unchanged for lumped masses (None)."""
    if rods.inertia.edge is None:
        return energy
    for e in range(rods.n_edges):
        dx, dy = edge_vector(v, tail_node(rods, e), e + 1)
        energy = subtract_product(energy, 0.5 * load(rods.inertia.edge, e), add_product(dx * dx, dy, dy))
    return energy
