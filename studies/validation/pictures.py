"""Measured over predicted speeds, with intervals."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.files import save_figure
from studies.style import CYCLE, INK, subplots

COLOURS = {0: CYCLE[0], 10: CYCLE[2], 30: CYCLE[1], 40: CYCLE[3], 50: CYCLE[4]}
AUTHORS = 0.19
"""Mean error of the authors' own simulation."""
TOP = 100.0
"""Largest predicted speed of the axes [mm/s]."""


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Scatter plot: measured speed over prediction, 90 % intervals, and the speeds that were fitted to as rings."""
    figure, axes = subplots(figsize=(6.4, 6.4))
    line = np.array([0.0, TOP])
    axes.plot(line, line, color=INK, lw=1.0, label="predicted as measured")
    axes.fill_between(line, (1.0 - AUTHORS) * line, (1.0 + AUTHORS) * line, color="0.93", zorder=0,
                      label=f"±{100 * AUTHORS:.0f} %: mean error of the\nauthors' own simulation")  # fmt: skip
    for one in results["speeds_mm_per_s"]:
        x, y = one["predicted"], one["measured"]
        colour, used = COLOURS[one["liquid_metal"]], one["identified_from"]
        axes.errorbar(x, y, xerr=[[x - one["low"]], [one["high"] - x]], color=colour, lw=0.7, alpha=0.35)
        axes.plot(x, y, "o", ms=8 if used else 5, mfc="white" if used else colour, color=colour, mew=1.6)
    for material, colour in COLOURS.items():
        axes.plot([], [], "o", ms=5, color=colour, label=f"{material} % liquid metal in the limbs")
    axes.plot(
        [], [], "o", ms=8, mfc="white", mew=1.6, color=INK, label="one of the four speeds that\nthe model is fitted to"
    )
    off = 100.0 * results["models"]["full"]["score"]["error"]
    predicted = sum(not one["identified_from"] for one in results["speeds_mm_per_s"])
    axes.set(
        xlim=(0.0, TOP), ylim=(0.0, 92.0), xlabel="predicted speed and its 90 % interval [mm/s]",
        ylabel="measured speed [mm/s]", title=f"{predicted} predicted speeds, {off:.0f} % off on average",
    )  # fmt: skip
    axes.legend(fontsize="small", loc="upper left", ncols=2)
    save_figure(figure, file)
