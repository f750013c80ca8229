"""CSV files of OptiTrack Motive, of the format versions 1.2x: rigid bodies and markers.

The first line has pairs of names and values, such as Length Units,Millimeters and Rotation Type,Quaternion. Headers
follow: types and names of all columns, IDs and parents in some versions, whether it is a Rotation or a Position, and
the line of axes, Frame,Time (Seconds),X,Y,.. Empty fields are pictures in which it was lost.

Motive's y axis is up unless its settings say otherwise. The robot then swims in the plane of z and x, seen from above:
x here is Motive's x, and y here is -z, so that anti-clockwise from above is anti-clockwise.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from seastar_gym.identify.tracks.track import NOT_SEEN, Track, require_possible
from seastar_gym.scene.checks import require_choice, require_file
from seastar_gym.scene.csv_rows import Form, Row, read_rows

Floats = NDArray[np.float64]

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
    unit, (times, *_) = _unit(file, rows[0]), (_numbers(rows[at + 1 :], [1]).T)
    points, orientations = dict[str, Floats](), dict[str, Floats]()
    for (kind, name), columns in sorted(_columns(rows[: at + 1]).items(), key=lambda entry: KINDS.index(entry[0][0])):
        if all(("Position", axis) in columns for axis in "XYZ"):
            places = _numbers(rows[at + 1 :], [columns["Position", axis] for axis in "XYZ"])
            points[name] = unit * _from_above(places, up)
        if kind == "Rigid Body" and ("Rotation", "X") in columns:
            if ("Rotation", "W") not in columns:
                raise ValueError(f"{file}: export it with the rotation type Quaternion.")
            turns = _numbers(rows[at + 1 :], [columns["Rotation", axis] for axis in "XYZW"])
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


def _columns(headers: Sequence[Row]) -> dict[tuple[str, str], dict[tuple[str, str], int]]:
    """Columns of places and rotations, such as ("Position", "X"), by the type and the name of what has them."""
    found: dict[tuple[str, str], dict[tuple[str, str], int]] = {}
    above = (headers[1].fields, headers[2].fields, headers[-2].fields, headers[-1].fields)
    for column, (kind, name, what, axis) in enumerate(zip(*above, strict=False)):
        if kind in KINDS:
            found.setdefault((kind, name), {})[what, axis] = column
    return found


def _numbers(rows: Sequence[Row], columns: Sequence[int]) -> Floats:
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
