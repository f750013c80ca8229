"""Reader of CSV files. A file that cannot be read is refused in one sentence with its name and the line.

Fields are separated by commas, numbers have a decimal point, and the text is UTF-8, with a byte order mark or without.
Where the first line has semicolons or tabs, as spreadsheets of many countries write them, those separate, and decimals
may follow a comma. Empty lines are skipped. The first line may hold names, each of which begins with a letter and has
no digit. A mistyped line of numbers is therefore an error, not a header. Names may end with a unit: "time (ms)".
"""

import csv
import io
import itertools
import math
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from seastar_gym.files import read_whole

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
    file: str | Path, columns: str, n_columns: int | None = None, most: int = MOST_ROWS
) -> list[list[float]]:
    """Numbers of all lines, equally many in each, without the first line if it holds names.

    columns: Content of a line for sentences, such as "a time [s] and an angle [rad]".
    n_columns: Numbers per line. None means as many as fields in the first line. most: Most lines.
    """
    return read_named_numbers(file, columns, n_columns, most)[1]


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
