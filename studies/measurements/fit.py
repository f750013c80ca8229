"""Least-squares fits of the curves of one material, their picture, and predictions of other frequencies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from seastar_gym.files import save_figure
from seastar_gym.scene.actuators.pulse import pulse
from studies.frame import Floats
from studies.measurements.curves import MODELS, Curve, curvature, peaks, read_curves
from studies.style import CYCLE, FAINT, INK, PERCENT, new_figure

RANGES: dict[str, tuple[float, float, float]] = {
    "rest_curvature": (100.0, 125.0, 150.0),
    "curvature_change": (30.0, 95.0, 160.0),
    "rise": (0.1, 11.0, 100.0),
    "middle": (0.5, 7.0, 60.0),
    "time_constant": (0.02, 0.6, 5.0),
    "width": (0.003, 0.05, 0.15),
    "hysteresis": (1e-3, 1.0, 20.0),
    "lag": (5e-4, 0.015, 0.019),
    "delay": (1e-4, 0.02, 0.06),
    "stress": (1e-4, 0.3, 2.0),
    "slow_rise": (1e-4, 0.3, 20.0),
    "slow_time": (0.05, 3.0, 30.0),
    "power": (1e-3, 1.0, 4.0),
}
"""Smallest number, first guess and largest number."""
STARTS = 5
"""Fits from the first guess and from guesses drawn around it, of which the best is kept."""
FLAT = 1e-9
"""Share of the largest singular value of the Jacobian below which a direction of the numbers is not identified."""


@dataclass(frozen=True)
class Fit:
    """Fit of a model to curves.

    numbers: Numbers of the model by name.
    curves: Fitted curves.
    residuals: Measured minus fitted curvature over the peak of the curve, shape (n_curves, n_samples).
    jacobian: Slopes of the fitted curvatures [1/m] by the logarithms of the numbers.
    """

    model: str
    numbers: dict[str, float]
    curves: tuple[Curve, ...]
    residuals: Floats
    jacobian: Floats

    @property
    def errors(self) -> Floats:
        """Root mean square residual of each curve, over its peak."""
        return np.asarray(np.sqrt(np.mean(self.residuals**2, axis=1)))

    @property
    def error(self) -> float:
        """Root mean square residual of all curves."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def independent_samples(self) -> float:
        """Number of independent residuals: neighbours in time are alike, with an autocorrelation that is summed."""
        r = self.residuals
        summed, lagged = 1.0, 1.0
        for lag in range(1, r.shape[1]):
            lagged = float(np.mean(r[:, lag:] * r[:, :-lag]) / np.mean(r**2))
            if lagged <= 0.0:
                break
            summed += 2.0 * lagged
        return r.size / summed

    @property
    def aic(self) -> float:
        """Akaike's criterion, if residuals were independent. Differences are smaller by their correlation."""
        return float(2.0 * self.residuals.size * np.log(self.error) + 2.0 * len(self.numbers))


def _modelled(logs: Floats, names: Sequence[str], curves: Sequence[Curve]) -> Floats:
    numbers = dict(zip(names, np.exp(logs), strict=True))
    return np.concatenate([curvature(numbers, curve.frequency, curve.times) for curve in curves])


def _slopes(logs: Floats, names: Sequence[str], curves: Sequence[Curve], step: float = 1e-5) -> Floats:
    """Central differences, shape (n_samples, n_numbers)."""
    rows = [_modelled(logs + d, names, curves) - _modelled(logs - d, names, curves) for d in step * np.eye(len(logs))]
    return np.array(rows).T / (2.0 * step)


def fit(model: str, curves: Sequence[Curve], starts: int = STARTS) -> Fit:
    """Fit of a model: least squares of the residuals over the peaks of their curves."""
    names, measured, scale = MODELS[model], np.concatenate([curve.curvature for curve in curves]), peaks(curves)
    lowest, guess, highest = np.log([RANGES[name] for name in names]).T
    rng, best = np.random.default_rng(0), None
    for start in range(starts):
        first = np.clip(
            guess + (0.4 * rng.standard_normal(len(guess)) if start else 0.0), lowest + 1e-6, highest - 1e-6
        )
        found = least_squares(
            lambda logs: (measured - _modelled(logs, names, curves)) / scale,
            first, bounds=(lowest, highest), x_scale="jac", max_nfev=200,
        )  # fmt: skip
        best = found if best is None or found.cost < best.cost else best
    assert best is not None
    return Fit(
        model, dict(zip(names, np.exp(best.x).tolist(), strict=True)), tuple(curves),
        best.fun.reshape(len(curves), -1), _slopes(best.x, names, curves),
    )  # fmt: skip


def predict(fitted: Fit, curves: Sequence[Curve], share: float = 0.9) -> tuple[Floats, Floats]:
    """Predicted curvature of other curves and half the width of its interval [1/m], shape (n_curves, n_samples) each.

    Laplace's approximation: the numbers are normal around the fit, with the covariance of as many independent residuals
    as their autocorrelation leaves. The model's own error, as large as the fit's residuals, is added to that of the
    numbers. share: Share of measurements that should lie within.
    """
    logs, names = np.log(list(fitted.numbers.values())), tuple(fitted.numbers)
    free = max(fitted.independent_samples - len(names), 1.0)
    variance = fitted.error**2 * fitted.independent_samples / free
    inflated = variance * fitted.residuals.size / fitted.independent_samples
    inverse = np.linalg.pinv(fitted.jacobian / peaks(fitted.curves)[:, None], rcond=FLAT)
    slopes, scale = _slopes(logs, names, curves), peaks(curves)
    of_numbers = np.einsum("si,ij,sj->s", slopes, inverse @ inverse.T * inflated, slopes)
    width = student.ppf(0.5 + share / 2.0, free) * np.sqrt(of_numbers + variance * scale**2)
    return _modelled(logs, names, curves).reshape(len(curves), -1), width.reshape(len(curves), -1)


HEATING_SHARE = 0.1
"""Share of the stroke in which the ramp of Fig. 13.5b rises."""
COLUMNS = 3
"""Curves of a material that are shown: the lowest frequency, the middle one and the highest."""
AIM = 0.04
"""Error of a fit that is aimed at, over the peak."""


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Measured curvatures (dots), fits (lines) and the chapter's ramp (dashed), and the error of every fit."""
    curves, fits = read_curves(), results["fits"]
    figure = new_figure(7.0, 1.35 * len(fits) + 3.2)
    parts: Any = figure.subfigures(2, 1, height_ratios=[1.35 * len(fits), 2.9])
    above, below = parts
    panels = above.subplots(len(fits), COLUMNS, sharey=True, squeeze=False)
    for row, (liquid_metal, fit) in zip(panels, fits.items(), strict=True):
        _draw_material(row, curves[int(liquid_metal)], fit)
        row[0].set_ylabel(f"{liquid_metal} %")
    above.supylabel("curvature [1/m], by the liquid metal in the elastomer")
    above.supxlabel("time since a pulse was given [s]")
    handles = panels[0, 0].get_lines()
    above.legend(handles=[handles[2], handles[1], handles[0]], labels=["measured", "fit", "ramp of the chapter"],
                 loc="outside upper center", ncols=3)  # fmt: skip
    _draw_errors(below, fits)
    save_figure(figure, file)


def _draw_material(row: Any, curves: Sequence[Curve], fit: Mapping[str, Any]) -> None:
    for axes, k in zip(row, (0, (len(curves) - 1) // 2, len(curves) - 1), strict=True):
        curve = curves[k]
        t = np.linspace(0.0, 1.0, 400) / curve.frequency
        ramp = pulse(t, HEATING_SHARE / curve.frequency, (1.0 - HEATING_SHARE) / curve.frequency)
        axes.plot(t, curve.curvature.max() - curve.peak * ramp, "--", color=FAINT, lw=0.9)
        axes.plot(t, curvature(fit["numbers"], curve.frequency, t), color=CYCLE[2], lw=1.5)
        axes.plot(curve.times, curve.curvature, "o", color=INK, ms=2.4)
        axes.set_title(f"{curve.frequency:g} Hz, error {100 * fit['errors'][k]:.1f} %", fontsize=9)
        axes.set(xlim=(0.0, 1.0 / curve.frequency), ylim=(0.0, 145.0), yticks=(0, 50, 100))
        axes.tick_params(labelsize=8)
        axes.grid(True)


def _draw_errors(figure: Any, fits: Mapping[str, Any]) -> None:
    axes = figure.subplots()
    axes.grid(True)
    for (liquid_metal, fit), colour, marker in zip(fits.items(), CYCLE, "os^Dv*", strict=True):
        errors = [PERCENT * error for error in fit["errors"]]
        axes.plot(fit["frequencies_hz"], errors, marker=marker, ms=5, color=colour, lw=1.0, label=f"{liquid_metal} %")
    axes.axhline(PERCENT * AIM, color=FAINT, ls="--", lw=1.0)
    axes.text(0.31, PERCENT * AIM + 0.15, "aim", color=FAINT)
    axes.set(xlabel="frequency of heating [Hz]", ylabel="error of the fit [%]", ylim=(0.0, None), xlim=(0.3, None))
    axes.legend(title="liquid metal", loc="upper left", ncols=2, bbox_to_anchor=(0.07, 1.0))
