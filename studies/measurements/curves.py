"""The 48 measured curves of curvature, see README.md in this folder."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FILE = Path(__file__).with_name("sma_limb_curvature.csv")
PHASES = np.arange(24) / 24
"""Phases of the samples. Phase 1 is phase 0 of the next period and is left out."""


@dataclass(frozen=True)
class Curve:
    """Curvature of a limb over one period.

    liquid_metal: Volume fraction of liquid metal in the elastomer [%].
    frequency: Frequency of heating [Hz].
    curvature: Mean curvature of the limb at PHASES [1/m].
    """

    liquid_metal: int
    frequency: float
    curvature: Floats

    @property
    def times(self) -> Floats:
        """Times of the samples since heating began [s]."""
        return PHASES / self.frequency

    @property
    def peak(self) -> float:
        """Largest minus smallest curvature [1/m], to which errors are related."""
        return float(np.ptp(self.curvature))


def read_curves() -> dict[int, list[Curve]]:
    """Measured curves of each material (volume fraction of liquid metal [%]), by frequency."""
    curves: dict[int, list[Curve]] = {}
    for liquid_metal, frequency, *curvature in np.loadtxt(FILE, delimiter=","):
        curves.setdefault(int(liquid_metal), []).append(Curve(int(liquid_metal), frequency, np.array(curvature[:-1])))
    return curves


def peaks(curves: Iterable[Curve]) -> Floats:
    """Peak of every sample's curve [1/m], shape (n_curves * n_samples,)."""
    return np.repeat([curve.peak for curve in curves], len(PHASES))
