"""The seastar of Fig. 13.4a, limbs around a hub, and its coefficients as rods; those of the fluid are in fluid.py."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.current import Current
from seastar_gym.der.rods import Rods
from seastar_gym.morphology import fluid
from seastar_gym.morphology.contact import contact
from seastar_gym.morphology.limb import LimbShape, along
from seastar_gym.morphology.mesh import Mesh, edges_along, make_mesh, mean, nodes_along

Floats = NDArray[np.float64]

HELD = 1e15
"""A held node has this many times its mass: it moves by about 1e-13 m in a stroke of the chapter's robot, which the
simulator takes back at its end, and the kernels need not know of it. With more, rounding would spoil the potential."""


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
    touching: Sequence[tuple[int, int]] | None = None,
    contact_modulus: float | None = None,
    contact_angle: float = 0.0,
) -> Rods:
    """Coefficients of the seastar in a fluid (density or drag coefficient zero: vacuum); SI units.

    Stretching takes a limb's profile in the middle of its edges, everything else at its nodes. The hub has half of
    every root edge, with the mean of the profiles there.

    held_nodes: Nodes that stay where they are. loads: Dead loads (node, F_x, F_y) [N].
    touching: (right, left) limbs that may touch, None without contact. contact_modulus, contact_angle: See
    seastar_gym/contact.py.
    """
    mesh = make_mesh(limbs, nodes_per_limb)
    n_limbs, l = len(limbs), mesh.l  # noqa: E741
    modulus = [E for limb in limbs for E in along(limb.youngs_modulus, edges_along(nodes_per_limb))]
    EA = np.array([E * (np.pi * r**2) for E, r in zip(modulus, mesh.radius_at_edges, strict=True)])
    EI_over_dl, dl_over_EI, EI_kappa_bar = bending_coefficients(limbs, mesh)
    area = mesh.per_node(lambda r: np.pi * r**2)
    mass = density * area * mesh.dl
    mass[list(held_nodes)] *= HELD
    forces = np.zeros((len(mass), 2))
    for node, *force in loads:
        forces[node] += force

    C_d, C_t, C_a = drag_coefficient, tangential_drag_coefficient, added_mass_coefficient
    broadside = mesh.per_node(lambda r: fluid.drag_per_length(fluid_density, C_d, r))
    length = mean([limb.length for limb in limbs])
    calm = CALM_STRAIN_ENERGY * mean(EA) * n_limbs * length
    shortest, thinnest = float(mesh.root_edges.min()), min(map(min, mesh.radius_at_nodes))
    stiffest = max(max(along(limb.youngs_modulus, nodes_along(nodes_per_limb))) for limb in limbs)
    slenderness = min(1.0, (shortest / thinnest) ** 2 / 5000.0)
    dragged = mean(broadside) > 0.0
    stiffness_over_mass = float((EA / l / (density * area * mesh.dl)[1:]).max())
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
        drag=fluid.drag(mesh, fluid_density, C_d if C_t is None else C_t),
        cross_drag=None if C_t is None else fluid.cross_drag(mesh, fluid_density, C_d, C_t),
        added_mass=None if C_a is None else fluid.added_mass(mesh, fluid_density, C_a),
        relaxation_time=None if relaxation_time is None else np.array([relaxation_time]),
        current=current,
        load=forces.reshape(-1) if loads else None,
        contact=None if touching is None else contact(limbs, mesh, touching, contact_modulus, contact_angle),
        shortest_edge=np.array([shortest]),
        curvature_rate=np.array([stiffest / (density * shortest**2) * slenderness]),
        calm=np.array([calm]),
        damped=np.array([calm * min(1.0, mean(broadside) * length / (density * mean(area)))]),
        unsettled_rate=np.array([stiffness_over_mass * (nodes_per_limb - 1) ** 2 if dragged else np.inf]),
        held=bool(held_nodes),
    )


def bending_coefficients(limbs: Sequence[LimbShape], mesh: Mesh) -> tuple[Floats, Floats, Floats]:
    """(EI/dl, dl/EI, EI kappa_bar) of all hinges; see der/rods.py."""
    n_edges = len(mesh.l) // len(limbs)
    EI = np.array(
        [
            E * np.pi * r**4 / 4.0
            for limb, radii in zip(limbs, mesh.radius_at_nodes, strict=True)
            for E, r in zip(along(limb.youngs_modulus, nodes_along(n_edges + 1))[:-1], radii[:-1], strict=True)
        ]
    )
    EI_over_dl, dl_over_EI = EI / mesh.l, mesh.l / EI
    natural_turn = np.repeat([turn_per_hinge(limb, n_edges + 1) for limb in limbs], n_edges)
    EI_kappa_bar = 2.0 * EI_over_dl * np.tan(0.5 * natural_turn)
    roots = n_edges * np.arange(len(limbs))
    EI_kappa_bar[roots] = 0.0
    EI_over_dl[roots], dl_over_EI[roots] = hub_stiffnesses(EI_over_dl[roots], dl_over_EI[roots])
    return EI_over_dl, dl_over_EI, EI_kappa_bar


def hub_stiffnesses(EI_over_dl: Floats, dl_over_EI: Floats) -> tuple[Floats, Floats]:
    """(EI/dl, dl/EI) of the hub hinges, from those at the limbs' roots: half of each root edge, one after the other."""
    next_stiffness, next_compliance = np.roll(EI_over_dl, -1), np.roll(dl_over_EI, -1)
    stiffness = EI_over_dl + (next_stiffness - EI_over_dl) * (EI_over_dl / (EI_over_dl + next_stiffness))
    compliance = dl_over_EI + 0.5 * (next_compliance - dl_over_EI)
    exists = np.arange(len(EI_over_dl)) < n_hub_hinges(len(EI_over_dl))
    return np.where(exists, stiffness, 0.0), np.where(exists, compliance, 0.0)
