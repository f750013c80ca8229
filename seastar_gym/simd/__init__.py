"""One robot per SIMD lane: the value type of the kernels, how they are compiled, and how numbers become rows."""

from seastar_gym.interrupts import held_back

with held_back():  # numba, and what it is taught, are there as a whole or not at all
    from seastar_gym.simd import compilation as compilation
