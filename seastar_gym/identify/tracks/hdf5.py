"""HDF5 files of others: all that a file declares is looked at before anything of it is read, by whichever library.

A file of some kB can declare terabytes, unpack to them, or have a library read other files of the user's, by storage
outside, virtual data sets and links. What no tracker writes is refused.
"""

import math
import pickletools
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.files import require_extra

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
