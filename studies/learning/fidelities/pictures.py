"""Heat map of the study: strokes by the fidelity of the training and the physics of the swims."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from studies.learning.fidelities.scenes import FIDELITIES, NODES, PHYSICS, SWUM
from studies.learning.fidelities.tables import matrix, trained

INK = "#1b1f26"


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Draw the interquartile means of all policies' strokes, the lowest of every column in bold."""
    from matplotlib.figure import Figure

    rows, found = list(trained(results)), matrix(results)
    values = np.array([[found[row, column].mean for column in SWUM] for row in rows])
    figure = Figure(figsize=(10.5, 2.2 + 0.36 * len(rows)), layout="constrained")
    axes = figure.subplots()
    low, high = float(values.min()), float(min(values.max(), 1.15 * values.min()))
    shown = axes.imshow(values, cmap="viridis_r", aspect="auto", vmin=low, vmax=high)
    for (i, j), value in np.ndenumerate(values):
        best = value == values[:, j].min()
        axes.text(
            j, i, f"{value:.0f}", ha="center", va="center", fontsize=9, fontweight="bold" if best else "normal",
            color="white" if value > 0.5 * (low + high) else INK,
        )  # fmt: skip
    axes.set_xticks(range(len(SWUM)), list(SWUM), rotation=40, ha="left", fontsize=9)
    axes.xaxis.tick_top()
    axes.set_yticks(range(len(rows)), rows, fontsize=9)
    axes.set_xlabel("swum on", fontsize=10)
    axes.xaxis.set_label_position("top")
    axes.set_ylabel("trained at", fontsize=10)
    for column in (*range(len(NODES), len(FIDELITIES), len(NODES)), len(FIDELITIES)):
        wide = column == len(FIDELITIES)
        axes.axvline(column - 0.5, color="white", lw=4.0 if wide else 1.5)
        if not wide and column < len(rows):
            axes.axhline(column - 0.5, color="white", lw=1.5)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    seeds = sorted({len(results["runs"][row]) for row in rows})
    figure.colorbar(shown, ax=axes, shrink=0.85, pad=0.015, extend="max").set_label(
        f"strokes to finish, interquartile mean\n{' to '.join(map(str, dict.fromkeys((seeds[0], seeds[-1]))))} seeds, "
        f"{results['settings']['paths']} paths, {len(PHYSICS)} physics unseen",
        fontsize=9,
    )
    figure.savefig(file, dpi=130)
