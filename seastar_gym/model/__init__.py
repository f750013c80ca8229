"""Coefficients of a scene for the kernels of `der`.

`mesh.py` divides limbs into edges and nodes, `rods.py` makes the coefficients of one robot and the tolerances of its
solver, and `coefficients.py` joins those of a batch.
"""
