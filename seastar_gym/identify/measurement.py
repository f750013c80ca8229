"""`Measurement`: measured positions of a robot's nodes, with the commands of its strokes, from CSV files and back."""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seastar_gym.files import beside, write_atomically
from seastar_gym.scene.checks import is_whole_number, require_file, require_unmasked, shown
from seastar_gym.scene.csv_rows import Row, read_numbers, read_rows

Floats = NDArray[np.float64]

FARTHEST = 1e3
"""Largest coordinate [m]. Squares of much larger ones would have no float."""
NODE = re.compile("[0-9]{1,5}")
"""Number of a node in the name of a column."""


@dataclass(frozen=True)
class Measurement:
    """Measured positions of some nodes of a robot.

    time: Time since the first stroke began [s], shape (n,).
    positions: Node positions [m], shape (n, n_nodes_seen, 2). NaN where a node was not seen.
    nodes: Indices of the nodes, shape (n_nodes_seen,).
    commands: Commands of every stroke, shape (n_strokes, n_limbs).
    """

    time: Floats
    positions: Floats
    nodes: tuple[int, ...]
    commands: Floats

    def __post_init__(self) -> None:
        for name in ("time", "positions", "commands"):
            array = getattr(self, name)
            require_unmasked(name, array)
            if not isinstance(array, np.ndarray) or array.dtype.kind not in "iuf":
                raise ValueError(f"{name} must be an array of numbers, not {shown(array)}.")
        if not isinstance(self.nodes, tuple) or not all(map(is_whole_number, self.nodes)) or self.time.ndim != 1:
            raise ValueError(f"nodes must be a tuple of whole numbers, not {shown(self.nodes)}, and time a single row.")
        if self.positions.shape != (len(self.time), len(self.nodes), 2) or not np.isfinite(self.positions).any():
            raise ValueError(f"{len(self.time)} times and {len(self.nodes)} nodes do not fit the positions measured.")
        if np.nanmax(np.abs(self.positions)) > FARTHEST:
            raise ValueError(f"Positions must be within {FARTHEST:g} m of the origin, in metres.")
        if self.commands.ndim != 2 or not len(self.commands):
            raise ValueError("commands must have one row per stroke with one number per limb.")
        if not np.isfinite(self.time).all() or self.time.min() < 0.0 or (np.diff(self.time) < 0.0).any():
            raise ValueError("Times must be finite, not negative, and in order [s].")

    @classmethod
    def from_csv(cls, trajectory: str | Path, commands: str | Path) -> "Measurement":
        """Measurement from two CSV files, whose form `python -m seastar_gym.identify --help` shows."""
        require_file("trajectory", trajectory)
        require_file("commands", commands)
        names, *rows = read_rows(trajectory) or [Row(str(trajectory), ())]
        nodes = tuple(int(name[1:]) for name in names.fields[1::2] if NODE.fullmatch(name[1:]))
        expected = ("time", *(f"{axis}{node}" for node in nodes for axis in "xy"))
        if not (nodes and rows) or names.fields != expected:
            raise ValueError(f"{trajectory}: the first line must be time,x0,y0,.. and there must be others below it.")
        for row in rows:
            if len(row.fields) != len(expected):
                raise row.refused(f"the line must have {len(expected)} fields, as the first one, not {len(row.fields)}")
            if not row.fields[0]:
                raise row.refused("there is no time")
        numbers = np.array([row.numbers(empty_allowed=True) for row in rows])
        commanded = np.array(read_numbers(commands, "one number per limb, every line as many"))
        try:
            return cls(numbers[:, 0], numbers[:, 1:].reshape(len(numbers), len(nodes), 2), nodes, commanded)
        except ValueError as unfit:
            raise ValueError(f"{trajectory}: {unfit}") from None

    def to_csv(self, trajectory: str | Path, commands: str | Path) -> None:
        """Write two CSV files that `from_csv` reads."""
        require_file("trajectory", trajectory)
        require_file("commands", commands)
        names = ["time", *(f"{axis}{node}" for node in self.nodes for axis in "xy")]
        numbers = np.column_stack([self.time, self.positions.reshape(len(self.time), -1)])
        lines = [names, *(["" if math.isnan(x) else f"{x:.7g}" for x in row] for row in numbers.tolist())]
        write_atomically(trajectory, "".join(",".join(line) + "\n" for line in lines))
        with beside(commands) as part:
            np.savetxt(part, self.commands, "%g", ",")
