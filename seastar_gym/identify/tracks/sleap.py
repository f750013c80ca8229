"""Analysis files of SLEAP: a CSV file with one line per instance, or HDF5.

The columns of CSV are track, frame_idx, instance.score, and x, y and score of every node, such as hub.x, hub.y,
hub.score. The HDF5 file has `tracks`, shape (n_tracks, 2, n_nodes, n_frames), `node_names` and `track_names`. What was
not seen is empty or NaN. What a file of HDF5 declares is looked at before it is read, see hdf5.py.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seastar_gym.identify.tracks.hdf5 import require_plain
from seastar_gym.identify.tracks.track import NOT_SEEN, Track, chosen_individual
from seastar_gym.scene.checks import require_file, require_number
from seastar_gym.scene.csv_rows import read_table

FIRST = ("track", "frame_idx", "instance.score")
"""First columns of a CSV file."""
ENDINGS = (".h5", ".hdf5")


def read_sleap(file: str | Path, rate: float, individual: str | None = None) -> Track:
    """Track in pixels of an analysis file of SLEAP, .csv, .h5 or .hdf5.

    rate: Pictures per second, which the file does not say [Hz].
    individual: Name of one of several tracks.
    """
    require_file("file", file)
    require_number("rate", rate, "Hz")
    return (_read_hdf5 if Path(file).suffix in ENDINGS else _read_csv)(file, rate, individual)


def _read_csv(file: str | Path, rate: float, individual: str | None) -> Track:
    names, rows = read_table(file)
    columns = {name: column for column, name in enumerate(names)}
    parts = [name[:-2] for name in names if name.endswith(".x") and f"{name[:-2]}.y" in columns]
    if names[:3] != FIRST or not parts or not rows:
        raise ValueError(f"{file}: the first line must be {','.join(FIRST)}, then nodes, as SLEAP writes it.")
    chosen = chosen_individual(file, list(dict.fromkeys(row.fields[0] for row in rows)), individual)
    rows = [row for row in rows if row.fields[0] == chosen]
    for row in rows:
        row.require_fields(len(names))
    numbers = np.array([row._replace(fields=("0", *row.fields[1:])).numbers(NOT_SEEN) for row in rows])
    numbers = numbers[np.argsort(numbers[:, 1], kind="stable")]
    points = {part: numbers[:, [columns[f"{part}.x"], columns[f"{part}.y"]]] for part in parts}
    return Track(numbers[:, 1] / rate, points, {})


def _read_hdf5(file: str | Path, rate: float, individual: str | None) -> Track:
    require_plain(file)
    import h5py

    try:
        with h5py.File(file) as found:
            tracks: NDArray[np.float64] = np.array(found["tracks"], dtype=float)
            parts, known = (_texts(found[name]) for name in ("node_names", "track_names"))
    except (KeyError, OSError, TypeError, ValueError):
        raise ValueError(f"{file} is no analysis file of SLEAP, with tracks, node_names and track_names.") from None
    if tracks.ndim != 4 or tracks.shape[1:3] != (2, len(parts)):
        raise ValueError(f"{file}: tracks must have shape (n_tracks, 2, {len(parts)}, n_frames), not {tracks.shape}.")
    known = known or [str(k) for k in range(len(tracks))]  # a project without tracks has one instance, without a name
    place = known.index(str(chosen_individual(file, known, individual)))
    points = {part: tracks[place, :, k].T for k, part in enumerate(parts)}
    return Track(np.arange(tracks.shape[-1]) / rate, points, {})


def _texts(names: object) -> list[str]:
    """Names of a data set, which h5py reads as bytes."""
    return [name.decode() if isinstance(name, bytes) else str(name) for name in names]  # type: ignore[attr-defined]
