"""Material damping after Kelvin and Voigt: strains are answered by stress in proportion to their rate, too.

Stretching has the dissipation potential R = 1/2 tau EA l (d eps/dt)^2, bending 1/2 tau EI dl (d kappa/dt)^2, with one
relaxation time tau. The rate over a stage is (eps - eps_hat)/gamma, eps_hat the strain at q_hat, so the stage minimises

    gamma R = r/2 EA l (eps - eps_hat)^2,    r = tau/gamma,

which is as stiff as stretching itself times r, has its derivatives, and knows nothing of a rotation. It takes the rate
in the middle of the way, off by gamma/2 times its change: of first order. The natural curvature of an actuator moves
no material, so it is in U, not in R.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import N_LANES, add_product, load, splat, store
from seastar_gym.lanes.rows import aligned_rows
from seastar_gym.rods.star import edge_of, half_angle, hinge_edges, is_clamped
from seastar_gym.rods.terms.bending import moment
from seastar_gym.rods.terms.clamp import freeze_directions
from seastar_gym.rods.terms.stretching import tension


def coefficients(relaxation_time: float | None) -> NDArray[np.float64] | None:
    """tau of material damping [s], one row; None for none."""
    return None if relaxation_time is None else np.array([relaxation_time])


class DampingWork(NamedTuple):
    """EA eps_hat [N] of edges and EI kappa_hat [N m] of hinges where a stage began; None without damping."""

    tension: np.ndarray | None
    bending: np.ndarray | None


def memory(is_damped: bool, n_edges: int) -> DampingWork:
    """Zeroed memory for one lane group."""
    return DampingWork(*(aligned_rows(n_edges, N_LANES) if is_damped else None for _ in range(2)))


@kernel
def freeze_strains(rods, work, q_hat):
    """Fill work.damping, and the directions that the clamps of a rigid hub had, in scenes with damping."""
    if rods.damping is None:
        return
    freeze_directions(rods, work, q_hat)
    for e in range(rods.n_edges):
        store(work.damping.tension, e, tension(rods, e, edge_of(rods, q_hat, e).length))
        if is_clamped(rods, e):
            continue
        a, b, side = hinge_edges(rods, e)
        t = half_angle(edge_of(rods, q_hat, a), edge_of(rods, q_hat, b), side)
        store(work.damping.bending, e, moment(rods, work, e, t, splat(0.0)))


@kernel
def damped_stress(rods, hat, row, inverse_gamma, stress, natural):
    """Tension or moment with its viscous part; stress + natural is EA eps or EI kappa."""
    if rods.damping is None:
        return stress
    ratio = load(rods.damping, 0) * inverse_gamma
    return add_product(stress, ratio, stress + natural - load(hat, row))


@kernel
def damped_energy(rods, hat, row, inverse_gamma, stress, natural, compliance, energy):
    """Energy with gamma R; compliance: l/EA or dl/EI."""
    if rods.damping is None:
        return energy
    ratio = load(rods.damping, 0) * inverse_gamma
    change = stress + natural - load(hat, row)
    return add_product(energy, 0.5 * ratio * compliance, change * change)


@kernel
def damped_stiffness(rods, inverse_gamma, stiffness):
    if rods.damping is None:
        return stiffness
    return add_product(stiffness, load(rods.damping, 0) * inverse_gamma, stiffness)
