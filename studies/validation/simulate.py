"""Speeds of all samples of the unknowns in all conditions: robots side by side in batches, kept in files."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seastar_gym.simulator import Simulator
from studies.validation.in_turn import LATE
from studies.validation.priors import SWEEPS, of_sweep
from studies.validation.speeds import Condition
from studies.validation.swimmer import FRONT, SIDES, Variant, scene

Floats = NDArray[np.float64]

STROKES, FIRST = 8, 4
"""Strokes from rest, and those before the mean begins: speeds are those of strokes 5 to 8."""


def speeds(condition: Condition, values: dict[str, Floats], variant: Variant, finer: int = 1) -> Floats:
    """Mean forward speed of every sample [m/s], NaN where the solver gave up, shape (n_samples,)."""
    found = np.empty(len(values["limb length"]))
    for number, sweep in enumerate(SWEEPS):
        swimmers = of_sweep(values, number)
        found[number :: len(SWEEPS)] = swum(condition, swimmers, sweep, variant, finer)
    return found


def swum(condition: Condition, values: dict[str, Floats], sweep: float, variant: Variant, finer: int) -> Floats:
    """Speeds of samples with one sweep [m/s]."""
    n = len(values["limb length"])
    simulator = Simulator(scene(condition, values, sweep, variant, finer), n)
    late = np.where(FRONT, 1.0, LATE) if variant.lag else 1.0
    command, start = np.tile(late * np.array(SIDES), (n, 1)), np.zeros(n)
    for stroke in range(STROKES):
        if stroke == FIRST:
            start = simulator.hub_position()[:, 0]
        simulator.stroke(command)
    way = simulator.hub_position()[:, 0] - start
    return np.where(simulator.failed, np.nan, way * condition.frequency / (STROKES - FIRST))


def all_speeds(
    conditions: list[Condition], values: dict[str, Floats], variant: Variant, place: Path
) -> Iterator[tuple[Condition, Floats]]:
    """Speeds of every condition in turn, from its file in a folder where there is one."""
    place.mkdir(parents=True, exist_ok=True)
    for condition in conditions:
        file = place / f"{condition.name}.npy"
        if not file.is_file():
            found = speeds(condition, values, variant)
            part = file.with_suffix(".part.npy")
            np.save(part, found)
            part.replace(file)
        yield condition, np.load(file)
