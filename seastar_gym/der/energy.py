"""Elastic and kinetic energy of a lane group."""

from seastar_gym.der.bending import bending_energy, moment
from seastar_gym.der.compilation import entry_point, kernel
from seastar_gym.der.geometry import edge_geometry, half_angle
from seastar_gym.der.lanes import borrow, load, splat, store
from seastar_gym.der.rods import n_nodes
from seastar_gym.der.stages import set_natural_hub_angles
from seastar_gym.der.stretching import stretching_energy, tension


@kernel
def tail_node(rods, e):
    """The node where edge e starts: the hub for a root edge."""
    return 0 if e % (rods.nodes_per_limb - 1) == 0 else e


@kernel
def hinge_energy(rods, work, q, e):
    """Energy of the hinge that ends with edge e [J]."""
    edges = rods.nodes_per_limb - 1
    if e % edges == 0:
        a, b = e, (e + edges) % (rods.n_limbs * edges)
        side, EI_kappa_bar = rods.hub_side, load(work.hub_EI_kappa_bar, e // edges)
    else:
        a, b = e - 1, e
        side, EI_kappa_bar = 1.0, load(rods.EI_kappa_bar, e)
    t = half_angle(edge_geometry(q, tail_node(rods, a), a + 1), edge_geometry(q, tail_node(rods, b), b + 1), side)
    return bending_energy(rods, e, moment(rods, e, t, EI_kappa_bar))


@entry_point
def energies(rods, work, actuation, q, v, elastic, kinetic):
    """Fill `elastic` (13.14) and `kinetic` [J], shape (1, N_LANES), at the rotations `actuation.delta_psi_end`."""
    rods, work, actuation = borrow(rods), borrow(work), borrow(actuation)
    q, v = borrow(q), borrow(v)
    set_natural_hub_angles(rods, work, actuation, splat(1.0))
    total = splat(0.0)
    for e in range(rods.n_limbs * (rods.nodes_per_limb - 1)):
        length = edge_geometry(q, tail_node(rods, e), e + 1)[2]
        total += stretching_energy(rods, e, tension(rods, e, length)) + hinge_energy(rods, work, q, e)
    store(borrow(elastic), 0, total)
    total = splat(0.0)
    for node in range(n_nodes(rods)):
        vx, vy = load(v, 2 * node), load(v, 2 * node + 1)
        total += 0.5 * load(rods.mass, node) * (vx * vx + vy * vy)
    store(borrow(kinetic), 0, total)
