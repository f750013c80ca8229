"""The seastar of Fig. 13.4a, limbs around a hub, and its coefficients as rods."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.der.current import Current
from seastar_gym.der.rods import Rods
from seastar_gym.morphology.limb import LimbShape, along

Floats = NDArray[np.float64]

HELD = 1e15
"""A held node has this many times its mass: it moves by less than rounding, and the kernels need not know of it."""


CALM_STRAIN_ENERGY = 1e-3
"""Of EA times the length of all limbs: more energy than that strains or moves a robot violently."""


def rest_positions(limbs: Sequence[LimbShape], nodes_per_limb: int) -> Floats:
    """Nodes of the undeformed robot [m], shape (n_nodes, 2): hub at the origin, limb after limb.

    Edges of a limb have equal lengths and turn by its natural curvature times that length, so its nodes lie on an arc.
    """
    i = np.arange(1, nodes_per_limb)
    nodes = [np.zeros((1, 2))]
    for limb in limbs:
        half_turn = 0.5 * turn_per_hinge(limb, nodes_per_limb)
        # The sum of i unit vectors, each turned from the last by twice half_turn.
        chord = np.sin(i * half_turn) / (i * np.sin(half_turn)) if half_turn else 1.0
        distance = limb.length * i / (nodes_per_limb - 1) * chord
        angle = limb.direction + (i - 1) * half_turn
        nodes.append(np.stack([distance * np.cos(angle), distance * np.sin(angle)], axis=1))
    return np.concatenate(nodes)


def turn_per_hinge(limb: LimbShape, nodes_per_limb: int) -> float:
    """Natural angle of the hinges within a limb [rad]."""
    return limb.natural_curvature * limb.length / (nodes_per_limb - 1)


def natural_hub_angle(gap: float, hub_hinge: str) -> float:
    """Angle of an unactuated hub hinge over a gap [rad], as its hinge measures it: from -pi to pi."""
    if hub_hinge == "turning":
        return gap - np.pi
    return gap if gap <= np.pi else gap - 2.0 * np.pi


def n_hub_hinges(n_limbs: int) -> int:
    """One per gap; two limbs have one, not the same one twice, so that straight ones make a plain rod."""
    return n_limbs if n_limbs > 2 else n_limbs - 1


def mean(values: ArrayLike, weights: Floats | None = None) -> float:
    """Mean that is exact where all values are equal."""
    values = np.asarray(values, dtype=float)
    return float(values[0] + np.average(values - values[0], weights=weights))


def halves_at_nodes(halves: Floats, n_limbs: int) -> Floats:
    """Of numbers for half of each edge, those of the inner and the outer edge of every node in turn, (2 n_nodes,).

    Zero for the outer edge of tips, and for the hub: its halves are the inner ones of the root nodes.
    """
    inner = halves.reshape(n_limbs, -1)
    outer = np.zeros_like(inner)
    outer[:, :-1] = inner[:, 1:]
    return np.concatenate([np.zeros(2), np.stack([inner, outer], axis=2).ravel()])


def make_rods(
    limbs: Sequence[LimbShape],
    nodes_per_limb: int,
    density: float,
    hub_hinge: str,
    fluid_density: float,
    drag_coefficient: float,
    tangential_drag_coefficient: float | None = None,
    added_mass_coefficient: float | None = None,
    relaxation_time: float | None = None,
    current: Current | None = None,
    held_nodes: tuple[int, ...] = (),
    loads: tuple[tuple[int, float, float], ...] = (),
) -> Rods:
    """Coefficients of the seastar in a fluid (density or drag coefficient zero: vacuum); SI units.

    Stretching takes a limb's profile in the middle of its edges, everything else at its nodes. The hub has half of
    every root edge, with the mean of the profiles there.

    held_nodes: Nodes that stay where they are. loads: Dead loads (node, F_x, F_y) [N].
    """
    n_limbs, n_edges = len(limbs), nodes_per_limb - 1
    at_edges, at_nodes = (np.arange(n_edges) + 0.5) / n_edges, np.arange(n_edges + 1) / n_edges
    root_edges = np.array([limb.length / n_edges for limb in limbs])
    l = np.repeat(root_edges, n_edges)  # noqa: E741
    dl_limb = np.where(at_nodes[1:] < 1.0, 1.0, 0.5)
    dl = np.concatenate([[0.5 * n_limbs * mean(root_edges)], l * np.tile(dl_limb, n_limbs)])
    radius = [along(limb.radius, at_nodes) for limb in limbs]
    modulus = [along(limb.youngs_modulus, at_nodes) for limb in limbs]
    EA = np.array(
        [
            E * (np.pi * r**2)
            for limb in limbs
            for E, r in zip(along(limb.youngs_modulus, at_edges), along(limb.radius, at_edges), strict=True)
        ]
    )
    EI = np.array(
        [
            E * np.pi * r**4 / 4.0
            for Es, rs in zip(modulus, radius, strict=True)
            for E, r in zip(Es[:-1], rs[:-1], strict=True)
        ]
    )
    EI_over_dl, dl_over_EI = EI / l, l / EI
    natural_turn = np.repeat([turn_per_hinge(limb, nodes_per_limb) for limb in limbs], n_edges)
    EI_kappa_bar = 2.0 * EI_over_dl * np.tan(0.5 * natural_turn)
    roots = n_edges * np.arange(n_limbs)
    EI_kappa_bar[roots] = 0.0
    EI_over_dl[roots], dl_over_EI[roots] = hub_stiffnesses(EI_over_dl[roots], dl_over_EI[roots])

    def per_node(values: list[list[float]]) -> Floats:
        """Values at the nodes of every limb, hub first, as one per node."""
        hub = mean([of_limb[0] for of_limb in values], root_edges)
        return np.array([hub, *(value for of_limb in values for value in of_limb[1:])])

    area = per_node([[np.pi * r**2 for r in rs] for rs in radius])

    def drag_of(coefficient: float, r: float) -> float:
        """Per length and squared speed, of a limb of radius r (13.8) [kg/m^2]."""
        return 0.5 * fluid_density * coefficient * 2.0 * r

    drag_per_length = per_node([[drag_of(drag_coefficient, r) for r in rs] for rs in radius])
    friction_per_length, cross_drag = drag_per_length, None
    if tangential_drag_coefficient is not None:
        C_t = tangential_drag_coefficient
        friction_per_length = per_node([[drag_of(C_t, r) for r in rs] for rs in radius])
        cross = [drag_of(drag_coefficient, r) - drag_of(C_t, r) for limb in limbs for r in along(limb.radius, at_edges)]
        cross_drag = halves_at_nodes(np.array(cross) * 0.5 * l, n_limbs)
    added_mass = None
    if added_mass_coefficient is not None:
        areas = [np.pi * r**2 for limb in limbs for r in along(limb.radius, at_edges)]
        masses = fluid_density * added_mass_coefficient * np.array(areas) * 0.5 * l
        added_mass = halves_at_nodes(masses, n_limbs)
    mass = density * area * dl
    mass[list(held_nodes)] *= HELD
    forces = np.zeros((len(dl), 2))
    for node, *force in loads:
        forces[node] += force
    length = mean([limb.length for limb in limbs])
    calm = CALM_STRAIN_ENERGY * mean(EA) * n_limbs * length
    shortest, thinnest = float(root_edges.min()), min(map(min, radius))
    slenderness = min(1.0, (shortest / thinnest) ** 2 / 5000.0)
    return Rods(
        n_limbs=n_limbs,
        nodes_per_limb=nodes_per_limb,
        EA=EA,
        EA_over_l=EA / l,
        l_over_EA=l / EA,
        EI_over_dl=EI_over_dl,
        dl_over_EI=dl_over_EI,
        EI_kappa_bar=EI_kappa_bar,
        hub_side=-1.0 if hub_hinge == "turning" else 1.0,
        hub_angle=np.array([natural_hub_angle(limb.gap, hub_hinge) for limb in limbs]),
        mass=mass,
        drag=friction_per_length * dl,
        cross_drag=cross_drag,
        added_mass=added_mass,
        relaxation_time=None if relaxation_time is None else np.array([relaxation_time]),
        current=current,
        load=forces.reshape(-1) if loads else None,
        shortest_edge=np.array([shortest]),
        curvature_rate=np.array([max(map(max, modulus)) / (density * shortest**2) * slenderness]),
        calm=np.array([calm]),
        damped=np.array([calm * min(1.0, mean(drag_per_length) * length / (density * mean(area)))]),
    )


def hub_stiffnesses(EI_over_dl: Floats, dl_over_EI: Floats) -> tuple[Floats, Floats]:
    """(EI/dl, dl/EI) of the hub hinges, from those at the limbs' roots: half of each root edge, one after the other."""
    next_stiffness, next_compliance = np.roll(EI_over_dl, -1), np.roll(dl_over_EI, -1)
    stiffness = EI_over_dl + (next_stiffness - EI_over_dl) * (EI_over_dl / (EI_over_dl + next_stiffness))
    compliance = dl_over_EI + 0.5 * (next_compliance - dl_over_EI)
    exists = np.arange(len(EI_over_dl)) < n_hub_hinges(len(EI_over_dl))
    return np.where(exists, stiffness, 0.0), np.where(exists, compliance, 0.0)
