"""Derivatives by differences, and what kernels in plain Python take and give."""

from collections.abc import Callable
from typing import Any

import numpy as np

from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES


def slope(f: Callable[[Any], Any], x: Any, step: float) -> np.ndarray:
    """df/dx at every x, from central differences over step and step/2, Richardson-extrapolated."""

    def central(h):
        return (np.asarray(f(x + h)) - np.asarray(f(x - h))) / (2.0 * h)

    return (4.0 * central(0.5 * step) - central(step)) / 3.0


def gradient(f: Callable[[np.ndarray], Any], x: np.ndarray, step: float) -> np.ndarray:
    """Derivatives of f in every entry of the leading axis of x, stacked along a new leading axis."""
    units = np.eye(len(x)).reshape(len(x), len(x), *[1] * (x.ndim - 1))
    return np.array([slope(lambda s, unit=unit: f(x + s * unit), 0.0, step) for unit in units])


def hessian(f: Callable[[np.ndarray], Any], x: np.ndarray, step: float) -> np.ndarray:
    """Second derivatives of f in all entries of x, by central differences. f: Of many x at once, its leading axis."""
    moves = step * np.eye(x.size).reshape(x.size, *x.shape)
    i, j = np.triu_indices(x.size)
    corners = [np.asarray(f(x + a * moves[i] + b * moves[j])) for a in (1.0, -1.0) for b in (1.0, -1.0)]
    found = np.empty((x.size, x.size))
    found[i, j] = found[j, i] = (corners[0] - corners[1] - corners[2] + corners[3]) / (4.0 * step**2)
    return found


def plain(result: Any) -> Any:
    """What a kernel returned, as arrays in place of lanes and masks."""
    if isinstance(result, tuple):
        return tuple(map(plain, result))
    return result.numbers if isinstance(result, Lanes) else result.robots if isinstance(result, Mask) else result


def rows(nodes: np.ndarray) -> np.ndarray:
    """Nodes of N_LANES robots, or of one for all, as rows for kernels; not a copy that shares memory."""
    return np.ascontiguousarray(np.broadcast_to(nodes, (N_LANES, *nodes.shape[-2:])).reshape(N_LANES, -1).T).copy()


def nodes(rows: np.ndarray) -> np.ndarray:
    """Rows as nodes, shape (N_LANES, n_nodes, 2)."""
    return np.ascontiguousarray(rows.T).reshape(N_LANES, -1, 2)


def rotated(nodes: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return nodes @ np.array([[c, s], [-s, c]])
