"""How many robots stand side by side in memory, and for how many of them a kernel computes at a time."""

import os

import llvmlite.binding


def _lanes_for_this_processor() -> int:
    """Eight float64 fill an AVX-512 register, four an AVX2 or two NEON registers."""
    forced = os.environ.get("SEASTAR_LANES")
    if forced is not None:
        if forced not in {"2", "4", "8", "16"}:
            raise ValueError(f"SEASTAR_LANES={forced!r} is not a lane width: use 2, 4, 8 or 16.")
        return int(forced)
    return 8 if llvmlite.binding.get_host_cpu_features().get("avx512f", False) else 4


N_LANES = _lanes_for_this_processor()
"""Numbers in a row of memory, one of each robot of a lane group."""
WIDTH = N_LANES
"""Numbers in a value of a kernel: those of a whole row on a processor, that of one robot where each has a thread."""
