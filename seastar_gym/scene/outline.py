"""Outlines of bodies: area, centre, second moment, widths and rims of discs and convex polygons."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Points = tuple[tuple[float, float], ...]

CIRCLE = 96
"""Points of a disc that is drawn."""


class Outline(NamedTuple):
    """Disc of a radius [m], or a convex polygon of points [m], anti-clockwise; about the hub at the origin."""

    radius: float
    points: Points

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return float(self._moments()[0]) if self.points else math.pi * self.radius**2

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of the area [m]."""
        if not self.points:
            return 0.0, 0.0
        area, first, _ = self._moments()
        x, y = (first / area).tolist()
        return x, y

    @property
    def second_moment(self) -> float:
        """Polar second moment of the area about its centre [m^4]."""
        if not self.points:
            return 0.5 * math.pi * self.radius**4
        area, first, second = self._moments()
        return float(second - first @ first / area)

    @property
    def widths(self) -> tuple[float, float]:
        """Extent along x and along y [m]."""
        if not self.points:
            return 2.0 * self.radius, 2.0 * self.radius
        along, across = np.ptp(np.array(self.points), axis=0).tolist()
        return along, across

    @property
    def reach(self) -> float:
        """Largest distance of its rim from the hub [m]."""
        return max((math.hypot(*point) for point in self.points), default=self.radius)

    def drawn(self) -> Floats:
        """Points of the outline [m], shape (n, 2), for pictures; empty without a size."""
        if self.points:
            return np.array(self.points)
        angles = 2.0 * np.pi * np.arange(CIRCLE if self.radius > 0.0 else 0) / CIRCLE
        return self.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)

    def rim(self, direction: float) -> tuple[float, float]:
        """Point of the rim [m] in a direction from the hub [rad]."""
        c, s = math.cos(direction), math.sin(direction)
        distance = self.radius
        if self.points:
            distance = min(place / flow for place, flow in self._sides_ahead(c, s))
        return distance * c, distance * s

    def _sides_ahead(self, c: float, s: float) -> list[tuple[float, float]]:
        """Distance of the hub from a side, and the part of (c, s) along its normal, of the sides that it meets."""
        normals, _, places = self.sides()
        flows = normals @ np.array([c, s])
        distances = (normals * places).sum(axis=1)
        return [(d, f) for d, f in zip(distances.tolist(), flows.tolist(), strict=True) if f > 1e-9]

    def sides(self) -> tuple[Floats, Floats, Floats]:
        """Outer normals, shape (n, 2), lengths [m] and middles [m], shape (n, 2), of the sides of a polygon."""
        points = np.array(self.points)
        edges = np.roll(points, -1, axis=0) - points
        lengths = np.hypot(edges[:, 0], edges[:, 1])
        return np.stack([edges[:, 1], -edges[:, 0]], axis=1) / lengths[:, None], lengths, points + 0.5 * edges

    def height_over(self, places: Floats) -> Floats:
        """Distance of places, shape (n, 2), from the rim [m], negative inside."""
        if not self.points:
            return np.asarray(np.hypot(*places.T) - self.radius)
        normals, _, middles = self.sides()
        inside = ((places[:, None] - middles) * normals).sum(axis=-1).max(axis=1)
        corners = np.array(self.points)
        sides = np.roll(corners, -1, axis=0) - corners
        from_corners = places[:, None] - corners
        share = np.clip((from_corners * sides).sum(axis=-1) / (sides * sides).sum(axis=-1), 0.0, 1.0)
        outside = np.linalg.norm(from_corners - share[..., None] * sides, axis=-1).min(axis=1)
        return np.where(inside < 0.0, inside, outside)

    def _moments(self) -> tuple[float, Floats, float]:
        """Area, first moment and polar second moment about the hub, triangle by triangle."""
        a = np.array(self.points)
        b = np.roll(a, -1, axis=0)
        twice = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        squares = (a * a + a * b + b * b).sum(axis=1)
        return 0.5 * float(twice.sum()), twice @ (a + b) / 6.0, float(twice @ squares) / 12.0


def is_convex(points: Sequence[tuple[float, float]]) -> bool:
    """Whether points go round a convex polygon once, anti-clockwise, with the origin inside it."""
    array = np.array(points)
    array = array / (np.abs(array).max() or 1.0)
    edges = np.roll(array, -1, axis=0) - array
    following = np.roll(edges, -1, axis=0)
    turns = np.arctan2(edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0], (edges * following).sum(axis=1))
    inside = array[:, 0] * edges[:, 1] - array[:, 1] * edges[:, 0]
    return bool((turns > 0.0).all() and abs(turns.sum() - 2.0 * np.pi) < 1e-6 and (inside > 0.0).all())
