"""Means and their intervals by bootstrap, over swims, episodes, paths, and seeds of trainings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

CONFIDENCE, RESAMPLES = 0.95, 2000


class Estimate(NamedTuple):
    """A mean, and the ends of its interval; NaN for those of a single seed."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.1f}" + ("" if np.isnan(self.low) else f" [{self.low:.1f}, {self.high:.1f}]")


def mean_with_interval(values: ArrayLike) -> Estimate:
    """Mean of values and the ends of its bootstrap confidence interval; NaN where there are no values.

    >>> print(mean_with_interval([150.0, 160.0, 155.0, 170.0]))
    158.8 [152.5, 166.2]
    """
    values = np.asarray(values, float)
    if len(values) == 0:
        return Estimate(np.nan, np.nan, np.nan)
    if np.ptp(values) == 0.0:
        return Estimate(*[float(values[0])] * 3)
    return Estimate(float(values.mean()), *_bootstrapped((values,), np.mean, batch=100))


def interquartile_mean(values: ArrayLike) -> float:
    """Mean of the middle half of all values.

    >>> interquartile_mean([1.0, 2.0, 3.0, 100.0])
    2.5
    """
    from scipy.stats import trim_mean  # takes half a second

    return float(trim_mean(np.ravel(np.asarray(values, float)), 0.25))


def estimate(scores: ArrayLike) -> Estimate:
    """Interquartile mean of scores, shape (seeds, paths), with a stratified bootstrap interval of 95 %.

    Seeds are drawn anew for every path, as in rliable (Agarwal et al., 2021): the paths are its tasks. The interval is
    that of other seeds on these paths.

    >>> print(estimate([[150.0, 160.0], [155.0, 162.0]]))  # two seeds on two paths
    157.5 [155.0, 158.5]
    """
    scores = np.asarray(scores, float)
    mean = interquartile_mean(scores)
    if len(scores) < 2:
        return Estimate(mean, np.nan, np.nan)
    if np.ptp(scores, axis=0).max() == 0.0:
        return Estimate(mean, mean, mean)

    from scipy.stats import trim_mean

    def of_all(*paths: Floats, axis: int = -1) -> Floats:
        found: Floats = trim_mean(np.concatenate(paths, axis=axis), 0.25, axis=axis)
        return found

    return Estimate(mean, *_bootstrapped(tuple(scores.T), of_all, vectorized=True))


def _bootstrapped(samples: tuple[Floats, ...], statistic: Callable[..., Any], **how: Any) -> tuple[float, float]:
    """Ends of the interval of a statistic of samples, each of which is drawn anew."""
    from scipy.stats import bootstrap

    found = bootstrap(
        samples, statistic, confidence_level=CONFIDENCE, n_resamples=RESAMPLES, method="percentile",
        rng=np.random.default_rng(0), **how,
    ).confidence_interval  # fmt: skip
    return float(found.low), float(found.high)
