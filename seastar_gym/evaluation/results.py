"""Results of an evaluation: a row of numbers for every swim, as text and as CSV."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from seastar_gym.evaluation.swim import Swim
from seastar_gym.files import beside

MM = 1000.0
"""Millimetres in a metre."""

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


def results(swims: Sequence[Swim]) -> list[dict[str, str | int | float | None]]:
    """Rows of the table, by the names of the CSV; None where there is no number, as for an unfinished swim."""
    return [
        {
            "agent": done.agent,
            "strokes_to_finish": done.strokes if done.finished else None,
            "simulated_time_s": float(done.time[-1]),
            "waypoints_reached": done.waypoints_reached,
            "waypoints": len(done.waypoints),
            "mean_cross_track_error_mm": MM * float(done.cross_track_errors.mean()),
            "largest_cross_track_error_mm": MM * float(done.cross_track_errors.max()),
            "limbs_heated_per_metre": done.heated_per_metre,
            "heating_time_s": done.seconds_heated,
            "energy_per_metre_J": done.joules_per_metre,
        }
        for done in swims
    ]


def in_words(swims: Sequence[Swim]) -> list[dict[str, str | int | float | None]]:
    """Rows of `results` with the waypoints reached in words."""
    return [{**row, "waypoints_reached": f"{row['waypoints_reached']} of {row['waypoints']}"} for row in results(swims)]


def write_csv(swims: Sequence[Swim], file: Path) -> None:
    """Write the rows of `results` as CSV."""
    rows = results(swims)
    with beside(file) as part, part.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def as_text(swims: Sequence[Swim]) -> str:
    """Table of the results, for a terminal."""
    rows = [[number(row[name]) for name in COLUMNS] for row in in_words(swims)]
    return text_table(list(COLUMNS.values()), rows)


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
