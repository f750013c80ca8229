"""Stretching (13.2): E_s = 1/2 EA (|e|/l - 1)^2 l."""

from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load


@kernel
def tension(rods, e, length):
    """T = EA (|e|/l - 1) [N] of edge e, whose length is `length` [m]."""
    return add_product(-load(rods.EA, e), load(rods.EA_over_l, e), length)


@kernel
def stretching_energy(rods, e, tension):
    """E_s [J]."""
    return 0.5 * load(rods.l_over_EA, e) * tension * tension
