"""Gaits that evolve: CMA-ES over the pulses of all slots, by the library cma.

A gait along limb 1 that is its own mirror image keeps its heading: limb 5 does the opposite of limb 2, limb 4 of
limb 3, and limb 1 nothing. So two numbers per slot are free. Wires may be heated again before they are cold.
"""

from collections.abc import Callable
from typing import Any

import cma
import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from studies.gaits.periodic import Swimming, measure

Floats = NDArray[np.float64]

DEAD = 0.2
"""Number below which a slot heats nothing, so that most slots can."""
MM = 1000.0


def pulses_of(numbers: Floats) -> Floats:
    """Shares of a full pulse in [-1, 1], from free numbers."""
    return np.sign(numbers) * np.clip((np.abs(numbers) - DEAD) / (1.0 - DEAD), 0.0, 1.0)


def mirrored_gaits(numbers: Floats, slots: int) -> Floats:
    """Gaits of five limbs, shape (n, slots, 5), from the free numbers of limbs 2 and 3, shape (n, 2 slots)."""
    pulses = pulses_of(numbers.reshape(-1, slots, 2))
    gaits = np.zeros((*pulses.shape[:2], 5))
    gaits[..., 1], gaits[..., 2] = pulses[..., 0], pulses[..., 1]
    gaits[..., 3], gaits[..., 4] = -pulses[..., 1], -pulses[..., 0]
    return gaits


def free_numbers(gait: Floats) -> Floats:
    """Free numbers that make a gait which is its own mirror image, shape (2 slots,)."""
    pulses = gait[:, 1:3].reshape(-1)
    return np.where(pulses != 0.0, np.sign(pulses) * (DEAD + (1.0 - DEAD) * np.abs(pulses)), 0.0)


def evolve(
    scene: Scene,
    start: Floats,
    slot: float,
    towards: float = 1.0,
    price: float = 0.0,
    generations: int = 60,
    population: int = 96,
    seed: int = 1,
    progress: Callable[[int], Any] | None = None,
) -> tuple[Floats, int]:
    """The best gait found from a start, shape (n_slots, 5), and the number of gaits tried.

    It maximises the speed [mm/s] towards limb 1 (towards = 1) or away from it (-1), less price [mm/J] times power [W].
    """
    slots = len(start)
    strategy = cma.CMAEvolutionStrategy(
        free_numbers(start), 0.35, {"popsize": population, "bounds": [-1.0, 1.0], "seed": seed, "verbose": -9}
    )
    best, best_score, tried = start, float(score(measure(scene, start[None], slot, 2, 2), towards, price)[0]), 0
    for _ in range(generations):
        asked = strategy.ask()
        gaits = mirrored_gaits(np.array(asked), slots)
        scores = score(measure(scene, gaits, slot, 2, 2), towards, price)
        strategy.tell(asked, list(-scores))
        tried += len(asked)
        if scores.max() > best_score:
            best, best_score = gaits[int(scores.argmax())], float(scores.max())
        if progress is not None:
            progress(len(asked))
        if strategy.stop():
            break
    return best, tried


def score(swimming: Swimming, towards: float, price: float) -> Floats:
    """What is maximised [mm/s], see `evolve`; shape (n,)."""
    return np.asarray(MM * towards * swimming.velocity[:, 0] - price * swimming.power)
