"""Picture of the measured curves and their fits: a row of graphs for each material, and the errors of all fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.files import save_figure
from seastar_gym.scene.actuators.pulse import pulse
from studies.measurements.curves import Curve, curvature, read_curves
from studies.style import CYCLE, FAINT, INK, new_figure

HEATING_SHARE = 0.1
"""Share of the stroke in which the ramp of Fig. 13.5b rises."""
COLUMNS = 3
"""Curves of a material that are shown: the lowest frequency, the middle one and the highest."""
AIM = 4.0
"""Error of a fit that is aimed at [%]."""


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
        axes.plot(fit["frequencies_hz"], [100.0 * error for error in fit["errors"]], marker=marker, ms=5, color=colour,
                  lw=1.0, label=f"{liquid_metal} %")  # fmt: skip
    axes.axhline(AIM, color=FAINT, ls="--", lw=1.0)
    axes.text(0.31, AIM + 0.15, "aim", color=FAINT)
    axes.set(xlabel="frequency of heating [Hz]", ylabel="error of the fit [%]", ylim=(0.0, None), xlim=(0.3, None))
    axes.legend(title="liquid metal", loc="upper left", ncols=2, bbox_to_anchor=(0.07, 1.0))
