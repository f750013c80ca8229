"""Stretching (13.2): E_s = 1/2 EA (|e|/l - 1)^2 l."""

from typing import NamedTuple

import numpy as np

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import add_product, load
from seastar_gym.rods.star import Mesh


class Stretching(NamedTuple):
    """Coefficients per edge: EA [N], the same over the edge's natural length [N/m], and its reciprocal [m/N]."""

    EA: np.ndarray
    EA_over_l: np.ndarray
    l_over_EA: np.ndarray


def coefficients(mesh: Mesh) -> Stretching:
    """Stretching stiffnesses, with modulus and cross section in the middle of the edges."""
    EA = mesh.modulus_at_edges * mesh.at_edges.area
    return Stretching(EA, EA / mesh.l, mesh.l / EA)


@kernel
def tension(rods, e, length):
    """T = EA (|e|/l - 1) [N] of edge e, whose length is `length` [m]."""
    return add_product(-load(rods.stretching.EA, e), load(rods.stretching.EA_over_l, e), length)


@kernel
def stretching_energy(rods, e, tension):
    """Stretching energy E_s [J] of edge e under a tension [N]."""
    return 0.5 * load(rods.stretching.l_over_EA, e) * tension * tension
