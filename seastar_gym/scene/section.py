"""Cross sections of limbs: `Disc`, `Strip`, `Tube`, and `Section` for numbers that were measured.

Every number may be a profile along the limb, or differ from robot to robot, as `Limb.radius` may.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.number import Numbers, PerRobot, Profile, as_tuple, check_numbers, positive, profile_at
from seastar_gym.scene.serial import register_part

BROADSIDE = ((0.1, 2.23), (0.2, 1.98), (0.5, 1.70), (1.0, 1.51), (2.0, 1.36), (5.0, 1.21), (10.0, 1.14))
"""Added mass of rectangles over that of the circle about their height, by height over width.

After DNV-RP-C205, within 2 % of potential flow (tests/scene/test_section.py). Above the table it tends to 1, as of a
thin plate. Below it, a long body with blunt ends has a source and a sink, and grows by 4/pi^2 with the logarithm.
"""


class Cut(NamedTuple):
    """Numbers of a limb's cross section at one place.

    area: Of the material [m^2]. displaced: Of the fluid that it takes the place of [m^2]. inert: Area of the robot's
        density that weighs as much [m^2].
    EI: Bending stiffness in the plane [N m^2]. thickness: Radius of the disc with the same EI/EA [m].
    width: Diameter that flow across the limb sees [m]. added: Area of the fluid that moves along across [m^2].
    reach: Distance from the centre line at which the limb touches others in the plane [m].
    """

    area: float
    displaced: float
    inert: float
    EI: float
    thickness: float
    width: float
    added: float
    reach: float


Width: TypeAlias = Annotated[Profile | Numbers, positive("m", "A section's ")]
Area: TypeAlias = Annotated[Profile | Numbers, positive("m^2", "A section's ")]
SecondMoment: TypeAlias = Annotated[Profile | Numbers | None, positive("m^4", "A section's ")]
AddedArea: TypeAlias = Annotated[Profile | Numbers | None, positive("m^2", "A section's ")]
Stiffness: TypeAlias = Annotated[Profile | Numbers | None, positive("N m^2", "A section's ")]
MassPerLength: TypeAlias = Annotated[Profile | Numbers | None, positive("kg/m", "A section's ")]
HalfWidth: TypeAlias = Annotated[Profile | Numbers | None, positive("m", "A section's ")]


@register_part
@dataclass(frozen=True)
class Disc:
    """Solid disc, the cross section of `Seastar(rod_radius=...)` and `Limb(radius=...)`.

    radius: [m].
    """

    radius: Annotated[Profile | Numbers, positive("m", "A disc's ")]

    def __post_init__(self) -> None:
        check_numbers(self)

    def cut(self, E: float, density: float, radius: float) -> Cut:
        """Numbers at a place with Young's modulus E [Pa], in a robot of a density [kg/m^3]."""
        area = np.pi * radius**2
        return Cut(area, area, area, E * np.pi * radius**4 / 4.0, radius, 2.0 * radius, area, radius)


@register_part
@dataclass(frozen=True)
class Strip:
    """Rectangle, such as a strip that was cut from a sheet.

    width: In the plane, in which the strip bends [m]: the thickness of a sheet on edge.
    height: Across the plane [m]. Flow across the limb sees it.
    """

    width: Annotated[Profile | Numbers, positive("m", "A strip's ")]
    height: Annotated[Profile | Numbers, positive("m", "A strip's ")]

    def __post_init__(self) -> None:
        check_numbers(self)

    def cut(self, E: float, density: float, width: float, height: float) -> Cut:
        """Numbers at a place with Young's modulus E [Pa], in a robot of a density [kg/m^3]."""
        area = width * height
        added = 0.25 * math.pi * height**2 * broadside(height / width)
        return Cut(area, area, area, E * height * width**3 / 12.0, width / math.sqrt(3.0), height, added, 0.5 * width)


@register_part
@dataclass(frozen=True)
class Tube:
    """Ring, closed at its ends: no water is inside.

    outer, inner: Radii [m].
    """

    outer: Annotated[Profile | Numbers, positive("m", "A tube's ")]
    inner: Annotated[Profile | Numbers, positive("m", "A tube's ")]

    def __post_init__(self) -> None:
        check_numbers(self)
        if not _is_less(self.inner, self.outer):
            raise ValueError("A tube's inner radius must be smaller than its outer one [m], all along it.")

    def cut(self, E: float, density: float, outer: float, inner: float) -> Cut:
        """Numbers at a place with Young's modulus E [Pa], in a robot of a density [kg/m^3]."""
        full, squares = math.pi * outer**2, outer**2 + inner**2
        area = math.pi * (outer - inner) * (outer + inner)
        return Cut(area, full, area, E * area * squares / 4.0, math.sqrt(squares), 2.0 * outer, full, outer)


@register_part
@dataclass(frozen=True)
class Section:
    """Cross section of which numbers were measured or computed.

    area: [m^2]. It gives stretching stiffness and buoyancy.
    second_moment: Second moment of area about the axis across the plane [m^4]; None where `bending_stiffness` is given.
    projected_width: Diameter that flow across the limb sees [m].
    added_area: Area of the fluid that moves along across [m^2]; None for the circle about the projected width.
    bending_stiffness: EI in the plane [N m^2], whatever Young's modulus is; None for that of the second moment.
    mass_per_length: [kg/m]; None for that of the robot's density.
    half_width: Distance from the centre line at which the limb touches others in the plane [m]; None for half of the
        projected width.
    """

    area: Area
    second_moment: SecondMoment
    projected_width: Width
    added_area: AddedArea = None
    bending_stiffness: Stiffness = None
    mass_per_length: MassPerLength = None
    half_width: HalfWidth = None

    def __post_init__(self) -> None:
        check_numbers(self)
        if (self.second_moment is None) == (self.bending_stiffness is None):
            raise ValueError("A section has either a second_moment [m^4] or a bending_stiffness [N m^2].")

    def cut(
        self,
        E: float,
        density: float,
        area: float,
        second_moment: float | None,
        width: float,
        added: float | None,
        stiffness: float | None,
        mass_per_length: float | None,
        reach: float | None,
    ) -> Cut:
        """Numbers at a place with Young's modulus E [Pa], in a robot of a density [kg/m^3]."""
        EI = E * second_moment if stiffness is None else stiffness  # type: ignore[operator]
        return Cut(
            area=area,
            displaced=area,
            inert=area if mass_per_length is None else mass_per_length / density,
            EI=EI,
            thickness=2.0 * math.sqrt(EI / (E * area)),
            width=width,
            added=0.25 * math.pi * width**2 if added is None else added,
            reach=0.5 * width if reach is None else reach,
        )


AnySection: TypeAlias = Disc | Strip | Tube | Section


def broadside(height_over_width: float) -> float:
    """Added mass of a rectangle that moves along its width, over that of the circle about its height, see BROADSIDE."""
    ratios, coefficients = zip(*BROADSIDE, strict=True)
    if height_over_width < ratios[0]:
        return coefficients[0] + 4.0 / math.pi**2 * math.log(ratios[0] / height_over_width)
    if height_over_width > ratios[-1]:
        return float(1.0 + (coefficients[-1] - 1.0) * ratios[-1] / height_over_width)
    return float(np.interp(math.log(height_over_width), np.log(ratios), coefficients))


def cuts(section: AnySection, moduli: tuple[float, ...], density: float, share: NDArray[np.float64]) -> list[Cut]:
    """Cuts of one robot's limb at fractions of its length from hub to tip; moduli: Profile of Young's modulus [Pa]."""
    numbers = [getattr(section, field.name) for field in dataclasses.fields(section)]
    places = [[None] * len(share) if number is None else profile_at(as_tuple(number), share) for number in numbers]
    return [section.cut(E, density, *place) for E, *place in zip(profile_at(moduli, share), *places, strict=True)]


def _is_less(inner: Profile | Numbers, outer: Profile | Numbers) -> bool:
    """Whether a number, of each robot or along a limb, is below another one everywhere."""
    if isinstance(inner, PerRobot) and isinstance(outer, PerRobot) and len(inner) == len(outer):
        return all(one < other for one, other in zip(inner, outer, strict=True))
    if isinstance(inner, PerRobot) or isinstance(outer, PerRobot):
        return max(as_tuple(inner)) < min(as_tuple(outer))
    corners = np.concatenate([np.linspace(0.0, 1.0, len(as_tuple(each))) for each in (inner, outer)])
    return bool(np.less(profile_at(as_tuple(inner), corners), profile_at(as_tuple(outer), corners)).all())
