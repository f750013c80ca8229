"""Stretching (13.2): E_s = 1/2 EA (|e|/l - 1)^2 l."""

from seastar_gym.der.compilation import kernel
from seastar_gym.der.lanes import load


@kernel
def tension(rods, e, length):
    """T = EA (|e|/l - 1) [N] of edge e, whose length is `length` [m]."""
    return load(rods.EA_over_l, e) * length - load(rods.EA, e)


@kernel
def stretching_energy(rods, e, tension):
    """E_s [J]."""
    return 0.5 * load(rods.l_over_EA, e) * tension * tension
