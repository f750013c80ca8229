"""Bending (13.3), (13.13): E_b = 1/2 EI (kappa - kappa_bar)^2 dl with kappa = 2 tan(phi/2)/dl.

With t = tan(phi/2): d kappa/d phi = (1 + t^2)/dl and d^2 kappa/d phi^2 = t (1 + t^2)/dl.

(13.13) lacks the length of (13.3), so its units do not close: a hub hinge has the energy of (13.3) too.
"""

from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load, select


@kernel
def moment(rods, hinge, t, EI_kappa_bar):
    """EI (kappa - kappa_bar) [N m]."""
    return add_product(-EI_kappa_bar, 2.0 * load(rods.EI_over_dl, hinge), t)


@kernel
def bending_energy(rods, hinge, moment):
    """E_b [J]."""
    return 0.5 * load(rods.dl_over_EI, hinge) * moment * moment


@kernel
def bending_slopes(stiffness, t, moment, convex):
    """(dE_b/dphi, d^2E_b/dphi^2) [N m] of a hinge of stiffness EI/dl.

    For the robots in the mask `convex` the second is the Gauss-Newton part alone, which is never negative.
    """
    growth = add_product(1.0, t, t)
    slope = moment * growth
    gauss_newton = stiffness * growth * growth
    return slope, select(convex, gauss_newton, add_product(gauss_newton, slope, t))
