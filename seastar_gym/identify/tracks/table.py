"""CSV files of any tracker, logger or spreadsheet: columns are found by their names, and lines are pictures.

Names may stand in several lines, such as the marker's above X, Y, Z above their units: they are joined by points, each
going on to the right as far as the fields beside it are empty. Where a name ends with a unit, such as "Time (ms)", that
is the column's, unless another one is named.

Those of OptiTrack Motive, of the format versions 1.2x, have rigid bodies and markers. The first line has pairs of names
and values, such as Length Units,Millimeters and Rotation Type,Quaternion. Headers follow: types and names of all
columns, IDs and parents in some versions, whether it is a Rotation or a Position, and the line of axes, Frame,Time
(Seconds),X,Y,.. Empty fields are pictures in which it was lost. Motive's y axis is up unless its settings say
otherwise. The robot then swims in the plane of z and x, seen from above: x here is Motive's x, and y here is -z, so
that anti-clockwise from above is anti-clockwise.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.files import UNITS, Form, Row, read_rows, unit_of
from seastar_gym.identify.tracks.track import NOT_SEEN, Track, likely, require_possible
from seastar_gym.scene.checks import (
    LONGEST_SHOWN,
    require_choice,
    require_count,
    require_file,
    require_flag,
    require_kind,
    require_number,
    require_texts,
    require_within,
    shown,
)

Floats = NDArray[np.float64]

PIXEL = "px"
LENGTHS = (*UNITS["length"], PIXEL)
"""Units of places."""
MOST_LINES = 1000
"""Most lines before and of names."""


class Table(NamedTuple):
    """Lines of a CSV file with names above them."""

    file: str | Path
    names: tuple[str, ...]
    rows: list[Row]

    @classmethod
    def read(cls, file: str | Path, form: Form = Form(), headers: int = 1) -> "Table":
        """Table of a file whose first lines, `headers` of them, have the names."""
        rows = read_rows(file, form=form)
        if len(rows) <= headers:
            raise ValueError(f"{file} must have names, and lines below them.")
        for row in rows:
            row.require_fields(len(rows[0].fields))
        return cls(file, _joined([row.fields for row in rows[:headers]]), rows[headers:])

    def column(self, name: str) -> int:
        """Place of the column of a name."""
        if self.names.count(name) != 1:
            file = f"{self.file}{', separated by semicolons or tabs,' * self.rows[0].has_commas}"
            if name in self.names:
                raise ValueError(
                    f"{file} has several columns {shown(name)}: have more lines of names read, with --headers."
                )
            raise ValueError(
                f"{file} has no column {shown(name)}, but {', '.join(filter(None, self.names))[:LONGEST_SHOWN]}."
            )
        return self.names.index(name)

    def texts(self, name: str) -> list[str]:
        """Fields of a column."""
        k = self.column(name)
        return [row.fields[k] for row in self.rows]

    def numbers(self, *names: str, are_known: bool = False) -> Floats:
        """Numbers of columns, shape (n, n_names), NaN where nothing was seen. are_known: Whether that is refused."""
        places, missing = [self.column(name) for name in names], () if are_known else NOT_SEEN
        chosen = (row._replace(fields=tuple(row.fields[k] for k in places)) for row in self.rows)
        return np.array([row.numbers(missing) for row in chosen])

    def only(self, values: Mapping[str, str]) -> "Table":
        """Lines that have these fields in the columns of these names."""
        wanted = [(self.column(name), text) for name, text in values.items()]
        kept = [row for row in self.rows if all(row.fields[k] == text for k, text in wanted)]
        if not kept:
            raise ValueError(f"{self.file} has no line with {', '.join(map('='.join, values.items()))}.")
        return self._replace(rows=kept)


def _joined(headers: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Names of columns, of several lines of them."""
    lines = [list(line) for line in headers]
    for line in lines[:-1]:
        for k in range(1, len(line)):
            line[k] = line[k] or line[k - 1]
    return tuple(".".join(filter(None, parts)) for parts in zip(*lines, strict=True))


def read_table(
    file: str | Path,
    x: str | Sequence[str] = "x",
    y: str | Sequence[str] = "y",
    theta: str | Sequence[str] | None = None,
    time: str | None = None,
    *,
    time_unit: str | None = None,
    unit: str | None = None,
    degrees: bool = False,
    y_down: bool = False,
    rate: float | None = None,
    score: str | Sequence[str] = (),
    likelihood: float | None = None,
    only: dict[str, str] | None = None,
    skip: int = 0,
    headers: int = 1,
    separator: str | None = None,
    decimal: str | None = None,
) -> Track:
    """Track of a CSV file with a line for every picture. Points have the names of their columns of x.

    x, y: Names of columns, of a point or of several.
    theta: Column of the orientation of the first point, or four of its quaternion x, y, z, w. None: "theta" if there is
        one.
    time: Column of the time; with `rate` of the picture's number. None: "time", or with `rate` every line is a picture.
    time_unit: s, ms, us, ns or min. unit: m, cm, mm or px. None: that of the name, or s and m.
    degrees: Whether theta is in degrees, though its name does not say so.
    y_down: Whether y points down, and angles are clockwise, in a file that is not in pixels.
    rate: Pictures per second, for files without times [Hz].
    score, likelihood: Columns of the points' scores, and the least score of a point that was seen.
    only: Fields that lines must have, by the names of columns, where a file has several robots.
    skip: Lines above the names. headers: Lines of names.
    separator, decimal: Character between fields, or "tab", and the one before decimals. None: as the first line tells.
    """
    require_file("file", file)
    xs, ys, turns, scores = (
        _columns(name, given) for name, given in (("x", x), ("y", y), ("theta", theta), ("score", score))
    )
    if not xs or len(xs) != len(ys) or len(scores) not in (0, len(xs)) or len(turns) not in (0, 1, 4):
        raise ValueError("Every x needs a y, and a score if there are any, and theta has one column or four.")
    if (likelihood is None) != (not scores):
        raise ValueError("--score and --likelihood belong together.")
    require_kind("time", time, str | None, "a name, or None")
    for name, value, choices in (("time_unit", time_unit, tuple(UNITS["time"])), ("unit", unit, LENGTHS)):
        if value is not None:
            require_choice(name, value, choices)
    require_flag("degrees", degrees)
    require_flag("y_down", y_down)
    only = {} if only is None else only
    require_kind("only", only, dict, "a dict of texts by names, or None")
    require_texts("only", [*only, *only.values()])
    table = Table.read(file, form_of(separator, decimal, skip), _lines("headers", headers, 1)).only(only)
    if not turns and theta is None and "theta" in table.names:
        turns = ("theta",)
    times = _times(table, time, time_unit, rate)
    unit = PIXEL if unit is None and unit_of(xs[0]) == PIXEL else unit
    size, up = 1.0 if unit == PIXEL else _factor(xs[0], unit, "length"), -1.0 if y_down else 1.0
    places = {name: table.numbers(name, other) * [size, up * size] for name, other in zip(xs, ys, strict=True)}
    if likelihood is not None:
        require_within("likelihood", likelihood, 0.0, 1.0)
        places = {name: likely(places[name], table.numbers(its)[:, 0], likelihood)
                  for name, its in zip(xs, scores, strict=True)}  # fmt: skip
    angles = {}
    if turns:
        angle = table.numbers(*turns)
        if len(turns) == 4:
            angles[xs[0]] = up * heading(angle, "z")
        else:
            angles[xs[0]] = up * _factor(turns[0], "deg" if degrees else None, "angle") * angle[:, 0]
    return Track(times, places, angles, in_pixels=unit == PIXEL)


def _columns(name: str, given: str | Sequence[str] | None) -> Sequence[str]:
    """Names of columns, none for None."""
    found = [given] if isinstance(given, str) else [] if given is None else given
    require_texts(name, found)
    return found


def _times(table: Table, time: str | None, unit: str | None, rate: float | None) -> Floats:
    """Times of a table's lines [s], see `read_table`."""
    if rate is None:
        name = "time" if time is None else time
        return table.numbers(name, are_known=True)[:, 0] * _factor(name, unit, "time")
    require_number("rate", rate, "Hz")
    if unit is not None:
        raise ValueError("With --rate, pictures are counted, and no --time-unit is needed.")
    return (np.arange(len(table.rows)) if time is None else table.numbers(time, are_known=True)[:, 0]) / rate


def _factor(name: str, unit: str | None, quantity: str) -> float:
    """Unit of a column of a quantity, [s], [m] or [rad]: the one that is given, that of its name, or 1."""
    chosen = unit or unit_of(name)
    if chosen is not None and chosen not in UNITS[quantity]:
        option = {"time": "--time-unit", "length": "--unit", "angle": "--degrees"}[quantity]
        raise ValueError(f"{shown(name)} is in none of {', '.join(UNITS[quantity])}: give its unit by {option}.")
    return 1.0 if chosen is None else UNITS[quantity][chosen]


def form_of(separator: str | None, decimal: str | None, skip: int = 0) -> Form:
    """Form of a file. ValueError for what is none."""
    require_kind("separator", separator, str | None, "a character, or None")
    sign = "\t" if separator == "tab" else separator
    if sign is not None and (len(sign) != 1 or sign in '"\r\n.0123456789'):
        raise ValueError(f"separator must be one character, such as ; or tab, not {shown(separator)}.")
    if decimal is not None:
        require_choice("decimal", decimal, (".", ","))
    return Form(sign, decimal, _lines("skip", skip, 0))


def _lines(name: str, value: int, smallest: int) -> int:
    require_count(name, value, smallest, MOST_LINES)
    return value


METRES = {"Meters": 1.0, "Centimeters": 1e-2, "Millimeters": 1e-3}
"""Units of length in metres."""
KINDS = ("Rigid Body Marker", "Rigid Body", "Marker")
"""Types of columns with places. A measured marker is taken before the one that the solver puts onto a body."""

Up = Literal["y", "z"]


def read_motive(file: str | Path, up: Up = "y") -> Track:
    """Track in metres of a file of Motive. up: Axis that points up."""
    require_file("file", file)
    require_choice("up", up, ("y", "z"))
    rows = read_rows(file, form=Form(","))
    at = next((k for k, row in enumerate(rows) if _is_axes(row)), 0)
    if at < 4 or len(rows) == at + 1:
        raise ValueError(f"{file} has no types, names and Position above Frame,Time (Seconds),X,.. with numbers below.")
    unit, (times, *_) = _unit(file, rows[0]), (_numbers_in(rows[at + 1 :], [1]).T)
    points, orientations = dict[str, Floats](), dict[str, Floats]()
    found = _columns_of_kinds(rows[: at + 1])
    for (kind, name), columns in sorted(found.items(), key=lambda entry: KINDS.index(entry[0][0])):
        if all(("Position", axis) in columns for axis in "XYZ"):
            places = _numbers_in(rows[at + 1 :], [columns["Position", axis] for axis in "XYZ"])
            points[name] = unit * _from_above(places, up)
        if kind == "Rigid Body" and ("Rotation", "X") in columns:
            if ("Rotation", "W") not in columns:
                raise ValueError(f"{file}: export it with the rotation type Quaternion.")
            turns = _numbers_in(rows[at + 1 :], [columns["Rotation", axis] for axis in "XYZW"])
            require_possible(f"the quaternion of {name}", turns)
            orientations[name] = heading(turns, up)
    return Track(times, points, orientations)


def _is_axes(row: Row) -> bool:
    """Whether a line is the last of the headers."""
    return row.fields[0] == "Frame" and len(row.fields) > 2 and row.fields[1].startswith("Time")


def _unit(file: str | Path, row: Row) -> float:
    """Unit of length of a file in metres, by its first line."""
    facts = dict(zip(row.fields[::2], row.fields[1::2], strict=False))
    unit = facts.get("Length Units")
    if "Format Version" not in facts or unit not in METRES:
        raise row.refused(f"Format Version and Length Units must be there, of {', '.join(METRES)}, not {unit}")
    return METRES[unit]


def _columns_of_kinds(headers: Sequence[Row]) -> dict[tuple[str, str], dict[tuple[str, str], int]]:
    """Columns of places and rotations, such as ("Position", "X"), by the type and the name of what has them."""
    found: dict[tuple[str, str], dict[tuple[str, str], int]] = {}
    above = (headers[1].fields, headers[2].fields, headers[-2].fields, headers[-1].fields)
    for column, (kind, name, what, axis) in enumerate(zip(*above, strict=False)):
        if kind in KINDS:
            found.setdefault((kind, name), {})[what, axis] = column
    return found


def _numbers_in(rows: Sequence[Row], columns: Sequence[int]) -> Floats:
    """Numbers of some columns, shape (n_rows, n_columns); NaN where a line is shorter."""
    padded = ((row, dict(enumerate(row.fields))) for row in rows)
    return np.array([Row(row.where, tuple(of.get(k, "") for k in columns)).numbers(NOT_SEEN) for row, of in padded])


def _from_above(places: Floats, up: Up) -> Floats:
    """Places in the plane, seen from above, shape (n, 2), of those in space, shape (n, 3)."""
    x, y, z = places.T
    return np.stack([x, -z if up == "y" else y], axis=-1)


def heading(quaternions: Floats, up: Up) -> Floats:
    """Direction of the rotated x-axis in the plane [rad], of unit quaternions x, y, z, w, shape (n, 4)."""
    x, y, z, w = quaternions.T
    rotated = np.stack([1.0 - 2.0 * (y**2 + z**2), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)], axis=-1)
    along, across = _from_above(rotated, up).T
    return np.asarray(np.arctan2(across, along))
