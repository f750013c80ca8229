"""Results of swims: a row of numbers for each, their means with intervals, and tables of them, as text and as CSV.

Intervals of means are by bootstrap.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.evaluation.swim import Swim
from seastar_gym.files import beside

Floats = NDArray[np.float64]

CONFIDENCE, RESAMPLES = 0.95, 2000
FEWEST = 3
"""Trainings of a learner below which its mean has no interval: seeds differ by more than episodes."""


class Estimate(NamedTuple):
    """A mean, and the ends of its interval, NaN for one value, and for a learner with fewer than FEWEST trainings."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        form = ".1f" if abs(self.mean) >= 10.0 else ".3g"
        return f"{self.mean:{form}}" + ("" if np.isnan(self.low) else f" [{self.low:{form}}, {self.high:{form}}]")


def mean_with_interval(values: ArrayLike) -> Estimate:
    """Mean of values and the ends of its bootstrap confidence interval; NaN for no values, and ends of a single one.

    >>> print(mean_with_interval([150.0, 160.0, 155.0, 170.0]))
    158.8 [152.5, 166.2]
    """
    values = np.asarray(values, float)
    if len(values) < 2:
        return Estimate(float(values.mean()) if len(values) else np.nan, np.nan, np.nan)
    if np.ptp(values) == 0.0:
        return Estimate(*[float(values[0])] * 3)
    return Estimate(float(values.mean()), *_bootstrapped((values,), np.mean, batch=100))


def over_trainings(means: ArrayLike) -> Estimate:
    """Mean of a learner, by the means of its trainings, and its interval over seeds; NaN ends for fewer than FEWEST.

    >>> print(over_trainings([150.0, 170.0]), "and", over_trainings([150.0, 160.0, 170.0]))
    160.0 and 160.0 [150.0, 170.0]
    """
    found = mean_with_interval(means)
    return found if np.size(means) >= FEWEST else Estimate(found.mean, np.nan, np.nan)


def interquartile_mean(samples: Sequence[ArrayLike]) -> Estimate:
    """Mean of the middle half of all scores, and its interval by a bootstrap of the seeds within every task.

    samples: Scores of every task's seeds. The ends are NaN where a task has fewer than FEWEST (Agarwal et al., 2021).
    """
    from scipy.stats import trim_mean

    tasks = [np.asarray(scores, float) for scores in samples]

    def of_all(*parts: Floats, axis: int = -1) -> Any:
        return trim_mean(np.concatenate(parts, axis=axis), 0.25, axis=axis)

    mean = float(of_all(*tasks)) if tasks else np.nan
    if not tasks or min(map(len, tasks)) < FEWEST:
        return Estimate(mean, np.nan, np.nan)
    if all(np.ptp(scores) == 0.0 for scores in tasks):
        return Estimate(mean, mean, mean)
    return Estimate(mean, *_bootstrapped(tuple(tasks), of_all, vectorized=True))


def probability_of_improvement(ours: Sequence[ArrayLike], theirs: Sequence[ArrayLike]) -> float:
    """Probability that a seed of ours scores more than one of theirs, the mean over tasks; equal ones count half.

    >>> probability_of_improvement([[1.0, 2.0]], [[1.0, 0.0]])
    0.875
    """
    each = [
        np.mean((np.sign(np.subtract.outer(np.asarray(a, float), np.asarray(b, float))) + 1.0) / 2.0)
        for a, b in zip(ours, theirs, strict=True)
    ]
    return float(np.mean(each))


SEEN_BY_TEN = 2.96 * np.sqrt(2.0 / 10.0)
"""Smallest difference of two means over ten seeds that a t-test of 5 % finds with a power of 80 %, in standard
deviations of a seed: the sum of both quantiles of t with 18 degrees of freedom, times that of the difference."""


def smallest_difference(scores: ArrayLike) -> float:
    """Smallest difference that ten seeds can see, by the scores of some; NaN for fewer than FEWEST."""
    scores = np.asarray(scores, float)
    return float(SEEN_BY_TEN * scores.std(ddof=1)) if scores.size >= FEWEST else float("nan")


def difference_of_episodes(first: ArrayLike, second: ArrayLike) -> Estimate:
    """Mean of a second set of episodes less that of the first, and its interval over trainings and episodes.

    first, second: A row for every training, the same in both, of shapes (T, E) and (T, F). The bootstrap draws
    trainings, and the episodes of either set; NaN ends for fewer than FEWEST trainings, and for a set of one episode.

    >>> print(difference_of_episodes([[1.0, 2.0]] * 3, [[2.0, 4.0]] * 3))
    1.5 [0, 3]
    """
    first, second = np.asarray(first, float), np.asarray(second, float)

    def between(trainings: Any, ours: Any, theirs: Any) -> Any:
        return second[trainings][:, theirs].mean() - first[trainings][:, ours].mean()

    drawn = tuple(np.arange(n) for n in (len(first), first.shape[1], second.shape[1]))
    has_ends = len(first) >= FEWEST and min(first.shape[1], second.shape[1]) > 1
    ends = _bootstrapped(drawn, between, vectorized=False) if has_ends else (np.nan, np.nan)
    return Estimate(float(between(*drawn)), *ends)


def _bootstrapped(samples: tuple[NDArray[Any], ...], statistic: Callable[..., Any], **how: Any) -> tuple[float, float]:
    """Ends of the interval of a statistic of samples, each of which is drawn anew."""
    from scipy.stats import bootstrap

    found = bootstrap(
        samples, statistic, confidence_level=CONFIDENCE, n_resamples=RESAMPLES, method="percentile",
        rng=np.random.default_rng(0), **how,
    ).confidence_interval  # fmt: skip
    return float(found.low), float(found.high)


Row = dict[str, str | int | float | None]

MM = 1000.0
"""Millimetres in a metre."""

OF_SWIMS: dict[str, Callable[[Swim], int | float | None]] = {
    "strokes_to_finish": lambda done: done.strokes if done.finished else None,
    "simulated_time_s": lambda done: float(done.time[-1]),
    "waypoints_reached": lambda done: done.waypoints_reached,
    "waypoints": lambda done: len(done.waypoints),
    "mean_cross_track_error_mm": lambda done: MM * float(done.cross_track_errors.mean()),
    "largest_cross_track_error_mm": lambda done: MM * float(done.cross_track_errors.max()),
    "limbs_heated_per_metre": lambda done: done.heated_per_metre,
    "heating_time_s": lambda done: done.seconds_heated,
    "energy_per_metre_J": lambda done: done.joules_per_metre,
}
"""Measures of a swim, by the names of the CSV; None where there is no number, as for an unfinished swim."""
MEANS = (
    "strokes_to_finish", "mean_cross_track_error_mm", "limbs_heated_per_metre", "simulated_time_s",
    "energy_per_metre_J",
)  # fmt: skip
"""Those whose means tell of many swims, besides the rate of success."""

COLUMNS = {
    "agent": "agent",
    "strokes_to_finish": "strokes\nto\nfinish",
    "simulated_time_s": "time\n[s]",
    "waypoints_reached": "waypoints\nreached",
    "mean_cross_track_error_mm": "mean\ncross-track\nerror [mm]",
    "largest_cross_track_error_mm": "largest\ncross-track\nerror [mm]",
    "limbs_heated_per_metre": "limbs\nheated\n[1/m]",
    "energy_per_metre_J": "energy\n[J/m]",
}
"""Titles of the printed columns, by the names of the CSV's."""


def results(swims: Sequence[Swim]) -> list[Row]:
    """Rows of the table, by the names of the CSV."""
    return [{"agent": done.agent, **{name: of(done) for name, of in OF_SWIMS.items()}} for done in swims]


def time_series(swims: Sequence[Swim]) -> list[Row]:
    """Rows of every swim at its start and after every stroke, by the names of a CSV; heat is that of the stroke."""
    return [
        {
            "agent": done.agent, "stroke": k, "time_s": float(done.time[k]),
            "hub_x_m": float(done.hub[k, 0]), "hub_y_m": float(done.hub[k, 1]),
            "waypoints_reached": int(done.waypoint_index[k]),
            "limbs_heated": int(done.limbs_heated[k - 1]) if k else 0,
            "heating_time_s": float(done.heating_time[k - 1]) if k else 0.0,
            "energy_J": float(done.energy[k - 1]) if k else 0.0,
        }
        for done in swims for k in range(done.strokes + 1)
    ]  # fmt: skip


def statistics(swims: Sequence[Swim]) -> dict[str, Estimate]:
    """Mean measures of a set of swims, by name, with intervals; strokes and seconds are those of finished swims."""
    finished = [done for done in swims if done.finished]
    found = {"success_rate": mean_with_interval([done.finished for done in swims])}
    for name in MEANS:
        values = map(OF_SWIMS[name], finished if name == "simulated_time_s" else swims)
        found[name] = mean_with_interval([value for value in values if value is not None])
    return found


def in_words(swims: Sequence[Swim]) -> list[Row]:
    """Rows of `results` with the waypoints reached in words."""
    return [{**row, "waypoints_reached": f"{row['waypoints_reached']} of {row['waypoints']}"} for row in results(swims)]


def write_csv(rows: Sequence[Mapping[str, Any]], file: Path) -> None:
    """Write rows with the same names as CSV."""
    with beside(file) as part, part.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def columns_of(swims: Sequence[Swim]) -> dict[str, str]:
    """`COLUMNS`, which count strokes if all swims do, otherwise decisions."""
    if {done.counted_in for done in swims} == {"strokes"}:
        return COLUMNS
    return {name: title.replace("strokes", "decisions") for name, title in COLUMNS.items()}


def as_text(swims: Sequence[Swim]) -> str:
    """Table of the results, for a terminal."""
    titles = [*columns_of(swims).values()]
    return text_table(titles, [[number(row[name]) for name in COLUMNS] for row in in_words(swims)])


def text_table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Table whose first column stands on the left, the others on the right; titles may have several lines."""
    heads = [title.split("\n") for title in titles]
    height = max(map(len, heads))
    lines = [*zip(*([""] * (height - len(head)) + head for head in heads), strict=True), *rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(titles))]
    texts = [[cell.rjust(width) for cell, width in zip(line, widths, strict=True)] for line in lines]
    return "\n".join("  ".join([line[0].strip().ljust(widths[0]), *line[1:]]).rstrip() for line in texts)


def number(value: Any) -> str:
    """A number of a table as it is shown; a dash for none."""
    if value is None:
        return "\u2013"
    return f"{value:.1f}" if isinstance(value, float) else str(value)
