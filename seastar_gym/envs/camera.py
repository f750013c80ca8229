"""Camera: which part of the plane a picture shows.

Lengths are in metres, y is up; pixels count from the upper left corner, y down.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


class Camera:
    """Map from metres to the pixels of a viewport, with one scale for x and y and the fitted box [m] in the middle."""

    def __init__(self, corners: FloatArray, viewport: tuple[int, int, int, int]) -> None:
        """corners: Points [m], shape (n, 2), whose bounding box is fitted; viewport: left, top, width, height [px]."""
        self.corners = np.array([corners.min(axis=0), corners.max(axis=0)])
        self.viewport = viewport
        left, top, width, height = viewport
        self.scale = float(np.min(np.array([width, height]) / np.ptp(self.corners, axis=0)))
        self._centre = self.corners.mean(axis=0)
        self._middle = np.array([left + width / 2, top + height / 2])

    def to_pixels(self, points: ArrayLike) -> FloatArray:
        """Pixels, shape (..., 2), of points [m], shape (..., 2)."""
        pixels: FloatArray = self._middle + (np.asarray(points) - self._centre) * [self.scale, -self.scale]
        return pixels

    @property
    def in_view(self) -> FloatArray:
        """Lower left and upper right corner of what the viewport shows [m], shape (2, 2)."""
        half = 0.5 * np.array(self.viewport[2:]) / self.scale
        corners: FloatArray = np.array([self._centre - half, self._centre + half])
        return corners

    def sees(self, points: FloatArray) -> bool:
        """Whether all points [m], shape (n, 2), lie in the viewport."""
        left, top, width, height = self.viewport
        pixels = self.to_pixels(points)
        return bool(np.all(pixels >= [left, top]) and np.all(pixels <= [left + width, top + height]))

    def widened(self, points: FloatArray, margin: float) -> Camera:
        """A camera that sees what this one was fitted to and points [m], shape (n, 2), with a margin [m] around."""
        return Camera(np.concatenate([self.corners, points - margin, points + margin]), self.viewport)
