"""Reader of CSV files. A file that cannot be read is refused in one sentence with its name and the line.

Fields are separated by commas, numbers have a decimal point, and the text is UTF-8, with a byte order mark or without.
Empty lines are skipped. The first line may hold names, each of which begins with a letter and has no digit. A mistyped
line of numbers is therefore an error, not a header.
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
MOST_ROWS = 1_000_000
"""Most lines of a file."""
LONGEST_SHOWN = 40
"""Largest number of characters of a field in a sentence."""


class Row(NamedTuple):
    """Fields of one line. where: File and line for sentences, such as "curve.csv, line 3"."""

    where: str
    fields: tuple[str, ...]

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
        if NOT_FINITE.fullmatch(field) or (NUMBER.fullmatch(field) and math.isinf(float(field))):
            raise self.refused(f"{_quoted(field)} is no finite number")
        if not NUMBER.fullmatch(field):
            hint = ", decimals follow a point" if "," in field else ""
            raise self.refused(f"{_quoted(field)} is no number{hint}")
        return float(field)


def read_rows(file: str | Path, most: int = MOST_ROWS) -> list[Row]:
    """All lines of a file that are not empty. FileNotFoundError or ValueError if it cannot be read.

    most: Most lines that it may have.
    """
    if not Path(file).is_file():
        raise FileNotFoundError(f"There is no file {file}.")
    rows = list(itertools.islice((row for row in _rows(file) if row.fields not in ((), ("",))), most + 1))
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
    rows = read_rows(file, most)
    for row in rows:
        if ";" in "".join(row.fields):
            raise row.refused("fields must be separated by commas, not by semicolons")
        if len(row.fields) != (n_columns or len(rows[0].fields)):
            raise row.refused(f"every line must have {columns}, not {_quoted(','.join(row.fields))}")
    numbers = [row.numbers() for row in (rows[1:] if rows and rows[0].has_names() else rows)]
    if not numbers:
        raise ValueError(f"{file} has no line with {columns}.")
    return numbers


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


def _rows(file: str | Path) -> Iterator[Row]:
    """All rows, each with the number of the line on which it begins."""
    reader = csv.reader(io.StringIO(_text(file), newline=""), strict=True, skipinitialspace=True)
    begin = 1
    try:
        for fields in reader:
            yield Row(f"{file}, line {begin}", tuple(field.strip() for field in fields))
            begin = reader.line_num + 1
    except csv.Error as wrong:
        raise ValueError(f"{file}, line {begin}: this is no CSV: {wrong}.") from None


def _quoted(field: str) -> str:
    return repr(field if len(field) <= LONGEST_SHOWN else field[:LONGEST_SHOWN] + "...")
