"""Importance weights of samples from a few measured speeds, and predictions of others with intervals.

A measured speed is the simulated one times an error whose logarithm is normal. Its standard deviation has two parts:
the scatter of single runs, and what a model of this kind is off. Both are set beforehand, see SCATTER and MODEL. A
sample has the weight of its likelihood; predictions are quantiles of the weighted samples with such an error.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from studies.frame import Floats
from studies.validation.priors import SWEEPS, UNKNOWNS, place_in_range
from studies.validation.speeds import TRAINED_MATERIALS, Condition

SCATTER = 0.10
"""Standard deviation of the logarithm of a measured speed, one run of several."""
MODEL = 0.18
"""That of the model's error. The authors' own model is 19 % off on average."""
SPREAD = float(np.hypot(SCATTER, MODEL))
LEVEL = 0.9
"""Share of speeds that intervals should hold."""
BISECTIONS = 30
"""A logarithm is then found to 1e-8."""


@dataclass(frozen=True)
class Prediction:
    """Predicted speeds [m/s], shape (n_conditions,): medians, and ends of the intervals."""

    middle: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True)
class Score:
    """How good predictions are.

    error, median, worst: Mean, median and largest |predicted - measured|/measured.
    bias: Mean of (predicted - measured)/measured.
    covered: Share of measured speeds within their intervals. ratio: Median of high/low.
    """

    error: float
    median: float
    bias: float
    worst: float
    covered: float
    ratio: float


def weights(simulated: Floats, measured: Floats, chosen: list[int]) -> Floats:
    """Weights of the samples, sum 1, from the speeds of the chosen conditions.

    simulated: Speeds of every sample [m/s], shape (n_samples, n_conditions). measured: Shape (n_conditions,).
    """
    off = (log_speeds(simulated[:, chosen]) - np.log(measured[chosen])) / SPREAD
    likelihood = -0.5 * (off**2).sum(axis=1)
    found = np.exp(likelihood - likelihood.max())
    return np.asarray(found / found.sum())


def log_speeds(simulated: Floats) -> Floats:
    """Logarithms; swimmers that fail, stand still or go backwards are very slow."""
    return np.log(np.where(simulated > 1e-5, simulated, 1e-5))


def predict(simulated: Floats, weight: Floats) -> Prediction:
    """Quantiles of the mixture of the samples' log-normal errors."""
    logs = log_speeds(simulated)
    return Prediction(
        *(np.exp(quantiles(logs, weight, share)) for share in (0.5, 0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL))
    )


def quantiles(centres: Floats, weight: Floats, share: float) -> Floats:
    """Numbers below which `share` of mixtures of normal distributions with the standard deviation SPREAD lies.

    centres: Shape (n_samples, k). Returns shape (k,).
    """
    low, high = centres.min(axis=0) - 6.0 * SPREAD, centres.max(axis=0) + 6.0 * SPREAD
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        below = weight @ ndtr((middle - centres) / SPREAD) < share
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))


def score(prediction: Prediction, measured: Floats, chosen: list[int]) -> Score:
    """Score of the conditions that were not chosen."""
    others = np.setdiff1d(np.arange(len(measured)), chosen)
    off = (prediction.middle[others] - measured[others]) / measured[others]
    held = (prediction.low[others] <= measured[others]) & (measured[others] <= prediction.high[others])
    return Score(
        error=float(np.abs(off).mean()),
        median=float(np.median(np.abs(off))),
        bias=float(off.mean()),
        worst=float(np.abs(off).max()),
        covered=float(held.mean()),
        ratio=float(np.median(prediction.high[others] / prediction.low[others])),
    )


def one_speed(measured: Floats, chosen: list[int]) -> float:
    """Error of the simplest prediction: the mean of the chosen speeds, for all others."""
    others = np.setdiff1d(np.arange(len(measured)), chosen)
    return float(np.abs(measured[chosen].mean() / measured[others] - 1.0).mean())


def hindsight(simulated: Floats, measured: Floats, chosen: list[int]) -> float:
    """Smallest error of any one sample on the conditions that were not chosen: what the model could do, if told all."""
    others = np.setdiff1d(np.arange(len(measured)), chosen)
    off = np.abs(np.exp(log_speeds(simulated)) - measured)[:, others] / measured[others]
    return float(off.mean(axis=1).min())


def effective(weight: Floats) -> float:
    """Number of samples of equal weight that would say as much."""
    return float(1.0 / (weight**2).sum())


# What the speeds tell of the unknowns, one by one and together.


class Told(NamedTuple):
    """What is known of an unknown afterwards.

    low, middle, high: Quantiles 5, 50 and 95 %. narrower: Standard deviation of its logarithm over that before.
    """

    name: str
    low: float
    middle: float
    high: float
    narrower: float


def told(values: dict[str, Floats], weight: Floats) -> list[Told]:
    """Every unknown by itself."""
    found = []
    for unknown in UNKNOWNS:
        logs = np.log(values[unknown.name])
        order = np.argsort(logs)
        below = np.cumsum(weight[order]) - 0.5 * weight[order]
        low, middle, high = np.exp(np.interp([0.05, 0.5, 0.95], below, logs[order]))
        mean = weight @ logs
        narrower = np.sqrt(weight @ (logs - mean) ** 2) / logs.std()
        found.append(Told(unknown.name, float(low), float(middle), float(high), float(narrower)))
    return found


def sweeps_told(weight: Floats) -> list[float]:
    """Probability of every sweep of the limbs, in the order of SWEEPS."""
    return [float(weight[number :: len(SWEEPS)].sum()) for number in range(len(SWEEPS))]


def best_known(values: dict[str, Floats], weight: Floats) -> tuple[dict[str, float], float]:
    """The product of powers of the unknowns that the speeds tell most of: powers, and how much narrower it is.

    That is the direction of least variance of the unknowns' places in their ranges; powers of the largest size 1.
    """
    places = place_in_range(values)
    off = places - weight @ places
    shares, directions = np.linalg.eigh((off * weight[:, None]).T @ off)
    direction = directions[:, 0]
    powers = direction / np.array([np.log(u.high / u.low) for u in UNKNOWNS])
    powers /= powers[np.abs(powers).argmax()]
    narrower = float(np.sqrt(shares[0]) / (places @ direction).std())
    return {u.name: float(power) for u, power in zip(UNKNOWNS, powers, strict=True)}, narrower


# How much hangs on which four speeds the model is fitted to: many other fours, of the same simulations.


def other_fours(conditions: list[Condition], n: int) -> list[list[int]]:
    """Indices of n fours of runs, one of each of the same materials, drawn at random."""
    rng = np.random.default_rng(0)
    by_material = [[k for k, c in enumerate(conditions) if c.liquid_metal == m] for m in TRAINED_MATERIALS]
    return [[int(rng.choice(of_one)) for of_one in by_material] for _ in range(n)]


def scores(simulated: Floats, measured: Floats, fours: list[list[int]]) -> list[Score]:
    """Score of the predictions from each four."""
    return [score(predict(simulated, weights(simulated, measured, four)), measured, four) for four in fours]
