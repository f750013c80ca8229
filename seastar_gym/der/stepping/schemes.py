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
from numpy.typing import ArrayLike, NDArray


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


CONSISTENT, GROWING = 1e-12, 1e-9  # rounding of b's sum, and of amplitudes
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

OWN_SCHEMES: dict[str, Scheme] = {}
"""Those that a user has registered."""


def tableau(A: ArrayLike, b: ArrayLike) -> Scheme:
    """Scheme of a Butcher tableau. ValueError for what the stages of stages.py cannot solve, or what would blow up."""
    rows, weights = np.asarray(A, dtype=float), np.asarray(b, dtype=float)
    n = len(weights) if weights.ndim == 1 else 0
    if not n or rows.shape != (n, n) or not np.isfinite([*rows.ravel(), *weights]).all():
        raise ValueError("A tableau is finite numbers A of shape (n, n) and b of shape (n,), a row for each stage.")
    if np.triu(rows, 1).any() or not (rows.diagonal() > 0.0).all():
        raise ValueError(
            "Stages are solved one after the other, each implicit: A must be zero above its diagonal, and positive on "
            "it; Gauss's, Radau's, Lobatto's and explicit first stages cannot be."
        )
    if abs(weights.sum() - 1.0) > CONSISTENT:
        raise ValueError(f"The numbers of b must add up to 1, or time runs at another speed, not {weights.sum():.6g}.")
    growth = largest_growth(rows, weights)
    if growth > 1.0 + GROWING:
        raise ValueError(
            f"This tableau is not A-stable: it multiplies the amplitude of some oscillation by {growth:.4g} in every "
            "step, and limbs have oscillations of all frequencies."
        )
    return _scheme(rows.tolist(), None if np.array_equal(rows[-1], weights) else weights.tolist())


def largest_growth(A: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Largest |R(i y)| of an undamped oscillation in a step, with R(z) = 1 + z b (1 - z A)^-1 1."""
    frequencies = np.geomspace(1e-2, 1e6, 2000)
    one = np.ones(len(b))
    return max(abs(1.0 + 1j * y * (b @ np.linalg.solve(np.eye(len(b)) - 1j * y * A, one))) for y in frequencies)


def scheme_of(name: str, damping: float) -> Scheme:
    """Scheme of this name; damping: Of the implicit midpoint rule, see above, 0 for other schemes."""
    if name in OWN_SCHEMES:
        return OWN_SCHEMES[name]
    return SCHEMES[name] if damping == 0.0 else _scheme([[0.5 * (1.0 + damping)]], [1.0])
