"""Curvature of a limb that is heated by a pulse in every period: 48 measured curves (README.md), and models of them.

A wire's temperature above the water, in widths of the transformation, follows Newton's law of cooling: it tends to
rise / (1 - exp(-width/tau)) during the pulse and to zero otherwise. In the periodic state, the pulse begins at

    theta_0 = rise * e / (1 - e * exp(-width/tau)),    e = exp(-(period - width)/tau).

The share of the recovered shape is logistic in temperature, 1/(1 + exp(middle - theta)), less its value in cold water,
and the curvature is the rest curvature minus the change times this share. `SmaLimb` is the model "delay" of this list.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import expit

from studies.frame import Floats

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


NEWTON = ("rest_curvature", "curvature_change", "rise", "middle", "time_constant", "width")
MODELS: dict[str, tuple[str, ...]] = {
    "newton": NEWTON,
    "hysteresis": (*NEWTON, "hysteresis"),
    "lag": (*NEWTON, "lag"),
    "delay": (*NEWTON, "delay"),
    "delay, stress": (*NEWTON, "delay", "stress"),
    "delay, slow heat": (*NEWTON, "delay", "slow_rise", "slow_time"),
    "delay, longer pulses": (*NEWTON, "delay", "power"),
}
"""Names of the numbers of each model.

hysteresis: The transformation back is lower by this much [widths]. lag: The limb follows the wire's temperature with
this time constant [s]. delay: Heat arrives this much later [s]. stress: The change of curvature grows with temperature,
by this share at the middle of the transformation. slow_rise, slow_time: A second exponential, as of an elastomer that
warms up. power: Pulses are longer at higher frequencies, by this power of the frequency.
"""


def pulsed(t: Floats, period: float, width: float, rise: float, tau: float) -> Floats:
    """Temperature of a wire that each pulse would lift by `rise` if it were cold, at times t in [0, period]."""
    steady = rise / -np.expm1(-width / tau)
    heated, cooled = np.exp(-width / tau), np.exp(-(period - width) / tau)
    start = rise * cooled / (1.0 - heated * cooled)
    hot = steady + (start - steady) * np.exp(-np.minimum(t, width) / tau)
    return np.asarray(hot * np.exp(-np.maximum(t - width, 0.0) / tau))


def lagging(t: Floats, period: float, width: float, rise: float, tau: float, lag: float) -> Floats:
    """Temperature of a wire as `pulsed` has it, behind a first-order lag [s]: a difference of two exponentials."""
    steady = rise / -np.expm1(-width / tau)
    behind = pulsed(t, period, width, steady * -np.expm1(-width / lag), lag)
    return (tau * pulsed(t, period, width, rise, tau) - lag * behind) / (tau - lag)


def curvature(numbers: Mapping[str, float], frequency: float, t: Floats) -> Floats:
    """Curvature [1/m] at times t since a pulse was given [s], in the periodic state. numbers: Those of one model."""
    n, period = numbers, 1.0 / frequency
    t = np.mod(t - n.get("delay", 0.0), period)
    longer = frequency ** n.get("power", 0.0)
    width, rise = n["width"] * longer, n["rise"] * longer
    theta = pulsed(t, period, width, rise, n["time_constant"])
    if "lag" in n:
        theta = lagging(t, period, width, rise, n["time_constant"], n["lag"])
    if "slow_rise" in n:
        theta = theta + pulsed(t, period, width, n["slow_rise"], n["slow_time"])
    middle = n["middle"] - np.where(t < width, 0.0, n.get("hysteresis", 0.0))
    cold = expit(-n["middle"])
    share = (expit(theta - middle) - cold) / (1.0 - cold)
    strength = 1.0 + n.get("stress", 0.0) * theta / n["middle"]
    return np.asarray(n["rest_curvature"] - n["curvature_change"] * share * strength)
