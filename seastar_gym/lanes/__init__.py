"""Lanes and what computes on them: from one source, machine code of kernels for many robots at once.

Kernels come in as Python functions of `Lanes`, and numbers of robots as rows of arrays; machine code goes out, for SIMD
registers, for devices with a thread per robot, or with derivatives. What rows hold is in their type, so nobody writes a
kernel twice, and what Python calls runs in Python.
"""

from seastar_gym.interrupts import held_back

with held_back():  # numba, and what it is taught, are there as a whole or not at all
    from seastar_gym.lanes import compile as compile
