"""Files that are written all at once, or line by line, never through a link; and JSON files of others.

Also what is said of optional dependencies that are missing: a sentence with the command that installs them.
"""

import errno
import json
import math
import os
import re
import secrets
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from io import FileIO
from pathlib import Path
from typing import Any

LARGEST_FILE = 2**30
"""Size of the largest file that is read whole [bytes]."""
PART = ".part"
"""End of the names of files that are being written."""


def write_atomically(path: str | os.PathLike[str], data: bytes | str) -> None:
    """Write a file: whoever looks at `path`, after a crash too, finds the old file or the new one, never half a file.

    data: Text is written in UTF-8.
    """
    with beside(path) as part:
        part.write_bytes(data.encode() if isinstance(data, str) else data)


def as_line(fields: Iterable[object]) -> str:
    """Line of a CSV file whose fields need no quotes."""
    return ",".join(map(str, fields)) + "\n"


def write_lines(path: str | os.PathLike[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a CSV file all at once, see `as_line`."""
    write_atomically(path, "".join(map(as_line, rows)))


class LineFile:
    """A CSV file that is written line by line, so that what was known is there whatever happens.

    path: Where it is written anew; a link is replaced. OSError, here and with every line, where the disk refuses.
    """

    def __init__(self, path: str | os.PathLike[str]):
        with beside(path):
            pass
        flags = getattr(os, "O_NOFOLLOW", 0)
        self._file = FileIO(os.fspath(path), "a", opener=lambda name, mode: os.open(name, mode | flags))

    def add(self, fields: Iterable[object]) -> None:
        """Write a line, see `as_line`."""
        line = as_line(fields).encode()
        if self._file.write(line) != len(line):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), self._file.name)

    def close(self) -> None:
        """Close the file; may be called again."""
        self._file.close()


def within(folder: str | os.PathLike[str], *names: str) -> Path:
    """Path of a folder within one of results. ValueError where it is a link, or behind one: none is written to."""
    path = Path(folder)
    for name in names:
        path = path / name
        if path.is_symlink():
            raise ValueError(f"{path} is a link, and nothing is written through links: take it out.")
    return path


def write_json(path: str | os.PathLike[str], data: object) -> None:
    """Write data as JSON; what JSON does not know, such as a path, is written as text."""
    write_atomically(path, json.dumps(data, indent=2, default=str) + "\n")


def save_figure(figure: Any, path: str | os.PathLike[str], **options: Any) -> None:
    """Draw a figure of matplotlib into a file, in the format of its ending."""
    with beside(path) as part:
        figure.savefig(part, format=Path(path).suffix[1:].lower() or "png", **options)


@contextmanager
def beside(path: str | os.PathLike[str], ending: str = PART) -> Iterator[Path]:
    """An empty file beside `path`, to write to. It takes its place at the end, when it is on the disk.

    Whatever goes wrong before, an interrupt too, leaves `path` as it was and nothing beside it. A link at `path` is
    replaced, and the file that it points to stays as it is. OSError, with one sentence, for a folder or a device.

    ending: Of the name of the file beside, for libraries that choose a format by it.
    """
    path = Path(path)
    if path.exists() and not path.is_file():
        raise FileExistsError(f"{path} is no file that can be written over.")
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(part_name(path.name, ending))
    part.open("xb").close()  # a new file: what is there, a link too, is refused
    try:
        yield part
        _to_disk(part)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def part_name(name: str, ending: str = PART) -> str:
    """Name that no other process, and no other thread, writes a file of this name under."""
    return f".{name}.{os.getpid()}.{secrets.token_hex(4)}{ending}"


def is_left_behind(file: Path) -> bool:
    """Whether a file is what a process was writing that has ended since. Files that others named so are not ours."""
    written_by = re.fullmatch(rf"\..+\.(\d+)\.[0-9a-f]{{8}}{re.escape(PART)}", file.name)
    return written_by is not None and file.is_file() and not Path("/proc", written_by[1]).exists()


def is_part_of(file: Path, name: str) -> bool:
    """Whether a file is what a process that was killed left of a file of this name."""
    return file.name.startswith(f".{name}.") and file.name.endswith(PART)


def _to_disk(file: Path) -> None:
    descriptor = os.open(file, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def read_whole(path: str | os.PathLike[str]) -> bytes:
    """Contents of a file. ValueError, with one sentence, for one that is too large."""
    size = Path(path).stat().st_size
    if size > LARGEST_FILE:
        raise ValueError(f"{path} has {size:,} bytes: {LARGEST_FILE:,} are the most that is read.")
    return Path(path).read_bytes()


def read_json(path: str | os.PathLike[str]) -> Any:
    """Contents of a JSON file, whose numbers are all finite.

    FileNotFoundError or ValueError, with one sentence, where there are none.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"There is no file {path}.")
    data = read_whole(path)
    try:
        return parse_json(data.decode("utf-8-sig"))
    except ValueError as damaged:
        reason = re.split("[;\n]", str(damaged))[0].rstrip(".")
        raise ValueError(f"{path} is no JSON that can be read: {reason}.") from damaged


def parse_json(text: str) -> Any:
    """What a text in JSON says, whose numbers are all finite. ValueError, with the reason alone, for any other."""
    try:
        return json.loads(text, parse_constant=_finite, parse_float=_finite)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:40]} is no finite number")
    return number


class MissingExtra(ModuleNotFoundError):  # noqa: N818, what it is a kind of is named so
    """A module of an extra is missing; its text is a sentence with the command that installs it."""


def require_extra(who: str, extra: str, *modules: str) -> None:
    """End a command `python -m ..` with a sentence where modules of an extra are missing; else MissingExtra.

    who: Who needs them, in the plural: "The studies".
    """
    missing = [name for name in modules if find_spec(name) is None]
    if not missing:
        return
    sentence = f'{who} need {", ".join(missing)}: pip install "seastar-gym[{extra}]".'
    if is_command():
        sys.exit(sentence)
    raise MissingExtra(sentence, name=missing[0])


def is_command() -> bool:
    """Whether the packages of a module are being imported that will be run by `python -m`."""
    return sys.argv[:1] == ["-m"]
