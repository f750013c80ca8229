"""Numbers of every robot as rows for kernels, one robot per lane, and back."""

import numpy as np

from seastar_gym.simd.lanes import N_LANES


def to_rows(values: np.ndarray) -> np.ndarray:
    """Numbers of every robot, shape (n_robots, ...), as rows (n_groups, k, N_LANES); lanes left over have zeros."""
    n_groups = -(-len(values) // N_LANES)
    padded = np.zeros((n_groups * N_LANES, int(np.prod(values.shape[1:]))))
    padded[: len(values)] = values.reshape(len(values), -1)
    return np.ascontiguousarray(padded.reshape(n_groups, N_LANES, -1).transpose(0, 2, 1))


def write_rows(rows: np.ndarray, values: np.ndarray) -> None:
    """Write numbers of every robot over rows (n_groups, k, N_LANES); lanes left over keep theirs."""
    groups, lanes = np.divmod(np.arange(len(values)), N_LANES)
    rows[groups, :, lanes] = values.reshape(len(values), -1)


def from_rows(rows: np.ndarray, n_robots: int) -> np.ndarray:
    """Rows (n_groups, k, N_LANES) as numbers of every robot, shape (n_robots, k), a copy."""
    return np.ascontiguousarray(rows.transpose(0, 2, 1)).reshape(-1, rows.shape[1])[:n_robots]
