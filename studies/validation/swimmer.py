"""The swimmer as a scene: a frame with four limbs that straighten when heated, for many samples of its unknowns.

Limbs leave the frame's sides in two pairs, swept backwards by an unknown angle. At rest they curl backwards with the
measured curvature; heated, they straighten. The curve is that of a limb that has been heated for ever. Curled forward,
most samples would swim backwards.
"""

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import AlongLimb, Limb, MeasuredCurve, Numerics, Scene, Seastar, Stiffening, Water
from seastar_gym.scene.actuators.sma_limb import MEASURED
from seastar_gym.scene.body import Attachment, Body
from studies.measurements.model import curvature
from studies.validation.speeds import Condition

Floats = NDArray[np.float64]
Variant = Literal["full", "no added mass", "no stiffening", "ramp", "no drag along limbs"]

FRAME = (0.08, 0.04, 0.015)
"""Length, width and height of the frame [m]. Its drag and mass are unknown, so its size only places the limbs."""
ROOTS = 0.025
"""Distance of the pairs of limbs from the middle of the frame, forward and backward [m]."""
NODES, STEP = 7, 0.01
"""Nodes per limb and time step [s]."""
ELASTOMER, LIQUID_METAL, WATER = 1000.0, 6250.0, 1000.0
"""Densities [kg/m^3]."""
RELAXATION = 2e-3
"""Relaxation time of the limbs' damping [s]."""
RAMP = 0.1
"""Time in which the chapter's ramp rises [s]."""
NONE_OF_IT = 1e-6
"""Factor of a coefficient that is left out, so that the same code runs."""
INSTANTS = 2001
"""Instants of a period at which its curve is taken."""
LOOSE = 1.0
"""Largest distance of the samples' polygon from the curve [1/m]."""
SIDES = (1.0, 1.0, -1.0, -1.0)
"""Sign of the curvature of every limb at rest, and its command: limbs on the left curl anti-clockwise, backwards."""


def scene(
    condition: Condition, values: Mapping[str, Floats], sweep: float, variant: Variant = "full", finer: int = 1
) -> Scene:
    """Swimmers with values of their unknowns.

    sweep: Angle by which limbs are swept backwards where they leave the frame [rad].
    finer: Factor of the number of edges and steps.
    """
    times, curvatures = bending(condition.liquid_metal, condition.frequency, ramp=variant == "ramp")
    rest, length = float(curvatures[0]), values["limb length"]
    change = (*(curvatures[:-1] - rest).tolist(), 0.0)
    strip = round_limb(values)
    along = values["limb drag along"] * (NONE_OF_IT if variant == "no drag along limbs" else 1.0)
    added = strip.added_mass * (NONE_OF_IT if variant == "no added mass" else 1.0)
    ratio = np.ones_like(length) if variant == "no stiffening" else values["hot over cold EI"]
    robot = Seastar(
        4,
        finer * (NODES - 1) + 1,
        limb_length=length,
        rod_radius=strip.radius,
        youngs_modulus=strip.youngs_modulus,
        density=ELASTOMER + (LIQUID_METAL - ELASTOMER) * 0.01 * condition.liquid_metal,
        limbs=tuple(Limb(natural_curvature=side * rest) for side in SIDES),
        relaxation_time=RELAXATION,
        along=AlongLimb(),
        stiffening=Stiffening(ratio),
        body=frame(values["body mass"], values["body drag"], sweep),
    )
    water = Water(WATER, strip.drag, along * strip.drag, added_mass_coefficient=added)
    actuator = MeasuredCurve(times, change, scale=length)
    return Scene(robot, water, actuator, Numerics("implicit-midpoint", STEP / finer))


class RoundLimb(NamedTuple):
    """Round limb with the section, bending stiffness, drag and added mass of a strip.

    radius: [m]. youngs_modulus: [Pa]. drag, added_mass: Coefficients [1] of flow across, over those of a round limb.
    """

    radius: Floats
    youngs_modulus: Floats
    drag: Floats
    added_mass: Floats


def round_limb(values: Mapping[str, Floats]) -> RoundLimb:
    """A strip's width is out of the plane, so flow across meets it; it bends about its thickness.

    A plate of width w carries along the fluid of a cylinder of that diameter.
    """
    width, thickness = values["limb width"], values["limb thickness"]
    radius = np.sqrt(width * thickness / np.pi)
    EI = values["Young's modulus"] * width * thickness**3 / 12.0
    return RoundLimb(
        radius=radius,
        youngs_modulus=4.0 * EI / (np.pi * radius**4),
        drag=values["limb drag across"] * 0.5 * width / radius,
        added_mass=values["added mass"] * (0.5 * width / radius) ** 2,
    )


def frame(mass: Floats, drag: Floats, sweep: float) -> Body:
    """Frame with the roots of its limbs."""
    length, width, height = FRAME
    y, out = 0.5 * width, 0.5 * np.pi + sweep
    roots = ((ROOTS, y, out), (-ROOTS, y, out), (-ROOTS, -y, -out), (ROOTS, -y, -out))
    return Body.rectangle(
        length, width, height=height, mass=mass, drag_along=drag, drag_across=1.0,
        attachments=tuple(Attachment(*root) for root in roots),
    )  # fmt: skip


def bending(liquid_metal: int, frequency: float, ramp: bool = False) -> tuple[tuple[float, ...], Floats]:
    """Times [s] and curvatures [1/m] of a limb over one period, as few as describe the curve.

    ramp: The chapter's ramp between the same curvatures, instead of the fit of the measured curve.
    """
    t, k = measured_curve(liquid_metal, frequency)
    if ramp:
        t, k = np.array([0.0, RAMP, t[-1]]), np.array([k[0], k.min(), k[0]])
    kept = polygon(t, k)
    return tuple(t[kept].tolist()), k[kept]


def measured_curve(liquid_metal: int, frequency: float) -> tuple[Floats, Floats]:
    """Times [s] and curvatures [1/m] of a limb over one period: the fit of what was measured of this material."""
    numbers = MEASURED[liquid_metal]._asdict()
    numbers["width"] = numbers.pop("heating_time")
    t = np.linspace(0.0, 1.0 / frequency, INSTANTS)
    k = curvature(numbers, frequency, t)
    k[-1] = k[0]
    return t, k


def polygon(t: Floats, k: Floats) -> list[int]:
    """Indices of the samples between which the curve is straight but for LOOSE (Douglas and Peucker)."""
    kept, pieces = {0, len(t) - 1}, [(0, len(t) - 1)]
    while pieces:
        a, b = pieces.pop()
        off = np.abs(k[a : b + 1] - np.interp(t[a : b + 1], t[[a, b]], k[[a, b]]))
        if off.max() > LOOSE:
            middle = a + int(off.argmax())
            kept.add(middle)
            pieces += [(a, middle), (middle, b)]
    return sorted(kept)
