"""The swimmer as a scene: a frame with four limbs that straighten when heated, for many samples of its unknowns; and
the speeds of all samples, side by side in batches, kept in files.

Limbs leave the frame's sides in two pairs, swept backwards by an unknown angle. At rest they curl backwards with the
measured curvature; heated, they straighten. The curve is that of a limb that has been heated for ever. Curled forward,
most samples would swim backwards.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from seastar_gym.scene import AlongLimb, Limb, MeasuredCurve, Numerics, Scene, Seastar, Stiffening, Strip, Water
from seastar_gym.scene.actuators.sma_limb import MEASURED
from seastar_gym.scene.body import Attachment, Body
from seastar_gym.simulator import Simulator
from studies.frame import Floats
from studies.measurements.curves import curvature, read_curves
from studies.validation.in_turn import LATE, InTurn
from studies.validation.priors import SWEEPS, of_sweep
from studies.validation.speeds import Condition

How = Literal["measured", "fitted", "80 ms", "ramp"]


class Variant(NamedTuple):
    """What a model has of the swimmer.

    bending: Curve of the limbs' curvature, see `bending`. lag: Of the rear pair [periods].
    strips: Limbs are strips, not discs of the same area, bending stiffness, drag and added mass.
    stiffening: Limbs stiffen with heat. added, along: Factors of added mass and of drag along limbs.
    """

    bending: How = "fitted"
    lag: float = 0.0
    strips: bool = False
    stiffening: bool = True
    added: float = 1.0
    along: float = 1.0


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
PULSE = 0.08
"""Time for which programs of the swimmer heat a limb [s]."""
NONE_OF_IT = 1e-6
"""Factor of a coefficient that is left out, so that the same code runs."""
TYPICAL = 80.0
"""Change of curvature [1/m] at which drag coefficients are those of the samples."""
INSTANTS = 2001
"""Instants of a period at which its curve is taken."""
LOOSE = 1.0
"""Largest distance of the samples' polygon from the curve [1/m]."""
SIDES = (1.0, 1.0, -1.0, -1.0)
"""Sign of the curvature of every limb at rest, and its command: limbs on the left curl anti-clockwise, backwards."""
FRONT = (True, False, False, True)
"""Limbs of the front pair."""
FULL = Variant()
LEFT_OUT = {
    "no added mass": Variant(added=NONE_OF_IT),
    "no stiffening": Variant(stiffening=False),
    "ramp": Variant("ramp"),
    "no drag along limbs": Variant(along=NONE_OF_IT),
}
"""Models with a part left out."""
ADDED = {
    "as above": FULL,
    "strips": Variant(strips=True),
    "pairs in turn": Variant(lag=0.5),
    "measured curves": Variant("measured"),
    "all three": Variant("measured", lag=0.5, strips=True),
}
"""The full model beside models with what it lacks."""
VARIANTS = {"full": FULL, **LEFT_OUT, **ADDED}


def scene(
    condition: Condition, values: Mapping[str, Floats], sweep: float, variant: Variant = FULL, finer: int = 1
) -> Scene:
    """Swimmers with values of their unknowns.

    sweep: Angle by which limbs are swept backwards where they leave the frame [rad].
    finer: Factor of the number of edges and steps.
    """
    times, curvatures = bending(condition, variant.bending)
    rest, length, limb = float(curvatures[0]), values["limb length"], cross_section(values, variant.strips)
    change = (*(curvatures[:-1] - rest).tolist(), 0.0)
    ratio = values["hot over cold EI"] if variant.stiffening else np.ones_like(length)
    robot = Seastar(
        4,
        finer * (NODES - 1) + 1,
        limb_length=length,
        density=ELASTOMER + (LIQUID_METAL - ELASTOMER) * 0.01 * condition.liquid_metal,
        limbs=tuple(Limb(natural_curvature=side * rest, section=limb.strip) for side in SIDES),
        relaxation_time=RELAXATION,
        along=AlongLimb(),
        stiffening=Stiffening(ratio),
        body=frame(values["body mass"], values["body drag"], sweep),
        **limb.robot,
    )
    along = values["limb drag along"] * variant.along * limb.drag
    water = Water(WATER, limb.drag, along, added_mass_coefficient=limb.added * variant.added)
    curve = MeasuredCurve(times, change, scale=length)
    actuator = InTurn(curve, variant.lag) if variant.lag else curve
    return Scene(robot, water, actuator, Numerics("implicit-midpoint", STEP / finer))


class CrossSection(NamedTuple):
    """Limbs of a strip, which stands across the plane and bends about its thickness, or of discs in its place.

    drag, added: Coefficients of flow across and of added mass [1]. strip: None for discs.
    robot: Young's modulus [Pa], and the radius of discs [m].
    """

    drag: Floats
    added: Floats
    robot: dict[str, Any]
    strip: Strip | None = None


def cross_section(values: Mapping[str, Floats], strips: bool) -> CrossSection:
    """Strips, or discs of their area, bending stiffness and drag; a thin plate carries along a circle of its width."""
    width, thickness = values["limb width"], values["limb thickness"]
    E, drag, added = values["Young's modulus"], values["limb drag across"], values["added mass"]
    if strips:
        return CrossSection(drag, added, {"youngs_modulus": E}, Strip(width=thickness, height=width))
    radius = np.sqrt(width * thickness / np.pi)
    EI, wider = E * width * thickness**3 / 12.0, 0.5 * width / radius
    disc = {"rod_radius": radius, "youngs_modulus": 4.0 * EI / (np.pi * radius**4)}
    return CrossSection(drag * wider, added * wider**2, disc)


def frame(mass: Floats, drag: Floats, sweep: float) -> Body:
    """Frame with the roots of its limbs."""
    length, width, height = FRAME
    y, out = 0.5 * width, 0.5 * np.pi + sweep
    roots = ((ROOTS, y, out), (-ROOTS, y, out), (-ROOTS, -y, -out), (ROOTS, -y, -out))
    return Body.rectangle(
        length, width, height=height, mass=mass, drag_along=drag, drag_across=1.0,
        attachments=tuple(Attachment(*root) for root in roots),
    )  # fmt: skip


def bending(condition: Condition, how: How) -> tuple[tuple[float, ...], Floats]:
    """Times [s] and curvatures [1/m] of a limb over one period, as few as describe the curve.

    how: The samples that were measured; the fit of the curves of its material; the samples, but straightened in PULSE;
        or the chapter's ramp to the smallest sample and back.
    """
    t, k = fitted_curve(condition) if how == "fitted" else measured_curve(condition)
    straight = int(k.argmin())
    if how == "ramp":
        t, k = np.array([0.0, RAMP, t[-1]]), k[[0, straight, 0]]
    elif how == "80 ms":
        share, later = np.linspace(0.0, 1.0, 20), (t > PULSE) & (np.arange(len(t)) > straight)
        fall = k[0] - (k[0] - k[straight]) * np.sin(0.5 * np.pi * share) ** 2
        t, k = np.append(PULSE * share, t[later]), np.append(fall, k[later])
    kept = polygon(t, k)
    return tuple(t[kept].tolist()), k[kept]


def measured_curve(condition: Condition) -> tuple[Floats, Floats]:
    """Times [s] and curvatures [1/m] of a limb over one period, as measured; the last is the first."""
    curves = {curve.frequency: curve for curve in read_curves()[condition.liquid_metal]}
    curve = curves[condition.frequency]
    return np.append(curve.times, 1.0 / condition.frequency), np.append(curve.curvature, curve.curvature[0])


def fitted_curve(condition: Condition) -> tuple[Floats, Floats]:
    """Times [s] and curvatures [1/m] of a limb over one period: the fit of all curves of this material."""
    numbers = MEASURED[condition.liquid_metal]._asdict()
    numbers["width"] = numbers.pop("heating_time")
    t = np.linspace(0.0, 1.0 / condition.frequency, INSTANTS)
    k = curvature(numbers, condition.frequency, t)
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


STROKES, FIRST = 8, 4
"""Strokes from rest, and those before the mean begins: speeds are those of strokes 5 to 8."""


def speeds(condition: Condition, values: dict[str, Floats], variant: Variant, finer: int = 1) -> Floats:
    """Mean forward speed of every sample [m/s], NaN where the solver gave up, shape (n_samples,)."""
    found = np.empty(len(values["limb length"]))
    for number, sweep in enumerate(SWEEPS):
        swimmers = of_sweep(values, number)
        found[number :: len(SWEEPS)] = swum(condition, swimmers, sweep, variant, finer)
    return found


def swum(condition: Condition, values: dict[str, Floats], sweep: float, variant: Variant, finer: int) -> Floats:
    """Speeds of samples with one sweep [m/s]."""
    n = len(values["limb length"])
    simulator = Simulator(scene(condition, values, sweep, variant, finer), n)
    late = np.where(FRONT, 1.0, LATE) if variant.lag else 1.0
    command, start = np.tile(late * np.array(SIDES), (n, 1)), np.zeros(n)
    for stroke in range(STROKES):
        if stroke == FIRST:
            start = simulator.hub_position()[:, 0]
        simulator.stroke(command)
    way = simulator.hub_position()[:, 0] - start
    return np.where(simulator.failed, np.nan, way * condition.frequency / (STROKES - FIRST))


def kept_speeds(
    file: Path, condition: Condition, values: dict[str, Floats], variant: Variant, finer: int = 1
) -> Floats:
    """Speeds of every sample [m/s] from a file, which is written where there is none."""
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        part = file.with_suffix(".part.npy")
        np.save(part, speeds(condition, values, variant, finer))
        part.replace(file)
    return np.asarray(np.load(file))
