"""Time stepping schemes: diagonally implicit Runge-Kutta tableaux whose stages are all solved by one kernel.

A stage i of a step h from (q_0, v_0) is implicit Euler with gamma = a_ii h, from
q_hat = q_0 + h sum_{j<i} a_ij V_j and v_hat = v_0 + h sum_{j<i} a_ij A_j.
"""

from typing import NamedTuple

import numpy as np


class Scheme(NamedTuple):
    """A tableau.

    a (row by row), b, c: Its coefficients.
    stiffly_accurate: b is the last row of a, so the last stage is the result.
    dissipative: A step whose elastic energy is convex takes energy from the robot, see guard.py.
    """

    n_stages: int
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    stiffly_accurate: bool
    dissipative: bool


def _scheme(a: list[list[float]], b: list[float] | None = None) -> Scheme:
    rows = np.array(a)
    return Scheme(
        n_stages=len(rows),
        a=rows.ravel(),
        b=rows[-1].copy() if b is None else np.array(b),
        c=rows.sum(axis=1),
        stiffly_accurate=b is None,
        dissipative=a == [[1.0]],
    )


_G2 = 1.0 - 0.5 * np.sqrt(2.0)
_G3 = 0.43586652150845899942  # root of x^3 - 3 x^2 + 3/2 x - 1/6, Alexander (1977)

SCHEMES = {
    "implicit-euler": _scheme([[1.0]]),  # (13.9), order 1, L-stable
    "sdirk2": _scheme([[_G2, 0.0], [1.0 - _G2, _G2]]),  # order 2, L-stable
    "sdirk3": _scheme(  # order 3, L-stable
        [
            [_G3, 0.0, 0.0],
            [0.5 * (1.0 - _G3), _G3, 0.0],
            [-1.5 * _G3**2 + 4.0 * _G3 - 0.25, 1.5 * _G3**2 - 5.0 * _G3 + 1.25, _G3],
        ]
    ),
    "implicit-midpoint": _scheme([[0.5]], [1.0]),  # order 2, keeps the amplitude of every oscillation
}
