"""Statistics of strokes to finish, over seeds of the training and paths."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import bootstrap, spearmanr, trim_mean

Floats = NDArray[np.float64]

CONFIDENCE, RESAMPLES = 0.95, 2000


class Estimate(NamedTuple):
    """A mean, and the ends of its interval; NaN for those of a single seed."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.1f}" + ("" if np.isnan(self.low) else f" [{self.low:.1f}, {self.high:.1f}]")


def interquartile_mean(values: ArrayLike) -> float:
    """Mean of the middle half of all values."""
    return float(trim_mean(np.ravel(np.asarray(values, float)), 0.25))


def estimate(scores: ArrayLike) -> Estimate:
    """Interquartile mean of scores, shape (seeds, paths), with a stratified bootstrap interval of 95 %.

    Seeds are drawn anew for every path, as in rliable (Agarwal et al., 2021): the paths are its tasks. The interval is
    that of other seeds on these paths.
    """
    scores = np.asarray(scores, float)
    mean = interquartile_mean(scores)
    if len(scores) < 2:
        return Estimate(mean, np.nan, np.nan)
    if np.ptp(scores, axis=0).max() == 0.0:
        return Estimate(mean, mean, mean)

    def of_all(*paths: Floats, axis: int = -1) -> Floats:
        found: Floats = trim_mean(np.concatenate(paths, axis=axis), 0.25, axis=axis)
        return found

    found = bootstrap(
        tuple(scores.T), of_all, confidence_level=CONFIDENCE, n_resamples=RESAMPLES, method="percentile",
        vectorized=True, rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    return Estimate(mean, float(found.low), float(found.high))


def rank_correlation(one: Sequence[float], other: Sequence[float]) -> float:
    """Spearman's rank correlation of the scores of the same policies in two physics; NaN where one is constant."""
    if np.ptp(one) == 0.0 or np.ptp(other) == 0.0:
        return float("nan")
    return float(spearmanr(one, other).statistic)


def profile(scores: ArrayLike, levels: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Performance profile: share of the scores, shape (seeds, tasks), that reach each level; every task counts alike.

    Returns the shares and the ends of their stratified bootstrap intervals of 95 %, as in rliable.
    """
    scores, levels = np.asarray(scores, float), np.asarray(levels, float)
    rng, (n_seeds, n_tasks) = np.random.default_rng(0), scores.shape
    shares = (scores[..., None] >= levels).mean(axis=(0, 1))
    drawn = rng.integers(n_seeds, size=(RESAMPLES, n_seeds, n_tasks))
    reached = np.take_along_axis(scores[None], drawn, axis=1)[..., None] >= levels
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(reached.mean(axis=(1, 2)), [tail, 100.0 - tail], axis=0)
    return shares, low, high
