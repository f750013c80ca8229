"""The search at equal work: generations of small changes to the best robots, of which each stands for all its sizes.

A robot that is s times as large in all directions, of s^2 times the Young's modulus, swims s times as fast by the same
strokes, for s^5 times the work and moment: water and limbs keep their densities, strokes their second, and drag is
quadratic. So every robot that was simulated stands for all sizes at which it stays within the ranges of space.py, and
only shapes are searched.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas  # type: ignore[import-untyped]
from scipy.stats import qmc

from seastar_gym.executors import Executor
from seastar_gym.scene import Scene
from seastar_gym.sweep.batches import Batch
from seastar_gym.sweep.configurations import configuration_with
from seastar_gym.sweep.result_files import ResultFiles, read_result_file
from studies.designs.space import ANGLES, LENGTHS, LIMBS, MODULI, RADII, SWIM, TAPERS, Body, run_all
from studies.frame import Floats

Row = Mapping[str, Any]

POWERS = {
    "radius": 1, "robot.limb_length": 1, "robot.youngs_modulus": 2, "speed": 1, "work": 5, "peak_moment": 5,
}  # fmt: skip
"""Powers of the size with which columns grow."""
RANGES = {"radius": (RADII[0], RADII[-1]), "robot.limb_length": LENGTHS, "robot.youngs_modulus": MODULI}
"""Columns that stay within ranges."""
CHANGED = ("robot.limb_length", "robot.youngs_modulus", "actuator.peak_angle")
"""Columns that the search changes; sizes do the rest."""
CLEARANCE = 0.1
"""Smallest opening angle at the hub of robots that count [rad]: the limbs of others cross, or nearly do."""
GENERATIONS, CHILDREN = 10, 64
"""Generations of the search, and robots of every combination of limbs and taper in each."""
CHANGES = np.geomspace(0.2, 0.02, GENERATIONS)
"""Standard deviations of the logarithm of what changes, generation by generation."""
SPEEDS = 1e-3 * np.geomspace(1.0, 16.0, 17)
"""Speeds of the front [m/s]; its last point is the fastest robot's."""
RADIUS = 1.6e-3
"""Mean radius with which robots are simulated [m]."""
BODIES = tuple(Body(n_limbs, RADIUS, taper) for n_limbs in LIMBS for taper in TAPERS)
SIMULATED = CHILDREN * len(BODIES) * (1 + GENERATIONS)
"""Robots of all generations."""


class Limit(NamedTuple):
    """Most work and largest peak moment, in the units of the columns."""

    work: float = np.inf
    moment: float = np.inf


def counting(table: Any) -> Any:
    """Those of a table whose solver did not fail, and whose limbs keep off each other at the hub."""
    return table[(table.status == 0) & (table.smallest_opening_angle > CLEARANCE)]


def sizes(table: Any) -> tuple[Floats, Floats]:
    """Smallest and largest factor by which robots may grow, shape (n,) each; some have none: the smallest is larger."""
    low, high = np.zeros(len(table)), np.full(len(table), np.inf)
    for name, (least, most) in RANGES.items():
        value, root = table[name].to_numpy(float), 1.0 / POWERS[name]
        low, high = np.maximum(low, (least / value) ** root), np.minimum(high, (most / value) ** root)
    return low, high


def grown(row: Row, size: float) -> Row:
    """A robot so many times as large."""
    return {**row, **{name: float(row[name]) * size**power for name, power in POWERS.items()}}


def fastest(table: Any, limit: Limit = Limit()) -> Row:
    """The fastest robot within a limit."""
    low, high = sizes(table)
    size = np.minimum(high, (limit.work / table.work.to_numpy()) ** 0.2)
    size = np.minimum(size, (limit.moment / table.peak_moment.to_numpy()) ** 0.2)
    best = int(np.argmax(np.where(size >= low, table.speed.to_numpy() * size, -np.inf)))
    return grown(table.iloc[best].to_dict(), float(size[best]))


def thriftiest(table: Any, speed: float) -> Row:
    """The robot of least work per metre among those that are not slower [m/s]."""
    low, high = sizes(table)
    size = np.maximum(low, speed / table.speed.to_numpy())
    cost = np.where(size <= high, table.work.to_numpy() / table.speed.to_numpy() * size**4, np.inf)
    best = int(np.argmin(cost))
    return grown(table.iloc[best].to_dict(), float(size[best]))


def parents(table: Any, limits: tuple[Limit, ...]) -> list[Row]:
    """The best of a table: the fastest within limits, and the thriftiest at the speeds of the front."""
    top = float(fastest(table)["speed"])
    return [fastest(table, limit) for limit in limits] + [
        thriftiest(table, speed) for speed in SPEEDS[top >= SPEEDS].tolist()
    ]


def first(draws: np.random.Generator) -> dict[str, Floats]:
    """Numbers of robots of all shapes that some size brings into the ranges, from a Latin hypercube."""
    shares = qmc.LatinHypercube(len(CHANGED), seed=draws).random(CHILDREN).T
    low, high = RADIUS / RADII[-1], RADIUS / RADII[0]
    lengths, moduli = (low * LENGTHS[0], high * LENGTHS[1]), (low**2 * MODULI[0], high**2 * MODULI[1])
    ends = [*np.log([lengths, moduli]), np.array(ANGLES)]
    length, modulus, angle = (a + (b - a) * share for (a, b), share in zip(ends, shares, strict=True))
    return dict(zip(CHANGED, (np.exp(length), np.exp(modulus), angle), strict=True))


def children(rows: list[Row], change: float, draws: np.random.Generator) -> dict[str, Floats]:
    """Numbers of robots whose shapes are nearly those of some parents."""
    chosen = [rows[k] for k in draws.integers(len(rows), size=CHILDREN)]
    of_size = RADIUS / np.array([row["radius"] for row in chosen])
    found = {
        name: np.array([row[name] for row in chosen]) * of_size ** POWERS.get(name, 0)
        * np.exp(change * draws.standard_normal(CHILDREN))
        for name in CHANGED
    }  # fmt: skip
    return {**found, "actuator.peak_angle": np.clip(found["actuator.peak_angle"], *ANGLES)}


def simulated(numbers: list[dict[str, Floats]], folder: Path, executor: Executor) -> Any:
    """Results of robots that count, numbers of every body's; what is in the folder is not simulated again."""
    scene = Scene.preset("fast")
    cells = [
        Batch(configuration_with(scene, "straight", SWIM, {"robot": (body.robot(), body.label)}), each, CHILDREN)
        for body, each in zip(BODIES, numbers, strict=True)
    ]
    run_all(cells, folder, executor)
    tables = [read_result_file(ResultFiles(folder).file(cell.name)).to_pandas() for cell in cells]
    return counting(pandas.concat([table.assign(**body._asdict()) for body, table in zip(BODIES, tables, strict=True)]))


def search(limits: tuple[Limit, ...], folder: Path, executor: Executor) -> Any:
    """All robots of all generations that count."""
    draws = np.random.default_rng(0)
    table = simulated([first(draws) for _ in BODIES], folder, executor)
    for change in CHANGES.tolist():
        each = [table[(table.n_limbs == body.n_limbs) & (table.taper == body.taper)] for body in BODIES]
        numbers = [children(parents(some, limits), change, draws) for some in each]
        table = pandas.concat([table, simulated(numbers, folder, executor)], ignore_index=True)
        print(f"{len(table)} robots; the fastest swims {1e3 * fastest(table)['speed']:.2f} mm/s.", flush=True)
    return table
