"""Picture of the measured curves and their fits: a row of small graphs for each material."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seastar_gym.scene.actuators.pulse import pulse
from studies.measurements.fit import Fit
from studies.measurements.model import curvature
from studies.style import subplots

HEATING_SHARE = 0.1
"""Share of the stroke in which the ramp of Fig. 13.5b rises."""


def draw_curves(fits: dict[int, Fit], file: Path) -> None:
    """Measured curvatures (dots), fits (lines) and the chapter's ramp (dashed), with the error of every fit."""
    columns = max(len(fit.curves) for fit in fits.values())
    figure, axes = subplots(
        len(fits), columns, grid=False, figsize=(1.45 * columns, 1.6 * len(fits)), sharey=True, squeeze=False
    )
    for row, (liquid_metal, fit) in zip(axes, fits.items(), strict=True):
        for axis in row[len(fit.curves) :]:
            axis.set_visible(False)
        for axis, curve, error in zip(row, fit.curves, fit.errors, strict=False):
            t = np.linspace(0.0, 1.0, 400) / curve.frequency
            ramp = pulse(t, HEATING_SHARE / curve.frequency, (1.0 - HEATING_SHARE) / curve.frequency)
            axis.plot(t, curve.curvature.max() - curve.peak * ramp, "--", color="0.7", lw=0.8)
            axis.plot(t, curvature(fit.numbers, curve.frequency, t), color="#118855", lw=1.3)
            axis.plot(curve.times, curve.curvature, "o", color="#1b1f26", ms=1.8)
            colour = "#1b1f26" if error < 0.04 else "#cc3355"
            axis.set_title(f"{curve.frequency:g} Hz: {100 * error:.1f} %", fontsize=7, color=colour)
            axis.tick_params(labelsize=6)
            axis.set(xlim=(0.0, 1.0 / curve.frequency), ylim=(0.0, 140.0))
        row[0].set_ylabel(f"{liquid_metal} % liquid metal\ncurvature [1/m]", fontsize=7)
    figure.supxlabel("time since a pulse was given [s]", fontsize=8)
    figure.savefig(file)
