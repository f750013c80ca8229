"""Unknowns of the swimmer, and what is believed of them before any of its speeds is known.

Ranges are those of robots of this kind: palm-sized, with silicone limbs of some millimetres, electronics and a battery
on a plastic frame. Nothing is taken from the measured speeds.
"""

from typing import NamedTuple

import numpy as np
from scipy.stats import qmc

from studies.frame import Floats

SWEEPS = tuple(np.radians([0.0, 25.0, 50.0, 75.0]).tolist())
"""Angles by which limbs may be swept backwards where they leave the frame [rad], equally likely; sample k has number
k mod 4. A scene has one, since attachments are the same for all robots of a batch."""


class Unknown(NamedTuple):
    """Number that is not known. Its logarithm is uniform between the ends of its range.

    low, high: Ends of the range. reason: Where it comes from.
    """

    name: str
    unit: str
    low: float
    high: float
    reason: str


UNKNOWNS = (
    Unknown("limb length", "m", 0.015, 0.045, "limbs bend by 105 to 320 degrees at rest"),
    Unknown("limb width", "m", 5e-3, 12e-3, "strips, out of the plane"),
    Unknown("limb thickness", "m", 1.5e-3, 4e-3, "strips, in the plane"),
    Unknown("Young's modulus", "Pa", 2e5, 2e6, "silicones with wires"),
    Unknown("body mass", "kg", 0.03, 0.15, "frame, battery, electronics"),
    Unknown("body drag", "1", 0.2, 1.2, "streamlined to blunt"),
    Unknown("limb drag across", "1", 1.0, 3.0, "plates; more in unsteady flow"),
    Unknown("limb drag along", "of across", 0.02, 0.3, "skin friction"),
    Unknown("added mass", "of a plate", 0.3, 1.2, "less for short plates"),
    Unknown("hot over cold EI", "1", 1.0, 4.0, "2.68 in a sister model"),
)


def of_sweep(values: dict[str, Floats], number: int) -> dict[str, Floats]:
    """Samples with this sweep."""
    return {name: column[number :: len(SWEEPS)] for name, column in values.items()}


def samples(n: int) -> dict[str, Floats]:
    """Values of every unknown in n robots, by name, from Sobol's sequence."""
    spread = qmc.Sobol(len(UNKNOWNS), seed=0).random(n)
    return {
        unknown.name: unknown.low * (unknown.high / unknown.low) ** column
        for unknown, column in zip(UNKNOWNS, spread.T, strict=True)
    }


def place_in_range(values: dict[str, Floats]) -> Floats:
    """Unknowns as places within their ranges, from 0 to 1, shape (n, n_unknowns)."""
    columns = [np.log(values[u.name] / u.low) / np.log(u.high / u.low) for u in UNKNOWNS]
    return np.stack(columns, axis=1)
