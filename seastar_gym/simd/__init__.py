"""One robot per SIMD lane: the value type of the kernels, how they are compiled, and how numbers become rows."""
