"""The seastar of Fig. 13.4a: straight limbs of equal length around a hub, and its coefficients as rods."""

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.current import Current
from seastar_gym.der.rods import Rods

Floats = NDArray[np.float64]

HELD = 1e15
"""A held node has this many times its mass: it moves by less than rounding, and the kernels need not know of it."""


CALM_STRAIN_ENERGY = 1e-3
"""Of EA times the length of all limbs: more energy than that strains or moves a robot violently."""


def rest_positions(n_limbs: int, nodes_per_limb: int, limb_length: float) -> Floats:
    """Nodes of the undeformed robot [m], shape (n_nodes, 2): hub at the origin, limb 1 along +x, anti-clockwise."""
    angles = 2.0 * np.pi * np.arange(n_limbs) / n_limbs
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    distances = limb_length * np.arange(1, nodes_per_limb) / (nodes_per_limb - 1)
    limbs = distances[None, :, None] * directions[:, None, :]
    return np.concatenate([np.zeros((1, 2)), limbs.reshape(-1, 2)])


def voronoi_lengths(n_limbs: int, nodes_per_limb: int, limb_length: float) -> Floats:
    """Length of rod that belongs to every node [m], shape (n_nodes,): half of each edge that meets there.

    The hub has n_limbs half edges.
    """
    edge_length = limb_length / (nodes_per_limb - 1)
    limb = np.full(nodes_per_limb - 1, edge_length)
    limb[-1] = 0.5 * edge_length
    return np.concatenate([[0.5 * n_limbs * edge_length], np.tile(limb, n_limbs)])


def make_rods(
    n_limbs: int,
    nodes_per_limb: int,
    limb_length: float,
    rod_radius: float,
    youngs_modulus: float,
    density: float,
    hub_hinge: str,
    fluid_density: float,
    drag_coefficient: float,
    tangential_drag_coefficient: float | None = None,
    current: Current | None = None,
    held_nodes: tuple[int, ...] = (),
    loads: tuple[tuple[int, float, float], ...] = (),
) -> Rods:
    """Coefficients of the seastar in a fluid (density or drag coefficient zero: vacuum); SI units.

    held_nodes: Nodes that stay where they are. loads: Dead loads (node, F_x, F_y) [N].
    """
    n_edges = n_limbs * (nodes_per_limb - 1)
    edge_length = limb_length / (nodes_per_limb - 1)
    area = np.pi * rod_radius**2
    EA = youngs_modulus * area
    EI = youngs_modulus * np.pi * rod_radius**4 / 4.0
    dl = voronoi_lengths(n_limbs, nodes_per_limb, limb_length)
    drag_per_length = 0.5 * fluid_density * drag_coefficient * 2.0 * rod_radius
    friction_per_length, cross_drag = drag_per_length, None
    if tangential_drag_coefficient is not None:
        friction_per_length = 0.5 * fluid_density * tangential_drag_coefficient * 2.0 * rod_radius
        cross_drag = np.full(n_edges, (drag_per_length - friction_per_length) * 0.5 * edge_length)
    calm = CALM_STRAIN_ENERGY * EA * n_limbs * limb_length
    turning = hub_hinge == "turning"
    mass = density * area * dl
    mass[list(held_nodes)] *= HELD
    forces = np.zeros((len(dl), 2))
    for node, *force in loads:
        forces[node] += force

    def per_edge(value: float) -> Floats:
        return np.full(n_edges, value)

    return Rods(
        n_limbs=n_limbs,
        nodes_per_limb=nodes_per_limb,
        EA=per_edge(EA),
        EA_over_l=per_edge(EA / edge_length),
        l_over_EA=per_edge(edge_length / EA),
        EI_over_dl=per_edge(EI / edge_length),
        dl_over_EI=per_edge(edge_length / EI),
        EI_kappa_bar=per_edge(0.0),
        hub_side=-1.0 if turning else 1.0,
        hub_angle=2.0 * np.pi / n_limbs - (np.pi if turning else 0.0),
        mass=mass,
        drag=friction_per_length * dl,
        cross_drag=cross_drag,
        current=current,
        load=forces.reshape(-1) if loads else None,
        shortest_edge=edge_length,
        curvature_rate=youngs_modulus / (density * edge_length**2) * min(1.0, (edge_length / rod_radius) ** 2 / 5000.0),
        calm=calm,
        damped=calm * min(1.0, drag_per_length * limb_length / (density * area)),
    )
