"""Results of the accuracy study: a row per setting, and the selection of rows that no other row beats."""

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
"""A slower setting joins the front if it reduces the error by at least this fraction."""


@dataclass(frozen=True)
class Row:
    """A setting, its errors and its cost. Path and end errors are fractions of the converged path's length.

    path: Largest path error of all swims except gaits. worst: Name of the swim with that error.
    straight, pair, pentagon, random, gait: Largest path error of the swims of one kind.
    median: Median path error of the random sequences.
    heading, end: Largest heading error [deg] and end error of all swims except gaits.
    iterations, steps: Newton iterations and time steps per stroke.
    rejections, halvings: Numbers of rejected and of halved time steps, in all swims.
    spatial, spatial_straight: Path errors of the converged solution with N nodes per limb against N -> infinity, the
        largest and that of the straight swim.
    path_promise, straight_promise, gait_promise: Largest error of this setting and of all finer ones, see `promised`.
    speed, straight_speed: Real-time factors on one core, for mixed commands and for the straight swim.
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
        """Scheme and step as a reader sees them, such as "sdirk2 20 ms"."""
        adapted = self.numerics.path_tolerance
        how = "" if adapted is None else f", adapted to {100 * adapted:g} %"
        return f"{self.numerics.scheme} {1e3 * self.numerics.step:g} ms{how}"


class Space(NamedTuple):
    """Path errors of the converged solution with N nodes per limb: largest of all swims, and of the straight swim."""

    nodes_per_limb: int
    path: float
    straight: float


@dataclass(frozen=True)
class Study:
    """Results of the study.

    rows: One row per setting, those with N = 10 first.
    agreement: Largest path difference of the two converged solutions, by kind of swim.
    space: Errors of the converged solutions over N.
    straight: Hub x of the converged straight swim after every stroke [m].
    limit: Hub x of the converged straight swim after the last stroke for N -> infinity [m].
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
    """Whether `other` has the scheme of `numerics` and no larger step or tolerance."""
    return (
        other.scheme == numerics.scheme
        and (other.path_tolerance is None) == (numerics.path_tolerance is None)
        and other.step <= numerics.step
        and other.newton_tolerance <= numerics.newton_tolerance
        and (other.path_tolerance or 0.0) <= (numerics.path_tolerance or 0.0)
    )


def promised(rows: Sequence[Row]) -> list[Row]:
    """Rows with their promises: the largest error of a setting and of all settings that are no coarser.

    At some steps errors of opposite sign cancel. A promise does not rely on that.
    """
    found = []
    for row in rows:
        finer = [each for each in rows if no_coarser(each.numerics, row.numerics)]
        worst = {kind: max(getattr(each, kind) for each in finer) for kind in ("path", "straight", "gait")}
        found.append(replace(row, **{f"{kind}_promise": error for kind, error in worst.items()}))
    return found


def front(rows: Iterable[Row], error: Callable[[Row], float], speed: Callable[[Row], float]) -> list[Row]:
    """Pareto front of error and speed, fastest first; a slower row needs a noticeably smaller error."""
    chosen: list[Row] = []
    for row in sorted(rows, key=lambda row: (-speed(row), error(row))):
        if not chosen or error(row) < (1.0 - NOTICEABLE) * error(chosen[-1]):
            chosen.append(row)
    return [row for row in chosen if math.isfinite(error(row))]


def fronts(rows: Sequence[Row]) -> list[Row]:
    """Rows on the front of the path error, of the gait error or of the straight swim's, fastest first."""
    chosen = {
        row.numerics: row
        for kind in ("path", "gait", "straight")
        for row in front(rows, lambda row: getattr(row, f"{kind}_promise"), lambda row: row.speed)  # noqa: B023
    }
    return sorted(chosen.values(), key=lambda row: -row.speed)
