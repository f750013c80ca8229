"""Poses in a CSV file: a line `time,x,y,theta` of names, then time [s], place and orientation [rad] of one tag.

The column theta may be missing. Empty fields and "nan" are pictures in which the tag was not found.
"""

from pathlib import Path

import numpy as np

from seastar_gym.identify.tracks.track import NOT_SEEN, Track
from seastar_gym.scene.checks import require_file
from seastar_gym.scene.csv_rows import read_table

TAG = "tag"
"""Name of the one point of a file of poses."""
COLUMNS = ("time", "x", "y", "theta")


def read_pose(file: str | Path) -> Track:
    """Track of a file of poses."""
    require_file("file", file)
    names, rows = read_table(file)
    if names not in (COLUMNS, COLUMNS[:3]) or not rows:
        raise ValueError(f"{file}: the first line must be time,x,y,theta or time,x,y, and there must be others below.")
    for row in rows:
        row.require_fields(len(names))
    numbers = np.array([row.numbers(NOT_SEEN) for row in rows])
    if np.isnan(numbers[:, 0]).any():
        raise rows[int(np.isnan(numbers[:, 0]).argmax())].refused("there is no time")
    turns = {TAG: numbers[:, 3]} if len(names) == 4 else {}
    return Track(numbers[:, 0], {TAG: numbers[:, 1:3]}, turns)
