"""The hinges at the hub: how they are measured, and their natural angles (13.13), which actuators change with time."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import N_LANES, add_product, load, store
from seastar_gym.lanes.rows import aligned_rows
from seastar_gym.rods.star import tangent
from seastar_gym.rods.terms.along import set_natural_curvature
from seastar_gym.rods.terms.clamp import set_natural_directions


class Hub(NamedTuple):
    """Measure of the hub hinges.

    side: +1 if hub hinges are measured by the opening angle, -1 if by the interior turning angle.
    angle: The angle of the unactuated hub hinges, measured that way, per limb [rad].
    """

    side: float
    angle: np.ndarray


class HubWork(NamedTuple):
    """Memory of the hub's hinges, or clamps.

    moment, stiffness: Sums over those of a limb's root edge, per limb [N m].
    coupling: 2 x 2 block of every hub hinge, four rows per limb [N/m]; stiffnesses of clamps, see clamp.py [N m].
    EI_kappa_bar: Natural moment of the hub hinges, per limb [N m]. t: tan(phi/2) of theirs, per limb.
    """

    moment: np.ndarray
    stiffness: np.ndarray
    coupling: np.ndarray
    EI_kappa_bar: np.ndarray
    t: np.ndarray


class Actuation(NamedTuple):
    """Rotation of every limb at the ends of an interval [rad], shape (n_limbs, N_LANES), linear in between."""

    delta_psi_start: np.ndarray
    delta_psi_end: np.ndarray


def coefficients(angles: Sequence[float], turning: bool) -> Hub:
    """Measure of the hub hinges with these natural angles [rad]; turning: by the interior turning angle."""
    return Hub(side=-1.0 if turning else 1.0, angle=np.array(angles))


def memory(n_limbs: int) -> HubWork:
    """Zeroed memory for one lane group."""
    return HubWork(*(aligned_rows(count * n_limbs, N_LANES) for count in (1, 1, 4, 1, 1)))


@kernel
def set_natural_hub_angles(rods, work, actuation, fraction):
    """Natural state at `fraction` (lanes) of an interval: of the hub's hinges or clamps, and of limbs bent along."""
    if rods.along is not None:
        set_natural_curvature(rods, work, actuation, fraction)
    if rods.clamp is None:
        set_natural_moments(rods, work, actuation, fraction)
    else:
        set_natural_directions(rods, work, actuation, fraction)


@kernel
def set_natural_moments(rods, work, actuation, fraction):
    """Natural moments of the hub hinges at `fraction` (lanes) of an interval, (13.13).

    The hinge from limb j to limb j + 1 has the natural angle hub_angle_j + delta_psi_{j+1} - delta_psi_j.
    """
    for a in range(rods.n_limbs):
        b = (a + 1) % rods.n_limbs
        start = load(actuation.delta_psi_start, b) - load(actuation.delta_psi_start, a)
        end = load(actuation.delta_psi_end, b) - load(actuation.delta_psi_end, a)
        angle = load(rods.hub.angle, a) + add_product(start, fraction, end - start)
        natural_moment = 2.0 * load(rods.bending.EI_over_dl, a * rods.edges_per_limb) * tangent(0.5 * angle)
        store(work.hub.EI_kappa_bar, a, natural_moment)
