"""Files of trackers of points in videos: DeepLabCut and SLEAP. Both count pictures, and give each point a likelihood.

DeepLabCut writes columns below the lines scorer, (individuals,) bodyparts and coords, as CSV or as a table of pandas in
HDF5. An analysis file of SLEAP is CSV with the columns track, frame_idx, hub.x, hub.y, hub.score, .., or HDF5 with
`tracks`, shape (n_tracks, 2, n_nodes, n_frames), `node_names`, `track_names` and, in newer versions, `point_scores`.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from seastar_gym.files import require_extra
from seastar_gym.identify.tracks.hdf5 import require_plain
from seastar_gym.identify.tracks.table import Table, form_of
from seastar_gym.identify.tracks.track import NOT_SEEN, Track, chosen_individual, likely
from seastar_gym.scene.checks import require_file, require_number, require_within
from seastar_gym.scene.csv_rows import Form, read_rows

Floats = NDArray[np.float64]
Points: TypeAlias = tuple[Floats, Mapping[str, Floats]]
"""Numbers of n pictures, and x, y and likelihood of points by their names, shape (n, 3)."""

HEADERS = ("scorer", "individuals", "bodyparts", "coords")
ENDINGS = (".h5", ".hdf5")
PCUTOFF, PEAK_THRESHOLD = 0.6, 0.2
"""Likelihoods below which a point counts as not seen: defaults of DeepLabCut and of SLEAP."""
UNREADABLE = (AttributeError, LookupError, OSError, RuntimeError, TypeError, ValueError)
"""What libraries raise for files of another form."""


def read_deeplabcut(
    file: str | Path,
    rate: float,
    individual: str | None = None,
    likelihood: float = PCUTOFF,
    separator: str | None = None,
    decimal: str | None = None,
) -> Track:
    """Track in pixels of a file of DeepLabCut, .csv, .h5 or .hdf5.

    rate: Pictures per second, which the file does not say [Hz].
    individual: Name of one of several animals.
    likelihood: Points of a lower likelihood were not seen.
    separator, decimal: Of CSV, see `read_table`.
    """

    def points(file: str | Path, form: Form | None) -> Points:
        headers, numbers = _deeplabcut_hdf5(file) if form is None else _deeplabcut_csv(file, form)
        if not {"bodyparts", "coords"} <= headers.keys() or not len(numbers):
            raise ValueError(f"{file} has no lines scorer, bodyparts and coords with numbers below.")
        animals = headers.get("individuals", [None] * len(headers["coords"]))
        chosen = chosen_individual(file, list(dict.fromkeys(animals)), individual)
        parts: dict[str, dict[str, Floats]] = {}
        columns = zip(animals, headers["bodyparts"], headers["coords"], numbers[:, 1:].T, strict=True)
        for animal, part, coordinate, values in columns:
            if animal == chosen:
                parts.setdefault(part, {})[coordinate] = values
        if not all({"x", "y", "likelihood"} <= of_part.keys() for of_part in parts.values()):
            raise ValueError(f"{file}: every part must have the columns x, y and likelihood.")
        found = {part: np.column_stack([of["x"], of["y"], of["likelihood"]]) for part, of in parts.items()}
        return numbers[:, 0], found

    return _read(file, points, rate, likelihood, separator, decimal)


def read_sleap(
    file: str | Path,
    rate: float,
    individual: str | None = None,
    likelihood: float = PEAK_THRESHOLD,
    separator: str | None = None,
    decimal: str | None = None,
) -> Track:
    """Track in pixels of an analysis file of SLEAP, .csv, .h5 or .hdf5. Arguments as of `read_deeplabcut`."""

    def points(file: str | Path, form: Form | None) -> Points:
        return _sleap_hdf5(file, individual) if form is None else _sleap_csv(file, individual, form)

    return _read(file, points, rate, likelihood, separator, decimal)


def _read(
    file: str | Path,
    points: Callable[[str | Path, Form | None], Points],
    rate: float,
    likelihood: float,
    separator: str | None,
    decimal: str | None,
) -> Track:
    """Track in pixels of what a reader finds; its form is None for HDF5."""
    require_file("file", file)
    require_number("rate", rate, "Hz")
    require_within("likelihood", likelihood, 0.0, 1.0)
    form: Form | None = form_of(separator, decimal)
    if Path(file).suffix.lower() in ENDINGS:
        require_plain(file)
        form = None
    frames, found = points(file, form)
    order = np.argsort(frames, kind="stable")
    seen = {name: likely(of[order, :2], of[order, 2], likelihood) for name, of in found.items()}
    return Track(frames[order] / rate, seen, {}, in_pixels=True)


def _deeplabcut_csv(file: str | Path, form: Form) -> tuple[dict[str, list[str]], Floats]:
    """Headers by their names, and the numbers below, the first of which is the picture's."""
    rows = read_rows(file, form=form)
    n = next((k for k, row in enumerate(rows) if row.fields[0] not in HEADERS), len(rows))
    for row in rows:
        row.require_fields(len(rows[0].fields), "the headers")
    headers = {row.fields[0]: list(row.fields[1:]) for row in rows[:n]}
    return headers, np.array([row.numbers(NOT_SEEN) for row in rows[n:]] if headers else [])


def _deeplabcut_hdf5(file: str | Path) -> tuple[dict[str, list[str]], Floats]:
    """Headers by their names, and the numbers below, of a table of pandas in HDF5."""
    require_extra("Files of DeepLabCut in HDF5", "tracks", "pandas", "tables")
    import pandas as pd

    try:
        table = pd.read_hdf(file)
        names = table.columns.names
        headers = {name: list(map(str, table.columns.get_level_values(name))) for name in names}
        return headers, np.column_stack([table.index, table]).astype(float)
    except UNREADABLE:
        raise ValueError(f"{file} has no table of DeepLabCut that pandas reads.") from None


def _sleap_csv(file: str | Path, individual: str | None, form: Form) -> Points:
    table = Table.read(file, form)
    scores = [name for name in table.names if name.endswith(".score") and name != "instance.score"]
    parts = [name.removesuffix(".score") for name in scores]
    if not {"track", "frame_idx"}.issubset(table.names) or not parts:
        raise ValueError(f"{file}: the first line must be track,frame_idx,.. and x, y and score of nodes.")
    chosen = chosen_individual(file, list(dict.fromkeys(table.texts("track"))), individual)
    table = table.only({"track": str(chosen)})
    found = {part: table.numbers(f"{part}.x", f"{part}.y", f"{part}.score") for part in parts}
    return table.numbers("frame_idx", are_known=True)[:, 0], found


def _sleap_hdf5(file: str | Path, individual: str | None) -> Points:
    import h5py

    try:
        with h5py.File(file) as found:
            tracks: Floats = np.array(found["tracks"], dtype=float)
            known_scores = "point_scores" in found
            scores = np.array(found["point_scores"], float) if known_scores else np.full_like(tracks[:, 0], np.nan)
            parts, known = ([_text(name) for name in found[names]] for names in ("node_names", "track_names"))
    except UNREADABLE:
        raise ValueError(f"{file} is no analysis file of SLEAP, with tracks, node_names and track_names.") from None
    if tracks.shape[1:-1] != (2, len(parts)) or scores.shape != tracks[:, 0].shape:
        raise ValueError(f"{file}: tracks must have shape (n_tracks, 2, {len(parts)}, n_frames), not {tracks.shape}.")
    known = known or [str(k) for k in range(len(tracks))]  # a project without tracks has one instance, without a name
    chosen = known.index(str(chosen_individual(file, known, individual)))
    points = {part: np.column_stack([*tracks[chosen, :, k], scores[chosen, k]]) for k, part in enumerate(parts)}
    return np.arange(tracks.shape[-1], dtype=float), points


def _text(name: object) -> str:
    """Name in a data set, which h5py reads as bytes."""
    return name.decode() if isinstance(name, bytes) else str(name)
