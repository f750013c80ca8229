"""`Measurement`: measured positions of a robot's nodes, with the commands of its strokes, from CSV files and back.

Parameters: positive numbers of a scene, read and replaced by name.

Covariance of a least-squares fit whose residuals depend on those shortly before them.

What a scene lacks, such as limbs that are not alike, errs in the same way for many pictures. A fit that takes their
errors for independent has intervals that are too narrow. With J the derivative of the residuals r, and g_t = J_t^T r_t
the sum of a picture's coordinates, the covariance is

    (J^T J)^-1 [sum_{t, u} w(t - u) g_t g_u^T] (J^T J)^-1,    w(d) = max(0, 1 - |d|/tau)

(Newey and West, Econometrica 55, 703, 1987), with tau a sixth of the measurement's duration. The sum is of few
independent parts, so it is enlarged by the factor for tau/T = 1/6 (Kiefer and Vogelsang, Econometric Theory 21, 1130,
2005). In no direction is the variance taken to be less than s^2 (J^T J)^-1, that of independent errors of equal size,
with s^2 = |r|^2/(n - p).
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from seastar_gym.files import read_numbers, read_table, write_lines
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import (
    as_finite,
    is_finite_number,
    is_whole_number,
    require_few,
    require_file,
    require_kind,
    require_texts,
    require_unmasked,
    shown,
)
from seastar_gym.scene.number import MISSING, at, numbers_of, with_numbers

Floats = NDArray[np.float64]

FARTHEST = 1e3
"""Largest coordinate [m]. Squares of much larger ones would have no float."""
LATEST = 1e10
"""Largest time [s], beyond that of any clock that counts seconds."""
MOST_NODES = 10_000
"""Most nodes that are seen."""
NODE = re.compile("[0-9]{1,5}")
"""Number of a node in the name of a column."""
ORIENTATION = -1
"""What stands among the nodes for the orientation of the body."""
ARM = 0.02
"""Distance at which a body's orientation counts like a position [m], about the radius of a tag."""


@dataclass(frozen=True)
class Measurement:
    """Measured positions of some nodes of a robot, and the orientation of its body.

    time: When pictures were taken [s], shape (n,), since the first stroke began or as `command_times`.
    positions: Node positions [m], shape (n, n_nodes_seen, 2). NaN where a node was not seen.
    nodes: Indices of the nodes, shape (n_nodes_seen,). ORIENTATION stands for the orientation theta of the body, whose
        position is ARM (cos theta, sin theta).
    commands: Commands of every stroke, shape (n_strokes, n_limbs).
    command_times: When commands were given [s], shape (n_strokes,). None for strokes one after the other, from time 0.
        Before the first of them, the robot is at rest.
    """

    time: Floats
    positions: Floats
    nodes: tuple[int, ...]
    commands: Floats
    command_times: Floats | None = None

    def __post_init__(self) -> None:
        for name in ("time", "positions", "commands", *(["command_times"] if self.command_times is not None else [])):
            array = getattr(self, name)
            require_unmasked(name, array)
            if not isinstance(array, np.ndarray) or array.dtype.kind not in "iuf":
                raise ValueError(f"{name} must be an array of numbers, not {shown(array)}.")
        require_few("nodes", self.nodes, MOST_NODES)
        whole = isinstance(self.nodes, tuple) and all(map(is_whole_number, self.nodes))
        if not whole or min(self.nodes, default=0) < ORIENTATION or self.time.ndim != 1:
            raise ValueError(f"nodes must be a tuple of whole numbers, not {shown(self.nodes)}, and time a single row.")
        if self.positions.shape != (len(self.time), len(self.nodes), 2) or not np.isfinite(self.positions).any():
            raise ValueError(f"{len(self.time)} times and {len(self.nodes)} nodes do not fit the positions measured.")
        if np.nanmax(np.abs(self.positions)) > FARTHEST:
            raise ValueError(f"Positions must be within {FARTHEST:g} m of the origin, in metres.")
        if self.commands.ndim != 2 or not len(self.commands):
            raise ValueError("commands must have one row per stroke with one number per limb.")
        if not np.isfinite(self.time).all() or self.time.min() < 0.0 or (np.diff(self.time) < 0.0).any():
            raise ValueError("Times must be finite, not negative, and in order [s].")
        if self.time.max() > LATEST:
            raise ValueError(f"Times must be within {LATEST:g} s, in seconds.")
        if self.command_times is not None:
            require_command_times(self.command_times, len(self.commands))

    @classmethod
    def from_csv(cls, trajectory: str | Path, commands: str | Path) -> Measurement:
        """Measurement from two CSV files, whose form `seastar identify --help` shows."""
        require_file("trajectory", trajectory)
        require_file("commands", commands)
        time, positions, nodes = _read_trajectory(trajectory)
        command_times, commanded = _read_commands(commands)
        try:
            return cls(time, positions, nodes, commanded, command_times)
        except ValueError as unfit:
            raise ValueError(f"{trajectory}: {unfit}") from None

    def to_csv(self, trajectory: str | Path, commands: str | Path) -> None:
        """Write two CSV files that `from_csv` reads."""
        require_file("trajectory", trajectory)
        require_file("commands", commands)
        write_trajectory(trajectory, self.time, self.positions, self.nodes)
        if self.command_times is None:
            write_lines(commands, ([f"{share:g}" for share in row] for row in self.commands.tolist()))
            return
        lines = [["time", *(f"limb{limb + 1}" for limb in range(self.commands.shape[1]))]]
        timed = zip(self.command_times.tolist(), self.commands.tolist(), strict=True)
        lines += [[repr(when), *(f"{share:g}" for share in row)] for when, row in timed]
        write_lines(commands, lines)


def require_command_times(times: Floats, n_strokes: int) -> None:
    """ValueError unless times are finite, one for every stroke, and increase [s]."""
    if times.shape != (n_strokes,) or not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise ValueError(f"command_times must be {n_strokes} finite times that increase [s], one for every command.")
    if np.abs(times).max() > LATEST:
        raise ValueError(f"command_times must be within {LATEST:g} s, in seconds.")


def write_trajectory(file: str | Path, time: Floats, positions: Floats, nodes: tuple[int, ...]) -> None:
    """Write a CSV file of a trajectory, see `Measurement`."""
    names, columns = ["time"], [time]
    for node, of_node in zip(nodes, np.moveaxis(positions, 1, 0), strict=True):
        if node == ORIENTATION:
            names, columns = [*names, "theta"], [*columns, np.arctan2(of_node[:, 1], of_node[:, 0])]
        else:
            names, columns = [*names, f"x{node}", f"y{node}"], [*columns, *of_node.T]
    rows = np.column_stack(columns).tolist()
    lines = [[repr(when), *("" if math.isnan(x) else f"{x:.7g}" for x in row)] for when, *row in rows]
    write_lines(file, [names, *lines])


UNSEEN = "", "nan", "na"
"""Fields of what was not seen, in any case."""


def _read_trajectory(file: str | Path) -> tuple[Floats, Floats, tuple[int, ...]]:
    """Times [s], positions [m] and nodes of a trajectory, see `Measurement`."""
    names, rows = read_table(file)
    turns = names[-1:] == ("theta",)
    columns = names[1 : len(names) - turns]
    nodes = tuple(int(name[1:]) for name in columns[::2] if NODE.fullmatch(name[1:]))
    expected = ("time", *(f"{axis}{node}" for node in nodes for axis in "xy"), *(["theta"] if turns else []))
    if not ((nodes or turns) and rows) or names != expected:
        raise ValueError(f"{file}: the first line must be time,x0,y0,.. and there must be others below it.")
    for row in rows:
        row.require_fields(len(expected))
        if row.fields[0].lower() in UNSEEN:
            raise row.refused("there is no time")
    numbers = np.array([row.numbers(missing=UNSEEN) for row in rows])
    backwards = np.flatnonzero(np.diff(numbers[:, 0]) < 0.0)
    if backwards.size > 0:
        raise rows[backwards[0] + 1].refused("the clock goes back")
    positions = numbers[:, 1 : 1 + len(columns)].reshape(len(numbers), len(nodes), 2)
    if turns:
        positions = np.concatenate([positions, pointer(numbers[:, -1])[:, None]], axis=1)
        nodes = (*nodes, ORIENTATION)
    return numbers[:, 0], positions, nodes


def pointer(theta: Floats) -> Floats:
    """What stands for orientations [rad] among positions [m]: shape (..., 2), for angles of shape (...)."""
    return ARM * np.stack([np.cos(theta), np.sin(theta)], axis=-1)


def _read_commands(file: str | Path) -> tuple[Floats | None, Floats]:
    """Times [s] and commands of a file whose first line begins with "time"; None and commands of any other."""
    names, rows = read_table(file)
    if names[:1] != ("time",):
        if names and "time" in names[0].lower():
            raise ValueError(f"{file}: the first line must be time,limb1,limb2,.. with the time in seconds.")
        return None, _shares(file, np.array(read_numbers(file, "one number per limb, every line as many")))
    for row in rows:
        row.require_fields(len(names))
    if len(names) < 2 or not rows:
        raise ValueError(f"{file}: after time there must be one column per limb, and lines below the first.")
    numbers = np.array([row.numbers() for row in rows])
    return numbers[:, 0], _shares(file, numbers[:, 1:][:, _order(file, names[1:])])


def _shares(file: str | Path, commands: Floats) -> Floats:
    """Commands of a file. ValueError for those that are no shares of a pulse."""
    if (most := float(np.abs(commands).max())) > 1.0:
        raise ValueError(f"{file}: commands are shares of a pulse, from -1 to 1, and one is {most:g}.")
    return commands


def _order(file: str | Path, names: Sequence[str]) -> NDArray[np.intp]:
    """Places of the columns of limbs 1, 2, ..., by the numbers at the end of their names; as they are without any."""
    found = [re.search(r"\d+$", name) for name in names]
    if not any(found):
        return np.arange(len(names))
    limbs = [-1 if match is None else int(match[0]) for match in found]
    if sorted(limbs) not in (list(range(1, len(names) + 1)), list(range(len(names)))):
        raise ValueError(f"{file}: after time come limbs 1 to {len(names)}, each once, not {', '.join(names)}.")
    return np.argsort(limbs)


COUNTS = (int, int | Any)
"""Types of fields that are counts, which nobody fits."""


def get_parameter(scene: Scene, name: str) -> float:
    """Value of a parameter of the scene. ValueError if no positive number, counts excepted, has that name."""
    if not isinstance(scene, Scene) or not isinstance(name, str):
        raise ValueError(f"A Scene and a parameter's name are needed, not {shown(scene)} and {shown(name)}.")
    value = _found(scene, name)
    if not is_finite_number(value) or value <= 0.0:
        raise ValueError(f"{shown(name)} is no positive number of this scene, {_why_not(scene, name, value)}.")
    return float(value)


def _found(scene: Scene, name: str) -> Any:
    """What a name stands for; MISSING for nothing, and for counts."""
    owner, _, last = name.rpartition(".")
    part = type(at(scene, owner))
    is_count = is_dataclass(part) and get_type_hints(part).get(last) in COUNTS
    known = name.split(".")[0] in ("robot", "fluid", "actuator", "contact") and not is_count
    return at(scene, name) if known else MISSING


def _why_not(scene: Scene, name: str, value: Any) -> str:
    """End of the sentence that refuses to fit what a name stands for."""
    if numbers_of(scene).get(name, 0.0) is None:
        return "which leaves it out (None): give it a first guess"
    if is_finite_number(value):
        return f"where it is {value:g}: the logarithm is fitted, so give it a first guess above zero"
    if isinstance(value, tuple) and value and all(map(is_finite_number, value)):
        return f"but {len(value)} of them: name one, such as {name}.1"
    return "such as fluid.drag_coefficient"


def with_parameters(scene: Scene, names: Sequence[str], values: Sequence[float] | Floats) -> Scene:
    """Scene with other values of the named parameters."""
    require_kind("scene", scene, Scene, "a Scene")
    require_texts("names", names)
    for name in names:
        if "." not in name or _found(scene, name) is MISSING:
            raise ValueError(f"{shown(name)} is no number of this scene, such as fluid.drag_coefficient.")
    numbers = as_finite("values", values, (len(names),))
    if numbers.ndim != 1:
        raise ValueError(f"values must be one for each of {len(names)} names, not of shape {numbers.shape}.")
    return with_numbers(scene, dict(zip(names, numbers.tolist(), strict=True)))


REMEMBERED = 1.0 / 6.0
"""Longest time between residuals that depend on each other, over the duration of the measurement [1]."""
FEW_PARTS = (1.0 + (2.9694 * REMEMBERED + 0.4160 * REMEMBERED**2 - 0.5324 * REMEMBERED**3) / 1.96) ** 2
"""Factor of the sum for its few independent parts."""
SMALLEST = 1e-100
"""Least divisor: what the data do not tell at all gets a variance that is huge, but finite."""


class Uncertainty(NamedTuple):
    """How well p parameters are known.

    covariance, correlation: Of the estimates, shape (p, p). The correlation of residuals of zero is that of independent
    errors.
    combinations: Combinations of parameters whose errors are independent, unit vectors, shape (p, p).
    errors: Their standard errors if residuals were independent, shape (p,).
    """

    covariance: Floats
    correlation: Floats
    combinations: Floats
    errors: Floats


def uncertainty_of(jacobian: Floats, residuals: Floats, times: Floats, least: float = 0.0) -> Uncertainty:
    """Uncertainty of p fitted parameters.

    jacobian: Derivative J of the residuals by the parameters, shape (n, p).
    residuals: Residuals r, shape (n,).
    times: When each of them was measured, in order [s], shape (n,). least: Least error of each.
    """
    n, p = jacobian.shape
    error = max(np.linalg.norm(residuals) / np.sqrt(n - p), least)
    left, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    products = left * (residuals / max(error, SMALLEST))[:, None]
    pictures, first = np.unique(times, return_index=True)
    sizes, axes = np.linalg.eigh(FEW_PARTS * _middle(np.add.reduceat(products, first, axis=0), pictures))
    unit_errors = 1.0 / np.maximum(singular, SMALLEST)
    root = directions.T * unit_errors @ axes
    unit = (root * np.maximum(sizes, 1.0)) @ root.T  # sizes of independent errors are one
    scale = np.sqrt(np.diag(unit))
    return Uncertainty(error**2 * unit, unit / scale[:, None] / scale, directions, error * unit_errors)


def _middle(gradients: Floats, times: Floats) -> Floats:
    """Sum of products of gradients at times t and u with the weight w(t - u), shape (p, p).

    gradients: Sums over the coordinates of every picture, shape (n_pictures, p). times: Of the pictures [s].
    """
    total = gradients.T @ gradients
    remembered = REMEMBERED * (times[-1] - times[0])
    for apart in range(1, len(times)):
        passed = times[apart:] - times[:-apart]
        if passed.min() >= remembered:
            break
        weights = np.maximum(1.0 - passed / remembered, 0.0)
        products = (gradients[apart:] * weights[:, None]).T @ gradients[:-apart]
        total += products + products.T
    return total
