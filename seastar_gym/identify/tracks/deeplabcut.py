"""CSV files of DeepLabCut: three lines of headers, scorer, bodyparts and coords, then a line for every picture.

Files of several animals have a fourth header, individuals, above bodyparts. The first column is the picture's number,
the others are x and y [pixel] and the likelihood of every part.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from seastar_gym.identify.tracks.track import NOT_SEEN, Track, chosen_individual
from seastar_gym.scene.checks import require_file, require_number, require_within
from seastar_gym.scene.csv_rows import Row, read_rows

HEADERS = ("scorer", "individuals", "bodyparts", "coords")
LIKELIHOOD = 0.6
"""Likelihood below which a point counts as not seen; DeepLabCut's own default of `pcutoff`."""


def read_deeplabcut(
    file: str | Path, rate: float, individual: str | None = None, likelihood: float = LIKELIHOOD
) -> Track:
    """Track in pixels of a file of DeepLabCut.

    rate: Pictures per second, which the file does not say [Hz].
    individual: Name of one of several animals.
    likelihood: Points of a lower likelihood were not seen.
    """
    require_file("file", file)
    require_number("rate", rate, "Hz")
    require_within("likelihood", likelihood, 0.0, 1.0)
    headers: dict[str, tuple[str, ...]] = {}
    rows = read_rows(file)
    while rows and rows[0].fields[0] in HEADERS:
        headers[rows[0].fields[0]] = rows[0].fields[1:]
        rows = rows[1:]
    if not {"bodyparts", "coords"} <= headers.keys() or not rows:
        raise ValueError(f"{file} has no lines scorer, bodyparts and coords with numbers below, as DeepLabCut writes.")
    columns = _columns(file, headers, individual)
    frames = np.array([_frame(row, len(headers["coords"]) + 1) for row in rows])
    points = {}
    for part, (x, y, sure) in columns.items():
        points[part] = np.where(frames[:, [sure]] >= likelihood, frames[:, [x, y]], np.nan)
    return Track(frames[:, 0] / rate, points, {})


def _columns(file: str | Path, headers: dict[str, tuple[str, ...]], individual: str | None) -> dict[str, Sequence[int]]:
    """Columns of x, y and likelihood of every part of one animal."""
    animals = headers.get("individuals", (None,) * len(headers["coords"]))
    chosen = chosen_individual(file, list(dict.fromkeys(animals)), individual)
    found: dict[str, dict[str, int]] = {}
    each = zip(animals, headers["bodyparts"], headers["coords"], strict=False)
    for column, (animal, part, coordinate) in enumerate(each, start=1):
        if animal == chosen:
            found.setdefault(part, {})[coordinate] = column
    if not all({"x", "y", "likelihood"} <= of_part.keys() for of_part in found.values()):
        raise ValueError(f"{file}: every part must have the columns x, y and likelihood.")
    return {part: [of_part[name] for name in ("x", "y", "likelihood")] for part, of_part in found.items()}


def _frame(row: Row, n_fields: int) -> list[float]:
    """Number of a picture and its coordinates."""
    row.require_fields(n_fields, "the headers")
    return row.numbers(NOT_SEEN)
