"""Actuators that act all along their limb: on its natural curvature, and on its stiffness.

A limb that its actuator turns by delta has hinges, and a clamp, with the natural angle

    phi_bar = turn + share delta,    sum of the shares = 1 but for the last half edge,

and the bending stiffness f EI. With the activation a = |delta|/peak, from 0 to 1, f is logistic:

    f = 1 + (ratio - 1) (T(a) - T(0))/(T(1) - T(0)),    T(a) = tanh((a - middle)/(2 width)).

What moves natural curvature and stiffness is work of the actuator. It is in U, whose natural state is that of the
stage's time, so a stage knows nothing of it; the guard takes U before and after the change, see guard.py.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import N_LANES, absolute, add_product, load, select, store
from seastar_gym.lanes.rows import aligned_rows
from seastar_gym.rods.star import larger, tangent

Floats = NDArray[np.float64]


class Along(NamedTuple):
    """Natural state of limbs that actuators bend.

    turn: Natural angle at rest, per hinge [rad]; of no account for clamps, see clamp.py.
    share: Turn of every hinge per rotation by the actuator.
    inverse_peak: Activation over rotation [1/rad]. middle, slope: Of T, as factor of the activation. gain: (ratio - 1)/
        (T(1) - T(0)). One row each.
    """

    turn: np.ndarray
    share: np.ndarray
    inverse_peak: np.ndarray
    middle: np.ndarray
    slope: np.ndarray
    gain: np.ndarray


class AlongWork(NamedTuple):
    """Memory of limbs that actuators bend.

    stiffening: Factor f of a limb's bending stiffness and 1/f, two rows per limb.
    EI_kappa_bar: Natural moments of hinges [N m].
    """

    stiffening: np.ndarray
    EI_kappa_bar: np.ndarray


STIFFER, SOFTER, ALONG_ROWS = 0, 1, 2
"""Rows of a limb in work.along.stiffening: f, and 1/f."""


def coefficients(
    natural_turn: list[float], shares: Floats, peak_angle: float, ratio: float, middle: float, width: float
) -> Along:
    """Coefficients of limbs with natural angles of their hinges [rad], alike in how actuators act on them.

    shares: Turn of the hinges of a limb per rotation, the clamp's first. peak_angle: Rotation of activation 1 [rad].
    ratio, middle, width: Of stiffening, see `Stiffening`.
    """
    steps = math.tanh((1.0 - middle) / (2.0 * width)) + math.tanh(middle / (2.0 * width))
    return Along(
        turn=np.repeat(natural_turn, len(shares)),
        share=np.tile(shares, len(natural_turn)),
        inverse_peak=np.array([1.0 / peak_angle if peak_angle > 0.0 else 0.0]),
        middle=np.array([middle]),
        slope=np.array([0.5 / width]),
        gain=np.array([(ratio - 1.0) / steps]),
    )


def memory(along: Along | None, n_limbs: int, n_edges: int) -> AlongWork | None:
    """Zeroed memory for one lane group; None where actuators act at the hub only."""
    if along is None:
        return None
    return AlongWork(aligned_rows(ALONG_ROWS * n_limbs, N_LANES), aligned_rows(n_edges, N_LANES))


@kernel
def hyperbolic_tangent(x):
    """tanh(x), to some units in the last place: Pade's approximation at x/16, doubled four times; 1 beyond 20."""
    x = select(x > 20.0, 20.0, select(x < -20.0, -20.0, x))
    u = 0.0625 * x
    z = u * u
    t = u * (((z + 378.0) * z + 17325.0) * z + 135135.0) / (((28.0 * z + 3150.0) * z + 62370.0) * z + 135135.0)
    for _ in range(4):
        t = 2.0 * t / add_product(1.0, t, t)
    return t


@kernel
def stiffening(along, delta):
    """f of a limb that is turned by delta [rad]; 1 at rest, and without stiffening, to the last bit."""
    middle, slope = load(along.middle, 0), load(along.slope, 0)
    activation = absolute(delta) * load(along.inverse_peak, 0)
    risen = hyperbolic_tangent(slope * (activation - middle)) - hyperbolic_tangent(-slope * middle)
    return add_product(1.0, load(along.gain, 0), risen)


@kernel
def stiffening_rate(rods, delta):
    """d(ln f)/d(delta) of a limb that is turned by delta [1/rad]; 0 where actuators act at the hub only."""
    along = rods.along
    if along is None:
        return 0.0 * delta
    middle, slope, inverse_peak = load(along.middle, 0), load(along.slope, 0), load(along.inverse_peak, 0)
    t = hyperbolic_tangent(slope * (absolute(delta) * inverse_peak - middle))
    rate = load(along.gain, 0) * slope * inverse_peak * (1.0 - t * t) / stiffening(along, delta)
    return select(delta < 0.0, -rate, rate)


@kernel
def natural_tangent(along, hinge, delta):
    """tan(phi_bar/2) of a hinge of a limb that is turned by delta [rad]."""
    return tangent(0.5 * add_product(load(along.turn, hinge), load(along.share, hinge), delta))


@kernel
def turned(actuation, limb, fraction):
    """Rotation of a limb at `fraction` (lanes) of an interval [rad]."""
    start, end = load(actuation.delta_psi_start, limb), load(actuation.delta_psi_end, limb)
    return add_product(start, fraction, end - start)


@kernel
def turned_at_hub(rods, limb, delta):
    """What of a limb's rotation turns its clamp: all of it where actuators act at the hub only (None)."""
    if rods.along is None:
        return delta
    return load(rods.along.share, limb * rods.edges_per_limb) * delta


@kernel
def set_natural_curvature(rods, work, actuation, fraction):
    """Fill work.along at `fraction` (lanes) of an interval, where actuators act along limbs."""
    edges = rods.edges_per_limb
    for limb in range(rods.n_limbs):
        delta = turned(actuation, limb, fraction)
        f = stiffening(rods.along, delta)
        store(work.along.stiffening, ALONG_ROWS * limb + STIFFER, f)
        store(work.along.stiffening, ALONG_ROWS * limb + SOFTER, 1.0 / f)
        for hinge in range(limb * edges + 1, (limb + 1) * edges):
            EI_over_dl = f * load(rods.bending.EI_over_dl, hinge)
            store(work.along.EI_kappa_bar, hinge, 2.0 * EI_over_dl * natural_tangent(rods.along, hinge, delta))


@kernel
def bending_stiffness(rods, work, hinge):
    """EI/dl of a hinge, or K of a clamp, now [N m]."""
    EI_over_dl = load(rods.bending.EI_over_dl, hinge)
    if rods.along is None:
        return EI_over_dl
    return EI_over_dl * load(work.along.stiffening, ALONG_ROWS * (hinge // rods.edges_per_limb) + STIFFER)


@kernel
def bending_compliance(rods, work, hinge):
    """dl/EI of a hinge now [1/(N m)]."""
    dl_over_EI = load(rods.bending.dl_over_EI, hinge)
    if rods.along is None:
        return dl_over_EI
    return dl_over_EI * load(work.along.stiffening, ALONG_ROWS * (hinge // rods.edges_per_limb) + SOFTER)


@kernel
def natural_moment(rods, work, hinge):
    """Natural moment EI kappa_bar of a hinge within a limb now [N m]."""
    if rods.along is None:
        return load(rods.bending.EI_kappa_bar, hinge)
    return load(work.along.EI_kappa_bar, hinge)


@kernel
def add_moved_energy(rods, work, actuation, start, end, energy):
    """Add the energy of hinges at their natural angles, once those moved from `start` to `end` of the interval [J].

    At the larger stiffness of the two. Leaves in `work` what is natural at `end`.
    """
    if rods.along is None:
        return energy
    set_natural_curvature(rods, work, actuation, end)
    edges = rods.edges_per_limb
    for limb in range(rods.n_limbs):
        before, after = turned(actuation, limb, start), turned(actuation, limb, end)
        f = larger(stiffening(rods.along, before), stiffening(rods.along, after))
        for hinge in range(limb * edges + 1, (limb + 1) * edges):
            moved = natural_tangent(rods.along, hinge, after) - natural_tangent(rods.along, hinge, before)
            energy = add_product(energy, 2.0 * f * load(rods.bending.EI_over_dl, hinge) * moved, moved)
    return energy
