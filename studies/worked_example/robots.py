"""The robot of the example: as its maker writes it down, and as it was built.

The maker knows sizes and masses, and takes the rest from data sheets and textbooks. The robot that was built differs in
the numbers of DEVIATIONS, which the fit looks for, and in limbs that are not alike, of which the fit is not told.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from seastar_gym import AlongLimb, Body, Limb, Numerics, Scene, Seastar, SmaLimb, Water
from seastar_gym.identify import Measurement, get_parameter, synthetic, with_parameters

NOMINAL = Scene(
    Seastar(nodes_per_limb=13, youngs_modulus=1.0e6, along=AlongLimb(), body=Body(radius=0.02, drag_coefficient=1.0)),
    Water(drag_coefficient=1.0),
    SmaLimb(peak_angle=1.0),
    Numerics("implicit-midpoint", 4e-3, 1e-7),
)
"""What the maker writes down: five limbs on a disc, bent along their length by wires with a published limb's curve."""


class Deviation(NamedTuple):
    """Number of the robot that is not what it was taken for. built: In the unit of the scene. why: In a few words."""

    name: str
    unit: str
    built: float
    why: str


DEVIATIONS = (
    Deviation("robot.body.drag_coefficient", "1", 1.6, "screws, edges and wires on the body"),
    Deviation("fluid.drag_coefficient", "1", 1.2, "limbs are not smooth cylinders"),
    Deviation("robot.youngs_modulus", "Pa", 1.4e6, "wires stiffen the elastomer, whose modulus was taken"),
    Deviation("actuator.peak_angle", "rad", 0.85, "wires slip where they are clamped"),
    Deviation("actuator.rise", "widths", 10.0, "less voltage than at the bench"),
    Deviation("actuator.time_constant", "s", 1.2, "a thicker elastomer holds the heat"),
)
FITTED = tuple(each.name for each in DEVIATIONS)
"""Names of the numbers that are fitted."""

CURVATURE, UNLIKE = 0.2, 0.03
"""Standard deviation of the limbs' curvature at rest [1/m], and of their stiffness as a share of it [1]."""
CASTING = 0
"""Seed of what limbs are unlike in."""
FINE, NODES_FINE = Numerics("implicit-midpoint", 1e-3, 1e-7), 19
"""Numerics and nodes per limb of the tracked robot: finer than those of the fit."""
RATE, NOISE, LOST = 20.0, 1e-3, 0.03
"""Camera: pictures a second [Hz], error of a coordinate [m], share of the markers that a picture misses [1]."""


def built(nodes_per_limb: int = NODES_FINE, numerics: Numerics = FINE) -> Scene:
    """The robot as it was built, at a resolution."""
    rng = np.random.default_rng(CASTING)
    scene = with_parameters(NOMINAL, FITTED, [each.built for each in DEVIATIONS])
    limbs = tuple(
        Limb(
            youngs_modulus=scene.robot.youngs_modulus * (1.0 + UNLIKE * rng.standard_normal()),
            natural_curvature=CURVATURE * rng.standard_normal(),
        )
        for _ in range(scene.robot.n_limbs)
    )
    return replace(scene, robot=replace(scene.robot, nodes_per_limb=nodes_per_limb, limbs=limbs), numerics=numerics)


def tracked(robot: Scene, n_strokes: int, seed: int = 0) -> Measurement:
    """What a camera sees of hub and tips in strokes of random commands, as nodes of the scene that was written down."""
    seen, rng = synthetic(robot, {}, n_strokes, RATE, NOISE, seed), np.random.default_rng([seed, n_strokes])
    missed = rng.random(seen.positions.shape[:2]) < LOST
    edges = NOMINAL.robot.nodes_per_limb - 1
    tips = tuple(edges * (limb + 1) for limb in range(NOMINAL.robot.n_limbs))
    return replace(seen, positions=np.where(missed[..., None], np.nan, seen.positions), nodes=(0, *tips))


def nominal_values() -> list[float]:
    """Numbers that are fitted, as they were written down."""
    return [get_parameter(NOMINAL, name) for name in FITTED]
