"""`Body`: a rigid body between the limbs of a robot, and `Attachment`: where and how a limb is clamped to it.

Outlines of bodies: area, centre, second moment, widths and rims of discs and convex polygons.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import is_finite_number, require_number, shown
from seastar_gym.scene.number import Numbers, check_numbers, finite, not_negative, positive
from seastar_gym.scene.serial import register_part

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


GIVEN_DRAG = ("drag_along", "drag_across", "drag_turning")
GIVEN_FLUID = ("added_mass_along", "added_mass_across", "added_mass_turning")


Coefficient: TypeAlias = Annotated[Numbers | None, not_negative("1")]


@register_part
@dataclass(frozen=True)
class Attachment:
    """Clamp of a limb on a body at rest.

    x, y: Place of the clamp, from the hub [m]. direction: Direction in which the limb leaves it [rad], anti-clockwise
        from x.
    """

    x: Annotated[float, finite("m", "An attachment's ")]
    y: Annotated[float, finite("m", "An attachment's ")]
    direction: Annotated[float, finite("rad", "An attachment's ")]

    def __post_init__(self) -> None:
        check_numbers(self)


@register_part
@dataclass(frozen=True)
class Body:
    """Rigid body between the limbs, whose reference point is the hub. Without a size and mass it is the point hub.

    radius: Radius of a disc around the hub [m].
    outline: Instead of a disc, corners of a convex polygon (x, y) [m], anti-clockwise, with the hub (0, 0) inside.
        `Body.rectangle` makes one.
    height: Size out of the plane [m].
    mass: [kg]. None means the limbs' density times area and height.
    inertia: Moment of inertia about the centre of mass [kg m^2]. None means that of a uniform body of that mass.
    centre_of_mass: (x, y) [m] from the hub. None means the centre of the area.
    drag_coefficient: Drag coefficient [1] of the whole outline, whatever side flow meets. None means the fluid's C_d.
    drag_along, drag_across: Drag coefficients [1] of flow along the body's x and y axis, with the frontal area (width
        times height) of its outline.
    drag_turning: Drag coefficient [1] of turning: the torque is that of a plate as long as the outline is wide at most,
        a, which turns about its middle: 1/2 rho_f C h a^4/32 |omega| omega.
    added_mass_along, added_mass_across, added_mass_turning: Added mass coefficients [1] of the same three motions, over
        the added masses of an ellipse of the outline's widths a (along) and b (across): rho_f pi h times b^2/4, a^2/4
        and (a^2 - b^2)^2/128. None means the fluid's. They count in fluids with added mass only.
    attachments: `Attachment` of every limb. () attaches limbs to the rim in their directions from the hub, pointing
        away from it: a disc makes a star of that radius.

    With no drag given for a motion of its own (along, across, turning), a polygon has the drag of strips of its
    outline, each for the flow across it, with C_d, halved between the faces that flow meets and leaves; a disc has that
    of its width, and none in turning. Where one of the three is given, the others are C_d, or 0 for a disc that turns.
    C_d is the drag coefficient of the body, or the fluid's. It keeps the symmetry of the body, which drag of one
    direction breaks.

    Flow at the body is that at the hub. Fluid that moves along with the body is that of an ellipse about the hub.
    """

    radius: Annotated[float, not_negative("m", "A body's ")] = 0.0
    outline: Points = ()
    height: Annotated[Numbers, positive("m")] = 0.01
    mass: Annotated[Numbers | None, not_negative("kg")] = None
    inertia: Annotated[Numbers | None, not_negative("kg m^2")] = None
    centre_of_mass: tuple[float, float] | None = None
    drag_coefficient: Coefficient = None
    drag_along: Coefficient = None
    drag_across: Coefficient = None
    drag_turning: Coefficient = None
    added_mass_along: Coefficient = None
    added_mass_across: Coefficient = None
    added_mass_turning: Coefficient = None
    attachments: tuple[Attachment, ...] = ()

    def __post_init__(self) -> None:
        check_numbers(self)
        self._check_outline()
        centre = self.centre_of_mass
        if centre is not None and not _is_point(centre):
            raise ValueError(f"centre_of_mass must be two finite numbers (x, y) [m], not {shown(centre)}.")
        if not isinstance(self.attachments, tuple) or not all(isinstance(at, Attachment) for at in self.attachments):
            raise ValueError(f"attachments must be a tuple of Attachment, not {shown(self.attachments)}.")
        if not self.is_point and not self._has_inertia:
            raise ValueError(
                "A body without rotational inertia cannot turn by itself: give it an inertia, or a size and a mass."
            )

    def _check_outline(self) -> None:
        if isinstance(self.outline, tuple) and not self.outline:
            return
        if self.radius:
            raise ValueError("A body has a radius or an outline, not both.")
        if not isinstance(self.outline, tuple) or len(self.outline) < 3 or not all(map(_is_point, self.outline)):
            raise ValueError(f"outline must be three or more points (x, y) [m], not {shown(self.outline)}.")
        if not is_convex(self.outline):
            raise ValueError("outline must go round a convex polygon once, anti-clockwise, with the hub (0, 0) inside.")

    @classmethod
    def rectangle(cls, length: float, width: float, **others: Any) -> Body:
        """Body with a rectangular outline around the hub, `length` along x and `width` along y [m]."""
        require_number("length", length, "m")
        require_number("width", width, "m")
        x, y = 0.5 * length, 0.5 * width
        return cls(outline=((x, -y), (x, y), (-x, y), (-x, -y)), **others)

    @property
    def shape(self) -> Outline:
        """Outline with its area, centre and widths."""
        return Outline(self.radius, self.outline)

    @property
    def is_point(self) -> bool:
        """Whether it is nothing but the point hub: no size, no mass and no inertia."""
        weightless = not np.any(self.mass or 0.0) and not np.any(self.inertia or 0.0)
        return weightless and not self.radius and not self.outline and not self._has_arms

    @property
    def _has_arms(self) -> bool:
        return any(at.x or at.y for at in self.attachments)

    @property
    def _has_inertia(self) -> bool:
        if self.inertia is not None and np.all(self.inertia):
            return True
        massive = self.mass is None or bool(np.all(self.mass))
        has_size = bool(self.radius or self.outline)
        return self._has_arms or (has_size and (massive or not self.attachments))

    def mass_at(self, density: float) -> float:
        """Mass [kg] with limbs of a density [kg/m^3]; for the body of one robot."""
        return density * self.volume if self.mass is None else float(self.mass)

    def inertia_at(self, density: float) -> float:
        """Moment of inertia about the centre of mass [kg m^2] with limbs of a density [kg/m^3], of one robot."""
        if self.inertia is not None:
            return float(self.inertia)
        shape = self.shape
        return self.mass_at(density) * shape.second_moment / shape.area if shape.area else 0.0

    @property
    def volume(self) -> float:
        """Area times height [m^3], of one robot."""
        return self.shape.area * float(self.height)

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of mass [m]."""
        return self.shape.centre if self.centre_of_mass is None else self.centre_of_mass

    def attached(self, directions: list[float]) -> tuple[Attachment, ...]:
        """Attachments of limbs; of limbs in these directions [rad] at the rim, where the body names none."""
        if self.attachments:
            return self.attachments
        return tuple(Attachment(*self.shape.rim(direction), direction) for direction in directions)


def _is_point(value: object) -> bool:
    return isinstance(value, tuple) and len(value) == 2 and all(map(is_finite_number, value))
