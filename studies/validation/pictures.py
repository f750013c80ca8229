"""Measured over predicted speeds, with intervals."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.style import DPI, FAINT, INK, subplots
from studies.validation.inference import Prediction
from studies.validation.speeds import Condition

Floats = NDArray[np.float64]

COLOURS = {0: "#3366aa", 10: "#118855", 30: "#cc7a00", 40: "#cc3355", 50: "#8844aa"}
AUTHORS = 0.19
"""Mean error of the authors' own simulation."""


def draw_speeds(conditions: list[Condition], prediction: Prediction, chosen: list[int], title: str, file: Path) -> None:
    """Scatter plot: measured speed over prediction, 90 % intervals, and speeds that were identified from as rings."""
    figure, axis = subplots(figsize=(6.2, 6.0))
    top = 100.0
    line = np.array([0.0, top])
    axis.plot(line, line, color=INK, lw=1.0)
    axis.fill_between(line, (1.0 - AUTHORS) * line, (1.0 + AUTHORS) * line, color="0.93", zorder=0)
    axis.text(99.0, 60.0, "grey: ±19 %,\nthe authors' mean error", color=FAINT, fontsize=8, ha="right", va="top")
    for k, condition in enumerate(conditions):
        x, y = 1e3 * prediction.middle[k], 1e3 * condition.speed
        colour, used = COLOURS[condition.liquid_metal], k in chosen
        ends = [[x - 1e3 * prediction.low[k]], [1e3 * prediction.high[k] - x]]
        axis.errorbar(x, y, xerr=ends, color=colour, lw=0.7, alpha=0.35)
        axis.plot(x, y, "o", ms=8 if used else 5, mfc="white" if used else colour, color=colour, mew=1.6)
    for material, colour in COLOURS.items():
        axis.plot([], [], "o", ms=5, color=colour, label=f"{material} % liquid metal")
    axis.plot([], [], "o", ms=8, mfc="white", mew=1.6, color=INK, label="identified from")
    axis.set(
        xlim=(0.0, top), ylim=(0.0, 70.0), xlabel="predicted speed and 90 % interval [mm/s]",
        ylabel="measured speed [mm/s]", title=title,
    )  # fmt: skip
    axis.legend(fontsize=8, loc="upper left")
    figure.savefig(file, dpi=DPI)
