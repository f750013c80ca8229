"""Scales of a robot that decide what Newton's method, the guard and the balance of momentum look at."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seastar_gym.der.mesh import Mesh, mean
from seastar_gym.der.stepping.skip_last import CURVATURE
from seastar_gym.der.terms.drag import drag_per_length
from seastar_gym.der.terms.stretching import Stretching

SLENDER = 5000.0  # square of an edge's length over its radius: slenderer edges do not curve the potential more
PREDICTABLE_STRAIN = 1e-3  # over EA times the length of all limbs: more energy strains or moves a robot violently

MOST_CURVED = 10.0  # times CURVATURE: no Newton step is predictable where drag curves the potential more


class Scales(NamedTuple):
    """One row each, but for `held`.

    shortest_edge: Smallest natural length of an edge [m].
    curvature_rate: How fast the quadratic length shrinks with the step [1/s^2], see skip_last.py.
    predictable: Potential [J] up to which Newton steps are predictable, see skip_last.py; none is where drag on slender
        edges curves the potential more than that allows for.
    damped: Potential [J] up to which drag takes more energy than an unregularised step may create, see guard.py; zero
        without drag.
    stiffness_ratio: How much stiffer edges are than inertia, the more the longer the step [1/s^2], see momentum.py.
    free_mass: Of the nodes that are not held [kg].
    held: Whether nodes are held, so that no frame but the laboratory's will do.
    """

    shortest_edge: np.ndarray
    curvature_rate: np.ndarray
    predictable: np.ndarray
    damped: np.ndarray
    stiffness_ratio: np.ndarray
    free_mass: np.ndarray
    held: bool


def coefficients(
    mesh: Mesh,
    stretching: Stretching,
    density: float,
    fluid_density: float,
    C_d: float,
    mass: np.ndarray,
    held_nodes: Sequence[int],
) -> Scales:
    """Scales of a robot in a fluid (density or drag coefficient zero: vacuum), from its shortest, thinnest and stiffest
    edges, and its masses per node [kg].
    """
    shortest, thinnest = float(mesh.root_edges.min()), float(mesh.at_nodes.thickness.min())
    slenderness = min(1.0, (shortest / thinnest) ** 2 / SLENDER)
    rate = float(mesh.modulus_at_nodes.max()) / (density * shortest**2) * slenderness
    length = mean(mesh.limb_lengths)
    energy = PREDICTABLE_STRAIN * mean(stretching.EA) * mesh.n_limbs * length
    area = mesh.per_node(mesh.at_nodes.inert)
    broadside = mean(mesh.per_node(drag_per_length(fluid_density, C_d, mesh.at_nodes.width)))
    drag_curvature = broadside / (density * float(area.min())) * float(mesh.dl.max())
    stiffness_over_mass = float((stretching.EA_over_l / (density * area * mesh.dl)[1:]).max())
    edges = mesh.nodes_per_limb - 1
    return Scales(
        shortest_edge=np.array([shortest]),
        curvature_rate=np.array([rate]),
        predictable=np.array([energy if drag_curvature <= MOST_CURVED * CURVATURE else -np.inf]),
        damped=np.array([energy * min(1.0, broadside * length / (density * mean(area)))]),
        stiffness_ratio=np.array([stiffness_over_mass * edges**2 if broadside > 0.0 else np.inf]),
        free_mass=np.array([np.delete(mass, held_nodes).sum()]),
        held=bool(held_nodes),
    )


def of_unknown_forces(scales: Scales) -> Scales:
    """Scales where forces act of which no study measured how they curve the potential or drive the robot.

    No Newton step is predictable, the guard looks at all steps of implicit Euler, and energies are judged in the
    laboratory, where an energy of places stands still.
    """
    nothing = np.array([-np.inf])
    return scales._replace(predictable=nothing, damped=nothing, held=True)


class Limits(NamedTuple):
    """Tolerances and bounds of the solution of a stroke, that a scene names.

    tolerance: Largest displacement of a node in the last Newton update [m], one row.
    max_iterations: Newton steps of a stage before its time step is halved.
    most_iterations: Newton steps of a stroke before the robot has failed.
    adaptive: Whether time steps are adapted to their error.
    error_rate: Largest error per time [m/s], one row.
    """

    tolerance: np.ndarray
    max_iterations: int
    most_iterations: int
    adaptive: bool
    error_rate: np.ndarray
