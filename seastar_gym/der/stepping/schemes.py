"""Time stepping schemes: diagonally implicit Runge-Kutta tableaux whose stages are all solved by one kernel.

A stage i of a step h from (q_0, v_0) is implicit Euler with gamma = a_ii h, from
q_hat = q_0 + h sum_{j<i} a_ij V_j and v_hat = v_0 + h sum_{j<i} a_ij A_j.

The implicit midpoint rule keeps the amplitude of every oscillation, also of those that a step cannot resolve. With a
damping d its stage is at theta = (1 + d)/2 of the step, the theta method. An oscillation with the angular frequency w
then keeps, in every step, the share |R| of its amplitude,

    |R|^2 = (1 + (1 - theta)^2 x^2) / (1 + theta^2 x^2),    x = w h.

Those that a step resolves, x << 1, lose d x^2/2 per step, which is d x/2 per radian and below the midpoint rule's own
error of phase, x^2/12 per radian, from x = 6 d on. Those that it does not, x >> 1, lose 2 d per step. The method is
algebraically stable for d >= 0: two solutions of a dissipative problem never move apart.
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


def scheme_of(name: str, damping: float) -> Scheme:
    """Scheme of this name; damping: Of the implicit midpoint rule, see above, 0 for other schemes."""
    return SCHEMES[name] if damping == 0.0 else _scheme([[0.5 * (1.0 + damping)]], [1.0])
