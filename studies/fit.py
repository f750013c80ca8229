"""The presets of `SmaLimb`: fits of 48 measured curves of shape memory alloy limbs in water.

    python -m studies.fit

prints the numbers of every material, and how far each curve is from the fit, as a fraction of its peak.

`sma_limb_curvature.csv` has the mean curvature of a limb [1/m] at 25 equally spaced phases of one period, for six
volume fractions of liquid metal in its elastomer and frequencies of heating from 0.4 to 2.3 Hz. Phase 0 is where
heating begins. The limb is most bent at rest and straightens when it is heated.

Source: repository `softmachineslab/frog`, commit 53b3136 (Soft Machines Lab, "Untethered Soft Robots - Design and
Closed Loop Motion Planning with Discrete Elastic Rods"). Licence: none. The repository states no licence, so none of
its files is here; the numbers are its measurements, resampled. The MIT licence of this package is not one for them:
cite the source, and ask its authors before you publish the file elsewhere. The fitted numbers are all that a wheel has
of them; an sdist has the file.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import expit

from seastar_gym.scene.actuators.sma_limb import Measured
from studies.frame import Floats, Results, Study
from studies.pages import markdown, show

FILE = Path(__file__).with_name("sma_limb_curvature.csv")
PHASES = np.arange(24) / 24
"""Phases of the samples. Phase 1 is phase 0 of the next period and is left out."""
LOWEST = Measured(100.0, 30.0, 0.1, 0.5, 0.02, 0.003, 1e-4)
GUESS = Measured(125.0, 95.0, 11.0, 7.0, 0.6, 0.05, 0.02)
HIGHEST = Measured(150.0, 160.0, 100.0, 60.0, 5.0, 0.15, 0.06)
"""Smallest numbers, first guess and largest numbers."""
STARTS = 5
"""Fits from the first guess and from guesses drawn around it, of which the best is kept."""


class Curve(NamedTuple):
    """Curvature of a limb over one period. frequency: Of heating [Hz]. curvature: At PHASES [1/m]."""

    frequency: float
    curvature: Floats

    @property
    def peak(self) -> float:
        """Largest minus smallest curvature [1/m], to which errors are related."""
        return float(np.ptp(self.curvature))


def read_curves() -> dict[int, list[Curve]]:
    """Measured curves of each material (volume fraction of liquid metal [%]), by frequency."""
    curves: dict[int, list[Curve]] = {}
    for liquid_metal, frequency, *curvature in np.loadtxt(FILE, delimiter=","):
        curves.setdefault(int(liquid_metal), []).append(Curve(frequency, np.array(curvature[:-1])))
    return curves


def curvature(numbers: Measured, frequency: float, t: Floats) -> Floats:
    """Curvature [1/m] at times t since a pulse was given [s], in the periodic state of `SmaLimb`.

    A cold wire would be lifted by `rise` in each pulse. With e = exp(-(period - heating_time)/tau), a pulse begins at

        theta_0 = rise * e/(1 - e * exp(-heating_time/tau)).
    """
    n, period = numbers, 1.0 / frequency
    t = np.mod(t - n.delay, period)
    steady = n.rise / -np.expm1(-n.heating_time / n.time_constant)
    heated, cooled = np.exp(-np.array([n.heating_time, period - n.heating_time]) / n.time_constant)
    start = n.rise * cooled / (1.0 - heated * cooled)
    hot = steady + (start - steady) * np.exp(-np.minimum(t, n.heating_time) / n.time_constant)
    theta = hot * np.exp(-np.maximum(t - n.heating_time, 0.0) / n.time_constant)
    cold = expit(-n.middle)
    share = (expit(theta - n.middle) - cold) / (1.0 - cold)
    return np.asarray(n.rest_curvature - n.curvature_change * share)


def residuals(numbers: Measured, curves: Sequence[Curve]) -> Floats:
    """Measured minus modelled curvature over the peaks of the curves, shape (n_curves, n_samples)."""
    rows = [(one.curvature - curvature(numbers, one.frequency, PHASES / one.frequency)) / one.peak for one in curves]
    return np.array(rows)


def errors(numbers: Measured, curves: Sequence[Curve]) -> Floats:
    """Root mean square residual of every curve, over its peak."""
    return np.asarray(np.sqrt(np.mean(residuals(numbers, curves) ** 2, axis=1)))


def fit(curves: Sequence[Curve], starts: int = STARTS) -> Measured:
    """Numbers of the least squares, of logarithms within their ranges."""
    lowest, guess, highest = np.log([LOWEST, GUESS, HIGHEST])
    drawn = guess + 0.4 * np.random.default_rng(0).standard_normal((starts - 1, len(guess)))
    found = [
        least_squares(
            lambda logs: residuals(Measured(*np.exp(logs)), curves).ravel(),
            np.clip(start, lowest + 1e-6, highest - 1e-6),
            bounds=(lowest, highest), x_scale="jac", max_nfev=200,
        )
        for start in (guess, *drawn)
    ]  # fmt: skip
    return Measured(*np.exp(min(found, key=lambda each: each.cost).x).tolist())


def run(results: Results) -> None:
    """Fit all materials."""
    rows = []
    for liquid_metal, curves in read_curves().items():
        numbers = fit(curves)
        found = errors(numbers, curves)
        of_each = (f"{each.frequency:g} Hz {error:.3f}" for each, error in zip(curves, found, strict=True))
        print(f"{liquid_metal} %: {', '.join(of_each)}")
        rows.append([liquid_metal, *(f"{number:.4g}" for number in numbers), f"{np.sqrt(np.mean(found**2)):.3f}"])
    show(markdown(["liquid metal [%]", *Measured._fields, "error"], rows))


STUDY = Study("fit", run, out=Path("runs/fit"))
