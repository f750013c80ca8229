"""Bending (13.3), (13.13): E_b = 1/2 EI (kappa - kappa_bar)^2 dl with kappa = 2 tan(phi/2)/dl.

With t = tan(phi/2): d kappa/d phi = (1 + t^2)/dl and d^2 kappa/d phi^2 = t (1 + t^2)/dl.

(13.13) lacks the length of (13.3), so its units do not close: a hub hinge has the energy of (13.3) too.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import add_product, select
from seastar_gym.rods.star import Mesh
from seastar_gym.rods.terms.along import bending_compliance, bending_stiffness

Floats = NDArray[np.float64]


class Bending(NamedTuple):
    """Coefficients per hinge: EI over Voronoi length [N m], its reciprocal [1/(N m)], and the natural moment [N m].

    The natural moments of hub hinges come from the actuators instead, see hub.py. With a rigid hub the first hinge of
    a limb is its clamp, see clamp.py. Where actuators act along limbs, all of these are those at rest, see along.py.
    """

    EI_over_dl: np.ndarray
    dl_over_EI: np.ndarray
    EI_kappa_bar: np.ndarray


GREGORY = (5.0 / 12.0, 13.0 / 12.0)
"""Weights of the quadrature of curvature at the root and at node 1 of a limb, of second order and a tiny constant."""


HELD_EDGE = (1.0 / 240.0, 15.0 / 8.0, 5.0 / 8.0)
"""Weights at the root and at nodes 1 and 2 of a limb whose root edge is held. The edge, which cannot turn, holds the
hub by a clamp a hundred times as stiff; the limb bends at the nodes, with weights of order 3 from the hub on."""


def coefficients(mesh: Mesh, gregory: bool = False, held_edges: Sequence[int] = ()) -> Bending:
    """Bending stiffnesses and natural moments, with cross sections at the nodes.

    gregory: Whether the first two hinges of a limb have Gregory's weights, and the first is the clamp of a rigid hub,
        as in the continuum's discretisation. Otherwise the first is a hub hinge.
    held_edges: Limbs whose root edges are held: with Gregory's weights, they are clamped at the hub.
    """
    n_edges = mesh.nodes_per_limb - 1
    EI = mesh.at_nodes.EI[:, :-1].ravel()
    weights = np.tile(hinge_weights(n_edges, gregory), (mesh.n_limbs, 1))
    if gregory and n_edges > 2:
        weights[list(held_edges), :3] = HELD_EDGE
    dl = mesh.l * weights.ravel()
    EI_over_dl, dl_over_EI = EI / dl, dl / EI
    EI_kappa_bar = 2.0 * EI_over_dl * np.tan(0.5 * np.repeat(mesh.natural_turn, n_edges))
    roots = n_edges * np.arange(mesh.n_limbs)
    EI_kappa_bar[roots] = 0.0
    if not gregory:
        EI_over_dl[roots], dl_over_EI[roots] = hub_stiffnesses(EI_over_dl[roots], dl_over_EI[roots])
    return Bending(EI_over_dl, dl_over_EI, EI_kappa_bar)


def hinge_weights(n_edges: int, gregory: bool) -> Floats:
    """Voronoi lengths of the hinges of a limb over its edges' length, the root's first."""
    weights = np.ones(n_edges)
    if gregory:
        weights[:2] = GREGORY[:n_edges]
    return weights


def hub_stiffnesses(EI_over_dl: Floats, dl_over_EI: Floats) -> tuple[Floats, Floats]:
    """(EI/dl, dl/EI) of the hub hinges, from those at the limbs' roots: half of each root edge, one after the other."""
    next_stiffness, next_compliance = np.roll(EI_over_dl, -1), np.roll(dl_over_EI, -1)
    stiffness = EI_over_dl + (next_stiffness - EI_over_dl) * (EI_over_dl / (EI_over_dl + next_stiffness))
    compliance = dl_over_EI + 0.5 * (next_compliance - dl_over_EI)
    exists = np.arange(len(EI_over_dl)) < n_hub_hinges(len(EI_over_dl))
    return np.where(exists, stiffness, 0.0), np.where(exists, compliance, 0.0)


def n_hub_hinges(n_limbs: int) -> int:
    """Number of hub hinges: one per gap; two limbs have one, so that straight ones make a plain rod."""
    return n_limbs if n_limbs > 2 else n_limbs - 1


@kernel
def moment(rods, work, hinge, t, EI_kappa_bar):
    """Bending moment EI (kappa - kappa_bar) [N m] of a hinge whose half angle has the tangent t."""
    return add_product(-EI_kappa_bar, 2.0 * bending_stiffness(rods, work, hinge), t)


@kernel
def bending_energy(rods, work, hinge, moment):
    """Bending energy E_b [J] of a hinge under a moment [N m]."""
    return 0.5 * bending_compliance(rods, work, hinge) * moment * moment


@kernel
def bending_slopes(stiffness, t, moment, convex):
    """(dE_b/dphi, d^2E_b/dphi^2) [N m] of a hinge of stiffness EI/dl.

    For the robots in the mask `convex` the second is the Gauss-Newton part alone, which is never negative.
    """
    growth = add_product(1.0, t, t)
    slope = moment * growth
    gauss_newton = stiffness * growth * growth
    return slope, select(convex, gauss_newton, add_product(gauss_newton, slope, t))
