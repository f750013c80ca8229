"""What the accuracy study finds: a row for every setting, and which rows are worth anything."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Numerics
from seastar_gym.scene.numerics import Fidelity

Floats = NDArray[np.float64]

NOTICEABLE = 0.03
"""By what share an error has to be smaller to be worth any time."""


@dataclass(frozen=True)
class Row:
    """A setting, its errors and its cost.

    path, straight, pair, pentagon, random, gait: Largest path errors, over all swims but gaits and by kind; worst: the
    swim that path is of. median: Of the random sequences. heading [deg], end: The worst of all swims but gaits.
    spatial, spatial_straight: Path errors of this N against N -> infinity, of the converged solutions.
    iterations, steps: Newton iterations and time steps per stroke. rejections, halvings: In all swims.
    path_promise, straight_promise, gait_promise: See `promised`.
    speed, straight_speed: Simulated over computing seconds on one core, mixed commands and straight swim.
    """

    numerics: Numerics
    nodes_per_limb: int
    path: float
    worst: str
    straight: float
    pair: float
    pentagon: float
    random: float
    median: float
    gait: float
    heading: float
    end: float
    iterations: float
    steps: float
    rejections: int
    halvings: int
    spatial: float = math.nan
    spatial_straight: float = math.nan
    path_promise: float = math.nan
    straight_promise: float = math.nan
    gait_promise: float = math.nan
    speed: float = math.nan
    straight_speed: float = math.nan

    @property
    def label(self) -> str:
        """Scheme and step, for people."""
        adapted = self.numerics.path_tolerance
        how = "" if adapted is None else f", adapted to {100 * adapted:g} %"
        return f"{self.numerics.scheme} {1e3 * self.numerics.step:g} ms{how}"


class Space(NamedTuple):
    """Path errors of the converged solution of N nodes per limb, over all swims and of the straight swim alone."""

    nodes_per_limb: int
    path: float
    straight: float


@dataclass(frozen=True)
class Study:
    """rows: Of N = 10 first. agreement: Path difference of the two converged solutions, by kind. space: Over N.

    straight: Hub x of the converged straight swim after every stroke [m]; limit: at the end for N -> infinity.
    """

    rows: list[Row]
    agreement: dict[str, float]
    space: list[Space]
    straight: Floats
    limit: float


def presets() -> dict[str, Numerics]:
    """The presets of `Numerics` by name."""
    return {name: Numerics.preset(name) for name in get_args(Fidelity)}


def no_coarser(other: Numerics, numerics: Numerics) -> bool:
    """Whether a setting is of the same kind and no coarser in any respect."""
    return (
        other.scheme == numerics.scheme
        and (other.path_tolerance is None) == (numerics.path_tolerance is None)
        and other.step <= numerics.step
        and other.newton_tolerance <= numerics.newton_tolerance
        and (other.path_tolerance or 0.0) <= (numerics.path_tolerance or 0.0)
    )


def promised(rows: Sequence[Row]) -> list[Row]:
    """Rows with their promises: the largest error of this setting and of all that are no coarser.

    Errors of opposite sign cancel at some steps; that luck may not last, so it is not promised.
    """
    found = []
    for row in rows:
        finer = [each for each in rows if no_coarser(each.numerics, row.numerics)]
        worst = {kind: max(getattr(each, kind) for each in finer) for kind in ("path", "straight", "gait")}
        found.append(replace(row, **{f"{kind}_promise": error for kind, error in worst.items()}))
    return found


def front(rows: Iterable[Row], error: Callable[[Row], float], speed: Callable[[Row], float]) -> list[Row]:
    """Rows that no other beats in both, fastest first; slower ones only if their error is noticeably smaller."""
    chosen: list[Row] = []
    for row in sorted(rows, key=lambda row: (-speed(row), error(row))):
        if not chosen or error(row) < (1.0 - NOTICEABLE) * error(chosen[-1]):
            chosen.append(row)
    return [row for row in chosen if math.isfinite(error(row))]


def fronts(rows: Sequence[Row]) -> list[Row]:
    """Those on the front of paths, of any gait or of the straight swim, fastest first."""
    chosen = {
        row.numerics: row
        for kind in ("path", "gait", "straight")
        for row in front(rows, lambda row: getattr(row, f"{kind}_promise"), lambda row: row.speed)  # noqa: B023
    }
    return sorted(chosen.values(), key=lambda row: -row.speed)
