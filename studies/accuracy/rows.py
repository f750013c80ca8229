"""Results of the accuracy study: a row per setting, and the selection of rows that no other row beats."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, TypeVar

import numpy as np

from seastar_gym.accuracy.measure import Errors
from seastar_gym.scene import Numerics
from seastar_gym.scene.numerics import Resolution
from studies.accuracy.cases import Cases

NOTICEABLE = 0.03
"""A slower setting joins the front if it reduces the error by at least this fraction."""

UNSEEN = 1.5
"""Promised over measured error of gaits and slow swims.

Of 64 random gaits that the study did not use, the worst erred by 1.3 times the largest error of the 40 that it did, see
tests/accuracy/test_shipped.py. Errors of other swims are largest for the pairs, which are all measured.
"""

Column = Literal["path", "straight", "pair", "pentagon", "random", "slow", "gait", "heading", "end"]


class Figures(NamedTuple):
    """Largest errors of swims. Path and end errors are fractions of the path's length.

    path: Largest path error of all swims except gaits and slow ones. worst: Name of the swim with that error.
    straight, pair, pentagon, random, slow, gait: Largest path error of the swims of one kind.
    worst_gait: Name of the gait with the largest path error.
    heading, end: Largest heading error [deg] and end error of the swims of `path`.
    """

    path: float = math.nan
    straight: float = math.nan
    pair: float = math.nan
    pentagon: float = math.nan
    random: float = math.nan
    slow: float = math.nan
    gait: float = math.nan
    heading: float = math.nan
    end: float = math.nan
    worst: str = ""
    worst_gait: str = ""


def figures(batches: Sequence[Cases], found: Sequence[Errors]) -> Figures:
    """Largest errors of all batches."""
    kinds = np.array([kind for batch in batches for kind in batch.kinds])
    names = np.array([name for batch in batches for name in batch.names])
    path, end, heading = (np.concatenate(column) for column in zip(*found, strict=True))
    gait = kinds == "gait"
    main = ~gait & (kinds != "slow")

    def largest(kind: str) -> float:
        return float(path[kinds == kind].max(initial=0.0))

    return Figures(
        path=float(path[main].max()),
        straight=largest("straight"),
        pair=largest("pair"),
        pentagon=largest("pentagon"),
        random=largest("random"),
        slow=largest("slow"),
        gait=largest("gait"),
        heading=float(np.degrees(heading[main].max())),
        end=float(end[main].max()),
        worst=str(names[main][path[main].argmax()]),
        worst_gait=str(names[gait][path[gait].argmax()]) if gait.any() else "",
    )


def medians(batches: Sequence[Cases], space: Sequence[Errors], time: Sequence[Errors]) -> Figures:
    """Median path errors, of space and time together, of random, slow and repeated or alternating commands."""
    kinds = np.array([kind for batch in batches for kind in batch.kinds])
    path = np.concatenate([one.path + other.path for one, other in zip(space, time, strict=True)])

    def middle(kind: str) -> float:
        return float(np.median(path[kinds == kind])) if (kinds == kind).any() else math.nan

    return Figures(random=middle("random"), slow=middle("slow"), gait=middle("gait"))


def at_least(some: Sequence[Figures]) -> Figures:
    """The largest of every column."""
    columns = {name: max(getattr(each, name) for each in some) for name in Figures._fields if "worst" not in name}
    return some[0]._replace(**columns)


@dataclass(frozen=True)
class Row:
    """A setting, its errors and its cost.

    space: Errors of swims converged in time with N nodes per limb against the continuum.
    time: Errors of the setting's swims against those converged in time with the same nodes.
    iterations, steps: Newton iterations and time steps per stroke.
    rejections, halvings: Numbers of rejected and of halved time steps, in all swims.
    speed, straight_speed: Real-time factors on one core, for mixed commands and for the straight swim.
    sure_space, sure_time: Errors that can be promised, see `promised`.
    typical: Medians of the sum of both errors.
    """

    resolution: Resolution
    space: Figures
    time: Figures
    iterations: float
    steps: float
    rejections: int
    halvings: int
    speed: float = math.nan
    straight_speed: float = math.nan
    sure_space: Figures = Figures()
    sure_time: Figures = Figures()
    typical: Figures = Figures()

    @property
    def mesh(self) -> tuple[str, int]:
        """Discretisation and nodes per limb."""
        return self.resolution.discretisation, self.resolution.nodes_per_limb

    @property
    def label(self) -> str:
        """Scheme and step as a reader sees them, such as "sdirk2 20 ms"."""
        numerics = self.resolution.numerics
        adapted = numerics.path_tolerance
        how = "" if adapted is None else f", adapted to {100 * adapted:g} %"
        bare = self.mesh[0] == "continuum" and numerics.scheme == "implicit-midpoint" and numerics.damping == 0.0
        return f"{numerics.scheme} {1e3 * numerics.step:g} ms{how}{', undamped' if bare else ''}"

    def total(self, column: Column) -> float:
        """Measured error of space and of time, added."""
        return float(getattr(self.space, column) + getattr(self.time, column))

    def promise(self, column: Column) -> float:
        """Sum of the two errors that can be promised, with a margin for what varies most among commands.

        The two may cancel, and a promise does not rely on that.
        """
        margin = UNSEEN if column in ("gait", "slow") else 1.0
        return margin * float(getattr(self.sure_space, column) + getattr(self.sure_time, column))


@dataclass(frozen=True)
class Study:
    """Results of the study.

    rows: One row per setting.
    doubt: Errors of the limit itself, by what they are from.
    distances: Distances of the straight swim and the pairs after ten strokes in the limit [m], by name.
    first_stroke: Hub x of the straight swim after one stroke in the limit [m].
    """

    rows: list[Row]
    doubt: dict[str, Figures]
    distances: dict[str, float]
    first_stroke: float


def no_coarser(other: Numerics, numerics: Numerics) -> bool:
    """Whether `other` has the scheme of `numerics`, no less damping, and no larger step or tolerance."""
    return (
        other.scheme == numerics.scheme
        and other.damping >= numerics.damping
        and (other.path_tolerance is None) == (numerics.path_tolerance is None)
        and other.step <= numerics.step
        and other.newton_tolerance <= numerics.newton_tolerance
        and (other.path_tolerance or 0.0) <= (numerics.path_tolerance or 0.0)
    )


def promised(rows: Sequence[Row]) -> list[Row]:
    """Rows with what can be promised.

    At some steps, and with some numbers of nodes, errors of opposite sign cancel. So the error of time is the largest
    of the setting and of all that are no coarser, and that of space the largest of N nodes and of more.
    """
    found = []
    for row in rows:
        more = [
            each.space
            for each in rows
            if each.resolution.discretisation == row.resolution.discretisation
            and each.resolution.nodes_per_limb >= row.resolution.nodes_per_limb
        ]
        finer = [
            each.time
            for each in rows
            if each.mesh == row.mesh and no_coarser(each.resolution.numerics, row.resolution.numerics)
        ]
        found.append(replace(row, sure_space=at_least([row.space, *more]), sure_time=at_least([row.time, *finer])))
    return found


T = TypeVar("T")


def front(
    rows: Iterable[T], error: Callable[[T], float], speed: Callable[[T], float], noticeable: float = NOTICEABLE
) -> list[T]:
    """Pareto front of error and speed, fastest first; a slower row needs a noticeably smaller error."""
    chosen: list[T] = []
    for row in sorted(rows, key=lambda row: (-speed(row), error(row))):
        if not chosen or error(row) < (1.0 - noticeable) * error(chosen[-1]):
            chosen.append(row)
    return [row for row in chosen if math.isfinite(error(row))]


def path_front(rows: Iterable[Row]) -> list[Row]:
    """Front of the path error that can be promised, fastest first."""
    return front(rows, lambda row: row.promise("path"), lambda row: row.speed)


def any_gait_front(rows: Iterable[Row]) -> list[Row]:
    """Front of the worse of path and gait error that can be promised, fastest first."""
    return front(rows, lambda row: max(row.promise("path"), row.promise("gait")), lambda row: row.speed)


def fronts(rows: Sequence[Row]) -> list[Row]:
    """For every resolution, rows on the front of the path error or of the worse of path and gait, fastest first."""
    chosen: dict[Resolution, Row] = {}
    for mesh in dict.fromkeys(row.mesh for row in rows):
        mine = [row for row in rows if row.mesh == mesh]
        chosen |= {row.resolution: row for row in (*path_front(mine), *any_gait_front(mine))}
    return sorted(chosen.values(), key=lambda row: -row.speed)
