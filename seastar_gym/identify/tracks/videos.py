"""Files of trackers of points in videos: DeepLabCut and SLEAP. Both count pictures, and give each point a likelihood.

DeepLabCut writes columns below the lines scorer, (individuals,) bodyparts and coords, as CSV or as a table of pandas in
HDF5. An analysis file of SLEAP is CSV with the columns track, frame_idx, hub.x, hub.y, hub.score, .., or HDF5 with
`tracks`, shape (n_tracks, 2, n_nodes, n_frames), `node_names`, `track_names` and, in newer versions, `point_scores`.

All that a file of HDF5 declares is looked at before anything of it is read, by whichever library. A file of some kB can
declare terabytes, unpack to them, or have a library read other files of the user's, by storage outside, virtual data
sets and links. What no tracker writes is refused.
"""

import math
import pickletools
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from seastar_gym.files import Form, read_rows, require_extra
from seastar_gym.identify.tracks.table import Table, form_of
from seastar_gym.identify.tracks.track import NOT_SEEN, Track, chosen_individual, likely
from seastar_gym.scene.checks import require_file, require_number, require_within

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


LARGEST = 2**31
"""Most bytes that all data sets and attributes of a file may declare."""
PACKED, SLACK = 1100, 2**20
"""Most bytes that may be declared for a byte of the file, of which gzip makes 1,032 at most, and for any file."""
MOST = 1000
"""Most data sets, folders and attributes of a file, and most texts of a data set that does not say their lengths."""
LONGEST = 1_000_000
"""Most bytes of those texts together."""
DEFLATE, SHUFFLE, CHECKSUM = 1, 2, 3
"""Filters of HDF5 that data sets may have."""

CALLING = {"GLOBAL", "STACK_GLOBAL", "INST", "EXT1", "EXT2", "EXT4", "PERSID", "BINPERSID"}
"""Codes of pickles that are more than numbers, texts and lists."""


class _RefusedError(Exception):
    """What a file has that no tracker writes, to end a sentence with."""


def require_plain(file: str | Path) -> None:
    """FileNotFoundError or ValueError, with one sentence, for what is no HDF5 file or could do harm when it is read."""
    require_extra("HDF5 files", "tracks", "h5py")
    import h5py

    if not Path(file).is_file():
        raise FileNotFoundError(f"There is no file {file}.")
    try:
        with h5py.File(file, "r") as found:
            _look(found, Path(file).stat().st_size)
    except _RefusedError as refused:
        raise ValueError(f"{file} is refused before it is read: {refused}.") from None
    except (OSError, RuntimeError, LookupError, TypeError, ValueError, zlib.error):
        raise ValueError(f"{file} is no HDF5 file that can be read.") from None


def _look(file: Any, size: int) -> None:
    """Look at everything in a file of a size [bytes]."""
    import h5py

    waiting, known, datasets, texts = [file], set[int](), list[Any](), list[Any]()
    n, declared, room = 0, 0, min(LARGEST, PACKED * size + SLACK)
    while waiting:
        found = waiting.pop()
        address = h5py.h5o.get_info(found.id).addr
        if address in known:
            continue
        known.add(address)
        n += h5py.h5a.get_num_attrs(found.id) + (len(found) if isinstance(found, h5py.Group) else 0)
        if n > MOST:
            raise _RefusedError(f"it has more than {MOST:,} data sets, folders and attributes")
        for k in range(h5py.h5a.get_num_attrs(found.id)):
            attribute = h5py.h5a.open(found.id, index=k)
            of_one = size if _is_text(attribute) else _bytes_of(attribute.get_type(), f"an attribute of {found.name}")
            declared += of_one * math.prod(attribute.shape or ())
            texts.append((found, attribute.name))
        if isinstance(found, h5py.Group):
            waiting += [_linked(found, name) for name in found]
        elif isinstance(found, h5py.Dataset):
            declared += _declared(found)
            datasets.append(found)
        else:
            raise _RefusedError(f"{found.name} is neither a folder nor a data set")
        if declared > room:
            raise _RefusedError(f"with {found.name} it declares {declared:,} bytes; for its size {room:,} are the most")
    for found, name in texts:
        if _imports(found.attrs[name]):
            raise _RefusedError(f"an attribute of {found.name} is a pickle that would run code")
    for found in datasets:
        _require_texts_short(found)
        _require_unpacked_as_declared(found)


def _imports(value: object) -> bool:
    """Whether a library that unpickles texts, as PyTables does those that end with a point, would import for this."""
    if not isinstance(value, bytes) or not value.endswith(b"."):
        return False
    try:
        return any(code.name in CALLING for code, *_ in pickletools.genops(value))
    except ValueError:
        return False


def _linked(group: Any, name: str) -> Any:
    """What is in a folder by a name, unless by a link to elsewhere."""
    import h5py

    if type(group.get(name, getlink=True)) is not h5py.HardLink:
        raise _RefusedError(f"{name} is a link to elsewhere")
    return group[name]


def _declared(dataset: Any) -> int:
    """Bytes that the data of a data set in the file take, or one of its chunks; not those of texts of any length."""
    import h5py

    how = dataset.id.get_create_plist()
    if how.get_layout() == h5py.h5d.VIRTUAL or how.get_external_count():
        raise _RefusedError(f"{dataset.name} has its data in other files")
    chunk = how.get_chunk() if how.get_layout() == h5py.h5d.CHUNKED else ()
    numbers = 0 if dataset.shape is None else max(math.prod(dataset.shape), math.prod(chunk))
    if _is_text(dataset.id):
        if numbers > MOST:
            raise _RefusedError(f"{dataset.name} has more than {MOST:,} texts of any length")
        return numbers
    return numbers * _bytes_of(dataset.id.get_type(), dataset.name)


def _is_text(data: Any) -> bool:
    """Whether a data set or an attribute has texts whose lengths it does not declare."""
    import h5py

    kind = data.get_type()
    return bool(kind.get_class() == h5py.h5t.STRING and kind.is_variable_str())


def _bytes_of(kind: Any, name: str) -> int:
    """Bytes of one entry of a type. Objects, references and rows of any length are refused, also within it."""
    from h5py import h5t

    of_class, parts = kind.get_class(), []
    if of_class == h5t.COMPOUND:
        parts = [kind.get_member_type(k) for k in range(kind.get_nmembers())]
    elif of_class == h5t.ARRAY:
        parts = [kind.get_super()]
    elif of_class not in (h5t.INTEGER, h5t.FLOAT, h5t.STRING, h5t.BITFIELD, h5t.ENUM) or (
        of_class == h5t.STRING and kind.is_variable_str()
    ):
        raise _RefusedError(f"{name} has objects, references or rows of any length")
    for part in parts:
        _bytes_of(part, name)
    return int(kind.get_size())


def _require_texts_short(dataset: Any) -> None:
    """Read texts of any length one by one: many can be the same place of the file."""
    if _is_text(dataset.id) and dataset.shape is not None:
        length = 0
        for place in np.ndindex(dataset.shape):
            length += len(dataset[place])
            if length > LONGEST:
                raise _RefusedError(f"the texts of {dataset.name} are longer than {LONGEST:,} bytes")


def _require_unpacked_as_declared(dataset: Any) -> None:
    """Unpack every chunk as far as it is declared: HDF5 itself unpacks to the end, however far that is."""
    how, chunks = dataset.id.get_create_plist(), list[Any]()
    filters = [how.get_filter(k)[0] for k in range(how.get_nfilters())]
    behind = filters[filters.index(DEFLATE) + 1 :] if DEFLATE in filters else []
    if not {DEFLATE, SHUFFLE, CHECKSUM}.issuperset(filters) or not {CHECKSUM}.issuperset(behind):
        raise _RefusedError(f"{dataset.name} is packed in another way than once by gzip")
    if DEFLATE not in filters:
        return
    dataset.id.chunk_iter(chunks.append)
    size = math.prod(how.get_chunk()) * dataset.id.get_type().get_size() + 4 * len(filters)  # with checksums
    for chunk in chunks:
        mask, packed = dataset.id.read_direct_chunk(chunk.chunk_offset)
        unpacking = zlib.decompressobj()
        if mask >> filters.index(DEFLATE) & 1 == 0:
            unpacking.decompress(packed, size)
            if not unpacking.eof and unpacking.decompress(unpacking.unconsumed_tail, 1):
                raise _RefusedError(f"{dataset.name} unpacks to more than it declares")
