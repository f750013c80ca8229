"""Elastic and kinetic energy of a lane group."""

from seastar_gym.der.geometry import half_angle
from seastar_gym.der.star import edge_of
from seastar_gym.der.terms.along import natural_moment
from seastar_gym.der.terms.bending import bending_energy, moment
from seastar_gym.der.terms.body import move_roots
from seastar_gym.der.terms.body_forces import add_turning_energy
from seastar_gym.der.terms.clamp import clamp_energy
from seastar_gym.der.terms.hub import set_natural_hub_angles
from seastar_gym.der.terms.inertia import kinetic_energy
from seastar_gym.der.terms.stretching import stretching_energy, tension
from seastar_gym.simd.compilation import entry_point, kernel
from seastar_gym.simd.lanes import borrow, load, splat, store


@kernel
def hinge_energy(rods, work, e, first, second, side, EI_kappa_bar):
    """Energy of the hinge that ends with edge e, between two edges [J]."""
    return bending_energy(rods, work, e, moment(rods, work, e, half_angle(first, second, side), EI_kappa_bar))


@kernel
def rigid_hub_energy(clamp, rods, work, q):
    """Energy of the clamps of a rigid hub [J]; 0 where limbs are joined by hinges (None)."""
    if clamp is None:
        return splat(0.0)
    return clamp_energy(rods, work, q)


@kernel
def hub_hinge_energy(clamp, rods, work, q, limb, edge):
    """Energy of the hub hinge from a limb, whose root edge is given, to the next one [J]; 0 with a rigid hub."""
    if clamp is not None:
        return splat(0.0)
    edges = rods.nodes_per_limb - 1
    root = limb * edges
    next_root = edge_of(rods, q, (root + edges) % (rods.n_limbs * edges))
    return hinge_energy(rods, work, root, edge, next_root, rods.hub.side, load(work.hub_EI_kappa_bar, limb))


@kernel
def elastic_energy(rods, work, q):
    """Stretching and bending energy (13.14) at the natural hub angles in `work` [J]."""
    total = rigid_hub_energy(rods.clamp, rods, work, q)
    edges = rods.nodes_per_limb - 1
    for limb in range(rods.n_limbs):
        root = limb * edges
        edge = edge_of(rods, q, root)
        hinge = hub_hinge_energy(rods.clamp, rods, work, q, limb, edge)
        total += stretching_energy(rods, root, tension(rods, root, edge.length)) + hinge
        for e in range(root + 1, root + edges):
            before, edge = edge, edge_of(rods, q, e)
            hinge = hinge_energy(rods, work, e, before, edge, 1.0, natural_moment(rods.along, rods, work, e))
            total += stretching_energy(rods, e, tension(rods, e, edge.length)) + hinge
    return total


@entry_point
def energies(rods, work, actuation, q, v, elastic, kinetic):
    """Fill `elastic` (13.14) and `kinetic` [J], shape (1, N_LANES), at the rotations `actuation.delta_psi_end`."""
    rods, work, actuation = borrow(rods), borrow(work), borrow(actuation)
    q, v = borrow(q), borrow(v)
    move_roots(rods.body, rods, q, v)
    set_natural_hub_angles(rods, work, actuation, splat(1.0))
    store(borrow(elastic), 0, elastic_energy(rods, work, q))
    still = (splat(0.0), splat(0.0))
    total = kinetic_energy(rods, v, still)
    store(borrow(kinetic), 0, add_turning_energy(rods.body, rods, q, v, still, total))
