"""Scales of a robot that decide which steps the guard and the balance of momentum look at."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seastar_gym.der.mesh import Mesh, mean
from seastar_gym.der.stepping.foresight import Foresight
from seastar_gym.der.terms.drag import drag_per_length
from seastar_gym.der.terms.stretching import Stretching


class Scales(NamedTuple):
    """One row each, but for `held`.

    damped: Potential [J] up to which drag takes more energy than an unregularised step may create, see guard.py; zero
        without drag.
    unsettled_rate: How much stiffer edges are than inertia, the more the longer the step [1/s^2], see momentum.py.
    free_mass: Of the nodes that are not held [kg].
    held: Whether nodes are held, so that no frame but the laboratory's will do.
    """

    damped: np.ndarray
    unsettled_rate: np.ndarray
    free_mass: np.ndarray
    held: bool


def coefficients(
    mesh: Mesh,
    stretching: Stretching,
    foresight: Foresight,
    density: float,
    fluid_density: float,
    C_d: float,
    mass: np.ndarray,
    held_nodes: Sequence[int],
) -> Scales:
    """Scales of a robot in a fluid (density or drag coefficient zero: vacuum), from its masses per node [kg], too."""
    area = mesh.per_node(lambda r: np.pi * r**2)
    broadside = mean(mesh.per_node(lambda r: drag_per_length(fluid_density, C_d, r)))
    length, energy = mean(mesh.limb_lengths), float(foresight.energy[0])
    stiffness_over_mass = float((stretching.EA_over_l / (density * area * mesh.dl)[1:]).max())
    edges = mesh.nodes_per_limb - 1
    return Scales(
        damped=np.array([energy * min(1.0, broadside * length / (density * mean(area)))]),
        unsettled_rate=np.array([stiffness_over_mass * edges**2 if broadside > 0.0 else np.inf]),
        free_mass=np.array([np.delete(mass, held_nodes).sum()]),
        held=bool(held_nodes),
    )
