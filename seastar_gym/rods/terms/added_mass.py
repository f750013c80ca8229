"""Added mass, as in Morison's equation: fluid that an edge accelerates across itself weighs on its nodes.

Half an edge adds m_a n n^T, m_a = rho_f C_a A_a l/2, to the mass of each of its nodes, n its normal where the stage's
first guess has it, off by the square of the step: a constant of the minimisation. A_a is that of the cross section, pi
r_0^2 of a disc. What the turning of n, and a current's own acceleration, would add is left out.

The continuum's discretisation takes it as consistently as the robot's own mass: velocities are linear along an edge, so
it has m_a/3 ((d_head - d_tail) n)^2/2 less than the lumped masses, d = v - v_hat.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import add_product, load, splat, store, subtract_product
from seastar_gym.rods.body_forces import body_added_mass
from seastar_gym.rods.star import Mesh, edge_vector, root_place, tail_node


class AddedMass(NamedTuple):
    """Mass of the fluid.

    half: m_a, two rows per node as in drag.py [kg].
    edge: m_a/3, what the differences along an edge take from that, per edge [kg]; None for lumped masses.
    """

    half: NDArray[np.float64]
    edge: NDArray[np.float64] | None


def coefficients(mesh: Mesh, density: float, C_a: float | None, consistent: bool) -> AddedMass | None:
    """m_a = rho_f C_a A_a l/2, A_a = pi r_0^2 of a disc; None for none."""
    if C_a is None:
        return None
    halves = half_edges(mesh, density, C_a)
    return AddedMass(mesh.per_half_edge(halves), halves / 3.0 if consistent else None)


def half_edges(mesh: Mesh, density: float, C_a: float) -> NDArray[np.float64]:
    """m_a of every edge [kg]."""
    return density * C_a * mesh.at_edges.added * 0.5 * mesh.l


@kernel
def freeze_added_mass(rods, work):
    """Fill work.added_mass, (xx, xy, yy) of every node [kg], from work.normals, in scenes that have it."""
    if rods.added_mass is None:
        return
    for node in range(rods.n_nodes):
        xx, xy, yy = splat(0.0), splat(0.0), splat(0.0)
        if node == 0:
            xx, xy, yy = hub_mass(rods, work, xx, xy, yy)
        else:
            xx, xy, yy = add_half_edge_mass(load(rods.added_mass.half, 2 * node), work.normals, node - 1, xx, xy, yy)
            xx, xy, yy = add_half_edge_mass(load(rods.added_mass.half, 2 * node + 1), work.normals, node, xx, xy, yy)
        store(work.added_mass, 3 * node, xx)
        store(work.added_mass, 3 * node + 1, xy)
        store(work.added_mass, 3 * node + 2, yy)


@kernel
def hub_mass(rods, work, xx, xy, yy):
    """Added mass of the hub [kg]: of half of every root edge; that of a body is its own, and its roots have theirs."""
    edges = rods.edges_per_limb
    if rods.body is None:
        for e in range(0, rods.n_edges, edges):
            xx, xy, yy = add_half_edge_mass(load(rods.added_mass.half, 2 * e + 2), work.normals, e, xx, xy, yy)
        return xx, xy, yy
    for limb in range(rods.n_limbs):
        e, place = limb * edges, root_place(rods, limb)
        mass = add_half_edge_mass(
            load(rods.added_mass.half, 2 * e + 2), work.normals, e, splat(0.0), splat(0.0), splat(0.0)
        )
        for k in range(3):
            store(work.added_mass, 3 * place + k, mass[k])
    return body_added_mass(rods, work)


@kernel
def add_half_edge_mass(m, normals, e, xx, xy, yy):
    """Add the mass m n n^T of half of edge e [kg]."""
    nx, ny = load(normals, 2 * e), load(normals, 2 * e + 1)
    mx, my = m * nx, m * ny
    return add_product(xx, mx, nx), add_product(xy, mx, ny), add_product(yy, my, ny)


@kernel
def fluid_momentum(work, node, vx, vy):
    """Momentum of the fluid that a node of velocity (vx, vy) carries along [kg m/s]."""
    m, row = work.added_mass, 3 * node
    xx, xy, yy = load(m, row), load(m, row + 1), load(m, row + 2)
    return add_product(xx * vx, xy, vy), add_product(xy * vx, yy, vy)


@kernel
def add_fluid_inertia(work, node, dx, dy, inverse_gamma, slopes):
    """Add a node's |d|^2/2 in its added mass, d = v - v_hat, to its (energy, gradient, Hessian) in q."""
    if work.added_mass is None:
        return slopes
    energy, (fx, fy), (xx, xy, yy) = slopes
    px, py = fluid_momentum(work, node, dx, dy)
    squared = inverse_gamma * inverse_gamma
    return (
        add_product(energy, 0.5, add_product(px * dx, py, dy)),
        (add_product(fx, px, inverse_gamma), add_product(fy, py, inverse_gamma)),
        (
            add_product(xx, load(work.added_mass, 3 * node), squared),
            add_product(xy, load(work.added_mass, 3 * node + 1), squared),
            add_product(yy, load(work.added_mass, 3 * node + 2), squared),
        ),
    )


@kernel
def subtract_edge_fluid_inertia(rods, work, stage, e, tail, head, slopes):
    """(E, f, K) of an edge less mu ((d_head - d_tail) n)^2/2; unchanged where no such mass is named."""
    if rods.added_mass is None or rods.added_mass.edge is None:
        return slopes
    energy, (fx, fy), (xx, xy, yy) = slopes
    mu = load(rods.added_mass.edge, e)
    nx, ny = load(work.normals, 2 * e), load(work.normals, 2 * e + 1)
    dx, dy = head.dx - tail.dx, head.dy - tail.dy
    across = add_product(dx * nx, dy, ny)
    force = mu * stage.inverse_gamma * across
    slope = mu * stage.inverse_gamma * stage.inverse_gamma
    sx, sy = slope * nx, slope * ny
    return (
        subtract_product(energy, 0.5 * mu * across, across),
        (subtract_product(fx, force, nx), subtract_product(fy, force, ny)),
        (subtract_product(xx, sx, nx), subtract_product(xy, sx, ny), subtract_product(yy, sy, ny)),
    )


@kernel
def subtract_edge_fluid_energy(rods, work, v, energy):
    """Kinetic energy of the fluid [J] less what velocities that are linear along edges take from lumped masses'."""
    if rods.added_mass is None or rods.added_mass.edge is None:
        return energy
    for e in range(rods.n_edges):
        dx, dy = edge_vector(v, tail_node(rods, e), e + 1)
        across = add_product(dx * load(work.normals, 2 * e), dy, load(work.normals, 2 * e + 1))
        energy = subtract_product(energy, 0.5 * load(rods.added_mass.edge, e) * across, across)
    return energy


@kernel
def add_fluid_energy(rods, work, v, frame, energy):
    """Add the kinetic energy of the fluid that moves along [J], at the normals of the last stage.

    frame: Velocity of the frame that it is seen from [m/s].
    """
    if rods.added_mass is None:
        return energy
    total = splat(0.0)
    for node in range(rods.n_places):
        vx, vy = load(v, 2 * node) - frame[0], load(v, 2 * node + 1) - frame[1]
        px, py = fluid_momentum(work, node, vx, vy)
        total = add_product(total, 0.5, add_product(px * vx, py, vy))
    return energy + total
