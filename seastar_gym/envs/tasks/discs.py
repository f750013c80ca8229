"""Fields of discs, and ways around them: shortest ways on a grid whose nodes keep clear of all discs.

A field is rows of centre and radius: x, y, r [m]. The grid lies around the way from the origin along +x. A node has
edges to the sixteen nearest nodes that are no multiples of others, so the length of a way is exact to 3 %.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.robots import Floats
from seastar_gym.interrupts import held_back

BOX = np.array([[-0.2, -0.4], [0.8, 0.4]])
"""Corners of the grid [m]: lower left, upper right."""
NEIGHBOURS = np.array([(1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2)])
"""Edges of a node, in steps of the grid; the opposite ones belong to the neighbours."""
WINDOW = 2
"""A point goes on by one of the nodes within so many steps of the one that is nearest to it."""


def rims(points: Floats, discs: Floats) -> Floats:
    """Distances of points, shape (..., 2), from the rims of discs, shape (..., m, 3) [m]; negative within."""
    away = points[..., None, :] - discs[..., :2]
    return np.asarray(np.hypot(away[..., 0], away[..., 1]) - discs[..., 2])


class _Grid(NamedTuple):
    """Nodes, shape (nx, ny, 2) [m], and edges: numbers of both ends, and lengths [m]."""

    nodes: Floats
    first: NDArray[np.intp]
    last: NDArray[np.intp]
    length: Floats


@cache
def _grid(step: float) -> _Grid:
    """Grid of a step [m]."""
    nx, ny = (np.rint((BOX[1] - BOX[0]) / step).astype(int) + 1).tolist()
    number = np.arange(nx * ny).reshape(nx, ny)
    x, y = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    first, last, length = [], [], []
    for dx, dy in NEIGHBOURS.tolist():
        inside = (x + dx < nx) & (y + dy >= 0) & (y + dy < ny)
        first.append(number[inside])
        last.append(number[x[inside] + dx, y[inside] + dy])
        length.append(np.full(len(first[-1]), step * np.hypot(dx, dy)))
    nodes = BOX[0] + step * np.stack([x, y], axis=-1)
    return _Grid(nodes, np.concatenate(first), np.concatenate(last), np.concatenate(length))


class Ways(NamedTuple):
    """Lengths of the shortest ways to a goal from the nodes of a grid."""

    lengths: Floats
    """Shape (..., nx, ny) [m]; infinite where there is no way, NaN for nodes that are in a disc or too near to one."""
    step: float
    """[m]"""

    def __call__(self, points: Floats) -> Floats:
        """Lengths [m] from points, shape (..., k, 2), for lengths of shape (..., nx, ny).

        A point in a disc, with no clear node near, swims to the nearest node with a way first.
        """
        shape = self.lengths.shape[-2:]
        nearest = np.rint((points - BOX[0]) / self.step).astype(int)
        steps = np.arange(-WINDOW, WINDOW + 1)
        i, j = (np.clip(nearest[..., k, None] + steps, 0, shape[k] - 1) for k in (0, 1))
        i, j = np.repeat(i, len(steps), axis=-1), np.tile(j, len(steps))
        rows = self.lengths.reshape(*self.lengths.shape[:-2], 1, -1)
        flat = np.broadcast_to(rows, (*points.shape[:-1], rows.shape[-1]))
        there = np.take_along_axis(flat, i * shape[1] + j, axis=-1)
        away = BOX[0] + self.step * np.stack([i, j], axis=-1) - points[..., None, :]
        reached = np.where(np.isnan(there), np.inf, there + np.hypot(away[..., 0], away[..., 1]))
        found = np.asarray(reached.min(axis=-1))
        for lost in map(tuple, np.argwhere(np.isnan(there).all(axis=-1))):
            found[lost] = self._from_afar(points[lost], flat[lost])
        return found

    def _from_afar(self, point: Floats, lengths: Floats) -> float:
        """Length [m] from a point with no way near."""
        away = _grid(self.step).nodes.reshape(-1, 2) - point
        distances = np.where(np.isfinite(lengths), np.hypot(away[:, 0], away[:, 1]), np.inf)
        nearest = int(np.argmin(distances))
        return float(distances[nearest] + lengths[nearest])


def ways(discs: Floats, goal: Floats, clearance: float, step: float) -> Ways:
    """Shortest ways to a goal [m] that keep a clearance [m] from all discs, shape (m, 3), on a grid of a step [m]."""
    with held_back():  # these take long to import, and other tasks do without
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import dijkstra

    grid = _grid(step)
    is_free = (rims(grid.nodes, discs).min(axis=-1, initial=np.inf) >= clearance).ravel()
    open_ = is_free[grid.first] & is_free[grid.last]
    n = len(is_free)
    graph = csr_matrix((grid.length[open_], (grid.first[open_], grid.last[open_])), shape=(n, n))
    away = grid.nodes.reshape(-1, 2) - goal
    begin = int(np.argmin(np.hypot(away[:, 0], away[:, 1])))
    if not is_free[begin]:
        return Ways(np.full(grid.nodes.shape[:2], np.inf), step)
    lengths = np.where(is_free, dijkstra(graph, directed=False, indices=begin), np.nan)
    return Ways(lengths.reshape(grid.nodes.shape[:2]), step)
