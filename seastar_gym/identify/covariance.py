"""Covariance of a least-squares fit whose residuals depend on those shortly before them.

What a scene lacks, such as limbs that are not alike, errs in the same way for many pictures. A fit that takes their
errors for independent has intervals that are too narrow. With J the derivative of the residuals r, and g_t = J_t^T r_t
the sum of a picture's coordinates, the covariance is

    (J^T J)^-1 [sum_{t, u} w(t - u) g_t g_u^T] (J^T J)^-1,    w(d) = max(0, 1 - |d|/tau)

(Newey and West, Econometrica 55, 703, 1987), with tau a sixth of the measurement's duration. The sum is of few
independent parts, so it is enlarged by the factor for tau/T = 1/6 (Kiefer and Vogelsang, Econometric Theory 21, 1130,
2005). In no direction is the variance taken to be less than s^2 (J^T J)^-1, that of independent errors of equal size,
with s^2 = |r|^2/(n - p).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

REMEMBERED = 1.0 / 6.0
"""Longest time between residuals that depend on each other, over the duration of the measurement [1]."""
FEW_PARTS = (1.0 + (2.9694 * REMEMBERED + 0.4160 * REMEMBERED**2 - 0.5324 * REMEMBERED**3) / 1.96) ** 2
"""Factor of the sum for its few independent parts."""
SMALLEST = 1e-100
"""Least divisor: what the data do not tell at all gets a variance that is huge, but finite."""


class Uncertainty(NamedTuple):
    """How well p parameters are known.

    covariance, correlation: Of the estimates, shape (p, p). The correlation of residuals of zero is that of independent
    errors.
    combinations: Combinations of parameters whose errors are independent, unit vectors, shape (p, p).
    errors: Their standard errors if residuals were independent, shape (p,).
    """

    covariance: Floats
    correlation: Floats
    combinations: Floats
    errors: Floats


def uncertainty_of(jacobian: Floats, residuals: Floats, times: Floats) -> Uncertainty:
    """Uncertainty of p fitted parameters.

    jacobian: Derivative J of the residuals by the parameters, shape (n, p).
    residuals: Residuals r, shape (n,).
    times: When each of them was measured, in order [s], shape (n,).
    """
    n, p = jacobian.shape
    error = np.linalg.norm(residuals) / np.sqrt(n - p)
    left, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    products = left * (residuals / max(error, SMALLEST))[:, None]
    sizes, axes = np.linalg.eigh(FEW_PARTS * _middle(*_sums_of_pictures(products, times)))
    unit_errors = 1.0 / np.maximum(singular, SMALLEST)
    root = directions.T * unit_errors @ axes
    unit = (root * np.maximum(sizes, 1.0)) @ root.T  # sizes of independent errors are one
    scale = np.sqrt(np.diag(unit))
    return Uncertainty(error**2 * unit, unit / scale[:, None] / scale, directions, error * unit_errors)


def _sums_of_pictures(gradients: Floats, times: Floats) -> tuple[Floats, Floats]:
    """Sums over the coordinates of every picture, shape (n_pictures, p), and times of the pictures [s]."""
    pictures, first = np.unique(times, return_index=True)
    return np.add.reduceat(gradients, first, axis=0), pictures


def _middle(gradients: Floats, times: Floats) -> Floats:
    """Sum of products of gradients at times t and u with the weight w(t - u), shape (p, p)."""
    total = gradients.T @ gradients
    remembered = REMEMBERED * (times[-1] - times[0])
    for apart in range(1, len(times)):
        passed = times[apart:] - times[:-apart]
        if passed.min() >= remembered:
            break
        weights = np.maximum(1.0 - passed / remembered, 0.0)
        products = (gradients[apart:] * weights[:, None]).T @ gradients[:-apart]
        total += products + products.T
    return total
