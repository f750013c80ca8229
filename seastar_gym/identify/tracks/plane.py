"""From pixels to metres on the plane in which the robot swims, by a homography.

With pixels (u, v), v down, and metres (x, y), y up, the homography H is a matrix with

    (x, y, 1) w = H (u, v, 1),    w = third entry of the right side.

A camera that looks straight down is a scale with y flipped. Lenses that distort are to be corrected before.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import require_number
from seastar_gym.scene.csv_rows import read_numbers

Floats = NDArray[np.float64]

FARTHEST = 1e6
"""Largest coordinate [m] or [pixel], and largest angle [rad], that can be."""
SINGULAR = 1e-9
"""Smallest eighth singular value of normalised equations for a homography, over the largest."""


def scaled(metres_per_pixel: float) -> Floats:
    """Homography of a camera that looks straight down, shape (3, 3)."""
    require_number("metres per pixel", metres_per_pixel, "m")
    return np.diag([metres_per_pixel, -metres_per_pixel, 1.0])


def homography(pixels: Floats, metres: Floats) -> Floats:
    """Homography that maps pixels to metres, both of shape (n, 2) with n of four or more; shape (3, 3).

    By the direct linear transformation with normalised coordinates (Hartley and Zisserman, Multiple View Geometry,
    algorithm 4.2); with more than four points it fits them in least squares of the equations.
    """
    if len(pixels) < 4:
        raise ValueError(f"A homography needs four points or more, not {len(pixels)}.")
    to_unit, from_unit = _normalised(pixels), np.linalg.inv(_normalised(metres))
    ones = np.ones((len(pixels), 1))
    p = np.hstack([pixels, ones]) @ to_unit.T
    x, y, _ = (np.hstack([metres, ones]) @ np.linalg.inv(from_unit).T).T
    none = np.zeros_like(p)
    equations = np.vstack([np.hstack([p, none, -x[:, None] * p]), np.hstack([none, p, -y[:, None] * p])])
    _, sizes, directions = np.linalg.svd(equations)
    if sizes[7] < SINGULAR * sizes[0]:
        raise ValueError("These points tell no homography: no three of four may be on one line.")
    found = from_unit @ directions[8].reshape(3, 3) @ to_unit
    return np.asarray(found / np.linalg.norm(found))


def _normalised(points: Floats) -> Floats:
    """Similarity that brings points, shape (n, 2), to mean zero and mean distance sqrt(2); shape (3, 3)."""
    middle = points.mean(axis=0)
    distance = np.hypot(*(points - middle).T).mean()
    if distance == 0.0:
        raise ValueError("These points tell no homography: they are all the same.")
    scale = np.sqrt(2.0) / distance
    return np.array([[scale, 0.0, -scale * middle[0]], [0.0, scale, -scale * middle[1]], [0.0, 0.0, 1.0]])


def read_homography(file: str | Path) -> Floats:
    """Homography from a file of points, one line `u,v,x,y` for each [pixel, pixel, m, m]."""
    numbers = np.array(read_numbers(file, "a pixel u,v and its place x,y [m]", 4))
    try:
        if np.abs(numbers).max() > FARTHEST:
            raise ValueError(f"no pixel and no place is beyond {FARTHEST:g}.")
        return homography(numbers[:, :2], numbers[:, 2:])
    except ValueError as unfit:
        raise ValueError(f"{file}: {unfit}") from None


def mapped(matrix: Floats, points: Floats) -> Floats:
    """Points by a homography, shape (n, 2)."""
    found = np.hstack([points, np.ones((len(points), 1))]) @ matrix.T
    with np.errstate(all="ignore"):  # on the horizon a place is infinite, which no track takes
        return np.asarray(found[:, :2] / found[:, 2:])


def turned(matrix: Floats, points: Floats, angles: Floats) -> Floats:
    """Directions at points, shape (n, 2), by a homography; angles of shape (n,), before and after [rad].

    Before, angles are those of the axes u and v, after those of x and y: (cos, sin) is mapped by the derivative.
    """
    along = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1) @ matrix.T
    at = np.hstack([points, np.ones((len(points), 1))]) @ matrix.T
    direction = along[:, :2] * at[:, 2:] - at[:, :2] * along[:, 2:]  # times w^2
    return np.asarray(np.arctan2(direction[:, 1], direction[:, 0]))
