"""Numbers of every robot as rows for kernels, one robot per lane, and back.

A bundle is a named tuple of rows, of numbers and of other bundles. Its rows have shape (rows,) if all robots share them
and (rows, N_LANES) if they differ from robot to robot: `load` reads either.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from seastar_gym.lanes.registers import N_LANES

CACHE_LINE = 64  # bytes
SHARED = ("velocities", "pairs")
"""Fields that all robots of a bundle share: they are not read by row."""


def to_rows(values: np.ndarray) -> np.ndarray:
    """Numbers of every robot, shape (n_robots, ...), as rows (n_groups, k, N_LANES); lanes left over have zeros."""
    rows = np.zeros((-(-len(values) // N_LANES), math.prod(values.shape[1:]), N_LANES))
    write_rows(rows, values)
    return rows


def write_rows(rows: np.ndarray, values: np.ndarray) -> None:
    """Write numbers of every robot over rows (n_groups, k, N_LANES); lanes left over keep theirs."""
    (n_full, n_left), n_rows = divmod(len(values), N_LANES), rows.shape[1]
    each = values.reshape(len(values), n_rows)
    if n_full:
        rows.transpose(0, 2, 1)[:n_full] = each[: n_full * N_LANES].reshape(n_full, N_LANES, n_rows)
    if n_left:
        rows[n_full, :, :n_left] = each[n_full * N_LANES :].T


def from_rows(rows: np.ndarray, n_robots: int) -> np.ndarray:
    """Rows (n_groups, k, N_LANES) as numbers of every robot, shape (n_robots, k), a copy."""
    if len(rows) == 1:
        return rows[0, :, :n_robots].T.copy()
    return np.ascontiguousarray(rows.transpose(0, 2, 1)).reshape(-1, rows.shape[1])[:n_robots]


def aligned_rows(*shape: int) -> np.ndarray:
    """Zeros that begin at a cache line: with numpy alone most rows would straddle two."""
    size = int(np.prod(shape))
    buffer = np.zeros(size + CACHE_LINE // 8)
    start = -buffer.ctypes.data % CACHE_LINE // 8
    return buffer[start : start + size].reshape(shape)


def side_by_side(robots: Sequence[Any]) -> Any:
    """Bundles of shared rows, one for each of N_LANES robots, as one bundle of rows of shape (rows, N_LANES).

    What is not read by row stays shared: samples on a grid, limbs that may touch.
    """
    first = robots[0]
    columns = {name: [getattr(robot, name) for robot in robots] for name in first._fields}
    joined = {}
    for name, column in columns.items():
        if isinstance(column[0], np.ndarray) and name not in SHARED:
            joined[name] = np.stack(column, axis=1)
        elif hasattr(column[0], "_fields"):
            joined[name] = side_by_side(column)
    return first._replace(**joined)


def put_robot(bundle: Any, lane: int, robot: Any) -> None:
    """Write a robot's shared rows into its lane of a bundle made by `side_by_side`."""
    for rows, own in zip(bundle, robot, strict=True):
        if isinstance(own, np.ndarray) and rows.ndim == 2:
            rows[:, lane] = own
        elif hasattr(own, "_fields"):
            put_robot(rows, lane, own)
