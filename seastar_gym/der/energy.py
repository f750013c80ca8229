"""Elastic and kinetic energy of a lane group."""

from seastar_gym.der.geometry import edge_geometry, half_angle
from seastar_gym.der.rods import n_nodes, tail_node
from seastar_gym.der.terms.actuation import set_natural_hub_angles
from seastar_gym.der.terms.bending import bending_energy, moment
from seastar_gym.der.terms.stretching import stretching_energy, tension
from seastar_gym.simd.compilation import entry_point, kernel
from seastar_gym.simd.lanes import add_product, borrow, load, splat, store


@kernel
def hinge_edges(rods, e):
    """(a, b, side): the edges of the hinge that ends with edge e, and how its angle is measured, see geometry.py."""
    edges = rods.nodes_per_limb - 1
    if e % edges == 0:
        return e, (e + edges) % (rods.n_limbs * edges), rods.hub_side
    return e - 1, e, 1.0


@kernel
def edge_of(rods, q, e):
    """Geometry of edge e."""
    return edge_geometry(q, tail_node(rods, e), e + 1)


@kernel
def hinge_energy(rods, e, first, second, side, EI_kappa_bar):
    """Energy of the hinge that ends with edge e, between two edges [J]."""
    return bending_energy(rods, e, moment(rods, e, half_angle(first, second, side), EI_kappa_bar))


@kernel
def elastic_energy(rods, work, q):
    """Stretching and bending energy (13.14) at the natural hub angles in `work` [J]."""
    total = splat(0.0)
    edges = rods.nodes_per_limb - 1
    for limb in range(rods.n_limbs):
        root = limb * edges
        edge = edge_of(rods, q, root)
        next_root = edge_of(rods, q, (root + edges) % (rods.n_limbs * edges))
        EI_kappa_bar = load(work.hub_EI_kappa_bar, limb)
        hinge = hinge_energy(rods, root, edge, next_root, rods.hub_side, EI_kappa_bar)
        total += stretching_energy(rods, root, tension(rods, root, edge[2])) + hinge
        for e in range(root + 1, root + edges):
            before, edge = edge, edge_of(rods, q, e)
            hinge = hinge_energy(rods, e, before, edge, 1.0, load(rods.EI_kappa_bar, e))
            total += stretching_energy(rods, e, tension(rods, e, edge[2])) + hinge
    return total


@kernel
def kinetic_energy(rods, v, frame):
    """Kinetic energy [J] as seen from a frame that moves with the velocity `frame` [m/s]."""
    total = splat(0.0)
    for node in range(n_nodes(rods)):
        vx, vy = load(v, 2 * node) - frame[0], load(v, 2 * node + 1) - frame[1]
        total = add_product(total, 0.5 * load(rods.mass, node), vx * vx + vy * vy)
    return total


@entry_point
def energies(rods, work, actuation, q, v, elastic, kinetic):
    """Fill `elastic` (13.14) and `kinetic` [J], shape (1, N_LANES), at the rotations `actuation.delta_psi_end`."""
    rods, work, actuation = borrow(rods), borrow(work), borrow(actuation)
    set_natural_hub_angles(rods, work, actuation, splat(1.0))
    store(borrow(elastic), 0, elastic_energy(rods, work, borrow(q)))
    store(borrow(kinetic), 0, kinetic_energy(rods, borrow(v), (splat(0.0), splat(0.0))))
