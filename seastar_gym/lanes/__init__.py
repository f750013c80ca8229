"""One robot per SIMD lane: what a number of a kernel is, and how kernels are compiled.

In come kernels, functions of numbers in Python; out goes machine code, kept on disk, in which every number is that of
N_LANES robots, has slopes beside it, or is written down on a tape. Robots of a batch differ in numbers and not in what
is done with them, and a processor adds eight numbers as fast as one: hence lanes. No lane knows of another, so a robot
has the same bits in any company.
"""

from seastar_gym.process import held_back

with held_back():  # numba, and what it is taught, are there as a whole or not at all
    from seastar_gym.lanes import compile as compile
