"""How much hangs on which four speeds the model is fitted to: many other fours, of the same simulations."""

import numpy as np
from numpy.typing import NDArray

from studies.validation.inference import Score, predict, score, weights
from studies.validation.speeds import TRAINED_MATERIALS, Condition

Floats = NDArray[np.float64]


def other_fours(conditions: list[Condition], n: int, seed: int = 0) -> list[list[int]]:
    """Indices of n fours of runs, one of each of the same materials, drawn at random."""
    rng = np.random.default_rng(seed)
    by_material = [[k for k, c in enumerate(conditions) if c.liquid_metal == m] for m in TRAINED_MATERIALS]
    return [[int(rng.choice(of_one)) for of_one in by_material] for _ in range(n)]


def scores(simulated: Floats, measured: Floats, fours: list[list[int]]) -> list[Score]:
    """Score of the predictions from each four."""
    return [score(predict(simulated, weights(simulated, measured, four)), measured, four) for four in fours]
