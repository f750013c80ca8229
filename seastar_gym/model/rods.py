"""From a scene to the coefficients of its rods, one robot at a time; those of the fluid's terms are in fluid.py."""

import math
from collections.abc import Sequence
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.rods import Limits, Rods
from seastar_gym.model import fluid
from seastar_gym.model.contact import contact
from seastar_gym.model.currents import current_rows
from seastar_gym.model.forces import constant_forces
from seastar_gym.model.mesh import Mesh, edges_along, make_mesh, mean, nodes_along
from seastar_gym.scene.limb import LimbShape, along
from seastar_gym.scene.numerics import ADAPTATION, MOST_ITERATIONS, MOST_ITERATIONS_PER_STEP
from seastar_gym.scene.per_robot import chosen, of_robot
from seastar_gym.scene.scene import Scene
from seastar_gym.scene.shape import n_hub_hinges, natural_hub_angle, turn_per_hinge

Floats = NDArray[np.float64]

HELD = 1e15
"""A held node has this many times its mass: it moves by about 1e-13 m in a stroke of the chapter's robot, which the
simulator takes back at its end, and the kernels need not know of it. With more, rounding would spoil the potential."""


CALM_STRAIN_ENERGY = 1e-3
"""Energy over EA times the length of all limbs: more than this strains or moves a robot violently."""


def make_limits(scene: Scene, index: int = 0) -> Limits:
    """Tolerances of a robot's solution for the kernels.

    The error that a step may make per second is `error_rate` limb lengths per stroke; how it follows from the
    tolerance on the path was measured, see ADAPTATION.
    """
    numerics, length = scene.numerics, of_robot(scene.robot.limb_length, index)
    speed, tolerance = length / scene.actuator.period, numerics.path_tolerance
    error_rate = 0.0 if tolerance is None else speed * (tolerance / ADAPTATION[0]) ** ADAPTATION[1]
    n_steps = math.ceil(scene.actuator.period / numerics.step)
    return Limits(
        tolerance=np.array([numerics.newton_tolerance * length]),
        max_iterations=numerics.max_iterations,
        most_iterations=MOST_ITERATIONS + MOST_ITERATIONS_PER_STEP * n_steps,
        adaptive=tolerance is not None,
        error_rate=np.array([error_rate]),
    )


def make_rods(scene: Scene, index: int = 0) -> Rods:
    """Coefficients of robot `index` of a scene for the kernels, see der/rods.py.

    Stretching takes a limb's profile in the middle of its edges, everything else at its nodes. The hub has half of
    every root edge, with the mean of the profiles there.
    """
    robot = chosen(scene.robot, itemgetter(index))
    water = None if scene.fluid is None else chosen(scene.fluid, itemgetter(index))
    touch = None if scene.contact is None else chosen(scene.contact, itemgetter(index))
    limbs, nodes_per_limb, density = robot.limb_shapes(), robot.nodes_per_limb, robot.density
    mesh = make_mesh(limbs, nodes_per_limb)
    n_limbs, l = len(limbs), mesh.l  # noqa: E741
    modulus = [E for limb in limbs for E in along(limb.youngs_modulus, edges_along(nodes_per_limb))]
    EA = np.array([E * (np.pi * r**2) for E, r in zip(modulus, mesh.radius_at_edges, strict=True)])
    EI_over_dl, dl_over_EI, EI_kappa_bar = bending_coefficients(limbs, mesh)
    area = mesh.per_node(lambda r: np.pi * r**2)
    mass = density * area * mesh.dl
    mass[list(scene.held_nodes)] *= HELD

    fluid_density, C_d = (0.0, 0.0) if water is None else (water.density, water.drag_coefficient)
    C_t, C_a = (None, None) if water is None else (water.tangential_drag_coefficient, water.added_mass_coefficient)
    current = None if water is None else water.current
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
        hub_side=-1.0 if robot.hub_hinge == "turning" else 1.0,
        hub_angle=np.array([natural_hub_angle(limb.gap, robot.hub_hinge) for limb in limbs]),
        mass=mass,
        drag=fluid.drag(mesh, fluid_density, C_d if C_t is None else C_t),
        cross_drag=None if C_t is None else fluid.cross_drag(mesh, fluid_density, C_d, C_t),
        added_mass=None if C_a is None else fluid.added_mass(mesh, fluid_density, C_a),
        relaxation_time=None if robot.relaxation_time is None else np.array([robot.relaxation_time]),
        current=None if current is None else current_rows(current),
        load=constant_forces(scene, mesh, density, fluid_density),
        contact=None if touch is None else contact(limbs, mesh, scene.robot.limbs_that_may_touch(), touch),
        shortest_edge=np.array([shortest]),
        curvature_rate=np.array([stiffest / (density * shortest**2) * slenderness]),
        calm=np.array([calm]),
        damped=np.array([calm * min(1.0, mean(broadside) * length / (density * mean(area)))]),
        unsettled_rate=np.array([stiffness_over_mass * (nodes_per_limb - 1) ** 2 if dragged else np.inf]),
        held=bool(scene.held_nodes),
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
