"""The terms of (13.9), one file each, with the same few functions as far as a term needs them.

coefficients(mesh, ...)       numbers of a robot for the kernels, as rows; None for a term that a scene does not name
freeze_...                    what a stage takes from the first guess of its iterate and keeps
..._slopes, add_...           energy, gradient and Hessian, for Newton's method
..._energy, add_work_of_...   energy and work, for the guard

`seastar_gym/model.py` gathers the coefficients, potential.py adds up the slopes and the energies, fluid.py freezes. A
constant force needs `coefficients` alone, as gravity.py shows; docs/extending.md tells how a term is added. What the
chapter does without has rooms of its own, with the same functions: a body (body.py) and contact (contact/).
"""
