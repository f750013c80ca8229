"""What the speeds tell of the unknowns, one by one and together."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from studies.validation.priors import SWEEPS, UNKNOWNS, place_in_range

Floats = NDArray[np.float64]


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
