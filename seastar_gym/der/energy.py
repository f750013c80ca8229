"""Elastic and kinetic energy of a lane group, and the moments that resist its actuators."""

from seastar_gym.der.body.body import move_roots
from seastar_gym.der.body.forces import add_turning_energy
from seastar_gym.der.geometry import half_angle
from seastar_gym.der.star import edge_of
from seastar_gym.der.terms.along import natural_moment, natural_tangent, stiffening_rate
from seastar_gym.der.terms.bending import bending_energy, moment
from seastar_gym.der.terms.clamp import add_clamp_moments, clamp_energy
from seastar_gym.der.terms.fluid import fluid_velocity
from seastar_gym.der.terms.hub import set_natural_hub_angles
from seastar_gym.der.terms.inertia import kinetic_energy
from seastar_gym.der.terms.own import own_energy
from seastar_gym.der.terms.stretching import stretching_energy, tension
from seastar_gym.simd.compilation import entry_point, kernel
from seastar_gym.simd.lanes import add_product, borrow, load, splat, store, subtract_product


@kernel
def hinge_energy(rods, work, e, first, second, side, EI_kappa_bar):
    """Energy of the hinge that ends with edge e, between two edges [J]."""
    return bending_energy(rods, work, e, moment(rods, work, e, half_angle(first, second, side), EI_kappa_bar))


@kernel
def hub_hinge_energy(rods, work, q, limb, edge):
    """Energy of the hub hinge from a limb, whose root edge is given, to the next one [J]."""
    root = limb * rods.edges_per_limb
    next_root = edge_of(rods, q, (root + rods.edges_per_limb) % rods.n_edges)
    return hinge_energy(rods, work, root, edge, next_root, rods.hub.side, load(work.hub_EI_kappa_bar, limb))


@kernel
def elastic_energy(rods, work, q):
    """Stretching and bending energy (13.14) at the natural hub angles in `work`, and that of own terms [J]."""
    total = splat(0.0) if rods.clamp is None else clamp_energy(rods, work, q)
    edges = rods.edges_per_limb
    for limb in range(rods.n_limbs):
        root = limb * edges
        edge = edge_of(rods, q, root)
        hinge = hub_hinge_energy(rods, work, q, limb, edge) if rods.clamp is None else splat(0.0)
        total += stretching_energy(rods, root, tension(rods, root, edge.length)) + hinge
        for e in range(root + 1, root + edges):
            before, edge = edge, edge_of(rods, q, e)
            hinge = hinge_energy(rods, work, e, before, edge, 1.0, natural_moment(rods, work, e))
            total += stretching_energy(rods, e, tension(rods, e, edge.length)) + hinge
    if rods.own is not None:
        total = own_energy(rods, q, total)
    return total


@kernel
def add_hub_hinge_moments(rods, work, q, moments):
    """Add dU/d(delta) of the hub hinges [N m], of every limb's rotation delta.

    The natural angle of the hinge from limb j to limb j + 1 grows with the rotation of j + 1 and falls with that of j.
    """
    edges = rods.edges_per_limb
    for limb in range(rods.n_limbs):
        after = (limb + 1) % rods.n_limbs
        t = half_angle(edge_of(rods, q, limb * edges), edge_of(rods, q, after * edges), rods.hub.side)
        natural_moment = load(work.hub_EI_kappa_bar, limb)
        natural = 0.5 * load(rods.bending.dl_over_EI, limb * edges) * natural_moment
        push = moment(rods, work, limb * edges, t, natural_moment) * add_product(1.0, natural, natural)
        store(moments, limb, load(moments, limb) + push)
        store(moments, after, load(moments, after) - push)


@kernel
def add_moments_along(rods, work, actuation, q, moments):
    """Add dU/d(delta) of the hinges within limbs [N m], where actuators bend or stiffen them."""
    edges = rods.edges_per_limb
    for limb in range(rods.n_limbs):
        delta, total, edge = load(actuation.delta_psi_start, limb), splat(0.0), edge_of(rods, q, limb * edges)
        rate = stiffening_rate(rods, delta)
        for e in range(limb * edges + 1, (limb + 1) * edges):
            before, edge = edge, edge_of(rods, q, e)
            bend = moment(rods, work, e, half_angle(before, edge, 1.0), natural_moment(rods, work, e))
            natural = natural_tangent(rods.along, e, delta)
            total = subtract_product(total, load(rods.along.share, e) * bend, add_product(1.0, natural, natural))
            total = add_product(total, rate, bending_energy(rods, work, e, bend))
        store(moments, limb, load(moments, limb) + total)


@kernel
def fill_moments(rods, work, actuation, q, moments):
    """Fill rows with dU/d(delta) [N m] of every limb's rotation `actuation.delta_psi_start`: what resists its actuator.

    Leaves in `work` what is natural at these rotations.
    """
    set_natural_hub_angles(rods, work, actuation, splat(0.0))
    for limb in range(rods.n_limbs):
        store(moments, limb, 0.0)
    if rods.clamp is None:
        add_hub_hinge_moments(rods, work, q, moments)
    else:
        add_clamp_moments(rods, work, actuation, q, moments)
    if rods.along is not None:
        add_moments_along(rods, work, actuation, q, moments)


@entry_point
def energies(rods, work, actuation, q, v, elastic, kinetic):
    """Fill `elastic` (13.14) and `kinetic` [J], shape (1, N_LANES), at the rotations `actuation.delta_psi_end`."""
    rods, work, actuation = borrow(rods), borrow(work), borrow(actuation)
    q, v = borrow(q), borrow(v)
    move_roots(rods, q, v)
    set_natural_hub_angles(rods, work, actuation, splat(1.0))
    store(borrow(elastic), 0, elastic_energy(rods, work, q))
    store(borrow(kinetic), 0, energy_of_motion(rods, q, v))


@kernel
def energy_of_motion(rods, q, v):
    """Kinetic energy of nodes and body with velocities v [J]."""
    still = (splat(0.0), splat(0.0))
    return add_turning_energy(rods, q, v, still, kinetic_energy(rods, v, still))


@kernel
def fill_relative(rods, q, v, relative):
    """Fill `relative` with the velocities v [m/s] less those of the water at the nodes, and with those of a body."""
    for node in range(rods.n_nodes):
        x, y = fluid_velocity(rods, load(q, 2 * node), load(q, 2 * node + 1))
        store(relative, 2 * node, load(v, 2 * node) - x)
        store(relative, 2 * node + 1, load(v, 2 * node + 1) - y)
    if rods.body is not None:
        store(relative, 2 * rods.n_nodes, load(v, 2 * rods.n_nodes))
        move_roots(rods, q, relative)


@entry_point
def energies_in_water(rods, q, v, relative, kinetic):
    """Fill `kinetic` [J], shape (n_groups, 1, N_LANES), with the kinetic energies of lane groups relative to the water.

    relative: Rows for the velocities of a lane group, to be written over.
    """
    rods, relative = borrow(rods), borrow(relative)
    for group in range(q.shape[0]):
        place = borrow(q[group])
        fill_relative(rods, place, borrow(v[group]), relative)
        store(borrow(kinetic[group]), 0, energy_of_motion(rods, place, relative))
