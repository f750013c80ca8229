"""Actuation: natural angles of the hub hinges, (13.13), that change with time."""

from seastar_gym.der.geometry import tangent
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load, store


@kernel
def set_natural_hub_angles(rods, work, actuation, fraction):
    """Natural moments of the hub hinges at `fraction` (lanes) of an interval, (13.13).

    The hinge from limb j to limb j + 1 has the natural angle hub_angle_j + delta_psi_{j+1} - delta_psi_j.
    """
    for a in range(rods.n_limbs):
        b = (a + 1) % rods.n_limbs
        start = load(actuation.delta_psi_start, b) - load(actuation.delta_psi_start, a)
        end = load(actuation.delta_psi_end, b) - load(actuation.delta_psi_end, a)
        angle = load(rods.hub_angle, a) + add_product(start, fraction, end - start)
        natural_moment = 2.0 * load(rods.EI_over_dl, a * (rods.nodes_per_limb - 1)) * tangent(0.5 * angle)
        store(work.hub_EI_kappa_bar, a, natural_moment)
