"""Files that are written all at once, or line by line, never through a link; and JSON and CSV files of others.

A CSV file that cannot be read is refused in one sentence with its name and the line. Fields are separated by commas,
numbers have a decimal point, and the text is UTF-8, with a byte order mark or without. Where the first line has
semicolons or tabs, as spreadsheets of many countries write them, those separate, and decimals may follow a comma. Empty
lines are skipped. The first line may hold names, each of which begins with a letter and has no digit. A mistyped line
of numbers is therefore an error, not a header. Names may end with a unit: "time (ms)".

Also what is said of optional dependencies that are missing: a sentence with the command that installs them.
"""

import csv
import errno
import io
import itertools
import json
import math
import os
import re
import secrets
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from io import FileIO
from pathlib import Path
from typing import Any, NamedTuple

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


def require_writable(folder: str | os.PathLike[str]) -> None:
    """Make a folder for files that are written later. OSError, now, where the disk refuses."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    probe = Path(folder, part_name("probe"))
    probe.open("xb").close()
    probe.unlink()


def require_place(path: str | os.PathLike[str] | None) -> None:
    """Make the folder of a file that is written later, None for none. OSError, now, where it could not be written."""
    if path is None:
        return
    _require_replaceable(Path(path))
    require_writable(Path(path).parent)


def _require_replaceable(path: Path) -> None:
    if path.exists() and not path.is_file():
        raise FileExistsError(f"{path} is no file that can be written over.")


@contextmanager
def beside(path: str | os.PathLike[str], ending: str = PART) -> Iterator[Path]:
    """An empty file beside `path`, to write to. It takes its place at the end, when it is on the disk.

    Whatever goes wrong before, an interrupt too, leaves `path` as it was and nothing beside it. A link at `path` is
    replaced, and the file that it points to stays as it is. OSError, with one sentence, for a folder or a device.

    ending: Of the name of the file beside, for libraries that choose a format by it.
    """
    path = Path(path)
    _require_replaceable(path)
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


NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
NAME = re.compile(r"[^\W\d_]\D*")
NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
QUOTED = re.compile(r'"[^"]*"')
UNIT = re.compile(r".*(?:[(\[]\s*(?P<bracketed>[^()\[\]]+?)\s*[)\]]|[._](?P<last>[^\W_]+))")
"""Name with a unit, in brackets or after an underscore or a point."""
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0, "degrees": math.pi / 180.0},
}
"""Units in seconds, metres and radians."""
MOST_ROWS = 1_000_000
"""Most lines of a file."""
LONGEST_SHOWN = 40
"""Largest number of characters of a field in a sentence."""


class Form(NamedTuple):
    """How a file is written. None stands for what its first line tells.

    separator: Character between fields. decimal: Sign before decimals, "." or ",". skip: Lines before the first one.
    """

    separator: str | None = None
    decimal: str | None = None
    skip: int = 0


class Row(NamedTuple):
    """Fields of one line.

    where: File and line for sentences, such as "curve.csv, line 3". has_commas: Whether decimals follow a comma.
    """

    where: str
    fields: tuple[str, ...]
    has_commas: bool = False

    def refused(self, reason: str) -> ValueError:
        """Error that names the line and the reason."""
        return ValueError(f"{self.where}: {reason}.")

    def require_fields(self, n_fields: int, like: str = "the first one") -> None:
        """Refuse a line that has not so many fields. like: Lines that have, for the sentence."""
        if len(self.fields) != n_fields:
            raise self.refused(f"the line must have {n_fields} fields, as {like}, not {len(self.fields)}")

    def has_names(self) -> bool:
        """Whether every field is a name: it begins with a letter, has no digit and is neither nan nor inf."""
        return all(NAME.fullmatch(field) and not NOT_FINITE.fullmatch(field) for field in self.fields)

    def numbers(self, missing: Collection[str] = ()) -> list[float]:
        """Numbers of the line, all finite, but NaN for fields that are one of the words `missing`, in any case."""
        return [math.nan if field.lower() in missing else self._number(field) for field in self.fields]

    def integers(self) -> list[int]:
        """Numbers of the line, all whole."""
        numbers = self.numbers()
        if not all(map(float.is_integer, numbers)):
            raise self.refused("its numbers must be whole")
        return [int(number) for number in numbers]

    def _number(self, field: str) -> float:
        text = field.replace(",", ".") if self.has_commas else field
        if NOT_FINITE.fullmatch(text) or (NUMBER.fullmatch(text) and math.isinf(float(text))):
            raise self.refused(f"{_quoted(field)} is no finite number")
        if not NUMBER.fullmatch(text):
            hint = ", decimals follow a point" if "," in text else ""
            raise self.refused(f"{_quoted(field)} is no number{hint}")
        return float(text)


def unit_of(name: str) -> str | None:
    """Unit at the end of a name, such as "ms" of "time (ms)"; None where there is none, or one of no quantity."""
    match = UNIT.fullmatch(name)
    unit = None if match is None else match["bracketed"] or match["last"]
    return unit if any(unit in known for known in UNITS.values()) or (match and match["bracketed"]) else None


def read_rows(file: str | Path, most: int = MOST_ROWS, form: Form = Form()) -> list[Row]:
    """All lines of a file that are not empty. FileNotFoundError or ValueError if it cannot be read.

    most: Most lines that it may have.
    """
    if not Path(file).is_file():
        raise FileNotFoundError(f"There is no file {file}.")
    rows = list(itertools.islice((row for row in _rows(file, form) if row.fields not in ((), ("",))), most + 1))
    if len(rows) > most:
        raise ValueError(f"{file} has more than {most:,} lines, which are the most that is read.")
    return rows


def read_table(file: str | Path) -> tuple[tuple[str, ...], list[Row]]:
    """Names in the first line of a file, none if it is empty, and the lines below; otherwise as `read_rows`."""
    rows = read_rows(file)
    return (rows[0].fields if rows else ()), rows[1:]


def read_numbers(
    file: str | Path,
    columns: str,
    n_columns: int | None = None,
    most: int = MOST_ROWS,
    units: Sequence[Mapping[str, float]] = (),
) -> list[list[float]]:
    """Numbers of all lines, equally many in each, without the first line if it holds names.

    columns: Content of a line for sentences, such as "a time [s] and an angle [rad]".
    n_columns: Numbers per line. None means as many as fields in the first line. most: Most lines.
    units: For every column, the units that its name may end with, and what they are in ours. Without any, a unit does
        not count.
    """
    names, lines = read_named_numbers(file, columns, n_columns, most)
    for k, (name, known) in enumerate(zip(names, units, strict=False)):
        unit = unit_of(name)
        if known and unit is not None:
            if unit not in known:
                raise ValueError(f"{file}: {_quoted(name)} must be in {', '.join(known)}.")
            for line in lines:
                line[k] *= known[unit]
    return lines


def read_named_numbers(
    file: str | Path, columns: str, n_columns: int | None = None, most: int = MOST_ROWS
) -> tuple[tuple[str, ...], list[list[float]]]:
    """Names of the columns, empty if there is no line of them, and numbers as by `read_numbers`."""
    rows = read_rows(file, most)
    for row in rows:
        if len(row.fields) != (n_columns or len(rows[0].fields)):
            raise row.refused(f"every line must have {columns}, not {_quoted(','.join(row.fields))}")
    names = rows.pop(0).fields if rows and rows[0].has_names() else ()
    if not rows:
        raise ValueError(f"{file} has no line with {columns}.")
    return names, [row.numbers() for row in rows]


def _text(file: str | Path) -> str:
    data = read_whole(file)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as undecodable:
        line = data.count(b"\n", 0, undecodable.start) + 1
        raise ValueError(f"{file}, line {line}: this is no UTF-8 text: save the file in that encoding.") from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ValueError(f"{file}, line {line}: there is a NUL byte, which no CSV file has.")
    return text


def _rows(file: str | Path, form: Form) -> Iterator[Row]:
    """All rows, each with the number of the line on which it begins."""
    lines = io.StringIO(_text(file), newline="")
    for _ in range(form.skip):
        lines.readline()
    here, first = lines.tell(), QUOTED.sub("", next((line for line in lines if line.strip()), ""))
    lines.seek(here)
    separator = form.separator or (";" if ";" in first else "\t" if "\t" in first and "," not in first else ",")
    if form.separator is None and len(words := first.split()) > 1 and all(map(NUMBER.fullmatch, words)):
        separator = " "  # as numpy.savetxt writes
    has_commas = separator != "," if form.decimal is None else form.decimal == ","
    reader = csv.reader(lines, strict=True, skipinitialspace=True, delimiter=separator)
    begin = form.skip + 1
    try:
        for fields in reader:
            yield Row(f"{file}, line {begin}", tuple(field.strip() for field in fields), has_commas)
            begin = form.skip + reader.line_num + 1
    except csv.Error as wrong:
        raise ValueError(f"{file}, line {begin}: this is no CSV: {wrong}.") from None


def _quoted(field: str) -> str:
    return repr(field if len(field) <= LONGEST_SHOWN else field[:LONGEST_SHOWN] + "...")
