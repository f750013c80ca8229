"""Labels of waypoints: which numbers stand where, beside the path."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Label:
    """Label of a waypoint, or of several at one place, and where there is room to write it."""

    indices: tuple[int, ...]
    """Waypoints at this place, counted from 0."""
    place: FloatArray
    """Position [m], shape (2,)."""
    direction: FloatArray
    """Unit vector, y up, to the middle of the widest sector that is free of the path."""


def waypoint_labels(path: FloatArray) -> list[Label]:
    """Labels of the waypoints of a path [m], shape (n + 1, 2), that begins with its start."""
    same_place = 1e-9 + 1e-6 * float(np.ptp(path, axis=0).max())
    labels, labelled = [], set()
    for waypoint in range(1, len(path)):
        if waypoint in labelled:
            continue
        together = np.flatnonzero(np.hypot(*(path - path[waypoint]).T) <= same_place)
        labelled.update(together.tolist())
        neighbours = path[[n for node in together for n in (node - 1, node + 1) if 0 <= n < len(path)]]
        direction = _widest_free_direction(neighbours - path[waypoint])
        labels.append(Label(tuple(int(node) - 1 for node in together if node > 0), path[waypoint], direction))
    return labels


def _widest_free_direction(legs: FloatArray) -> FloatArray:
    """Unit vector to the middle of the widest sector between legs, shape (n, 2)."""
    angles = np.sort(np.arctan2(legs[:, 1], legs[:, 0]))
    sectors = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
    # Sectors that differ only by rounding count as equal.
    widest = int(np.argmax(np.round(sectors, 6)))
    middle = angles[widest] + 0.5 * sectors[widest]
    return np.array([np.cos(middle), np.sin(middle)])
