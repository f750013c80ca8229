"""Heat map of the study: strokes by the fidelity of the training and the physics of the swims."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from studies.learning.fidelities.scenes import FIDELITIES, PHYSICS, SWUM
from studies.learning.fidelities.tables import matrix, trained
from studies.style import INK, new_figure

MOST = 10.0
"""Excess [%] that is drawn darkest."""


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Draw the interquartile means of all policies' strokes, coloured by their excess over the lowest of the column."""
    rows, found = list(trained(results)), matrix(results)
    values = np.array([[found[row, column].mean for column in SWUM] for row in rows])
    figure = new_figure(10.5, 2.2 + 0.36 * len(rows))
    axes = figure.subplots()
    excess = 100.0 * (values / values.min(axis=0) - 1.0)
    shown = axes.imshow(excess, cmap="Blues", aspect="auto", vmin=0.0, vmax=MOST)
    for (i, j), value in np.ndenumerate(values):
        axes.text(j, i, f"{value:.0f}", ha="center", va="center", fontsize=9,
                  color="white" if excess[i, j] > 0.6 * MOST else INK)  # fmt: skip
    axes.set_xticks(range(len(SWUM)), list(SWUM), rotation=40, ha="left", fontsize=9)
    axes.xaxis.tick_top()
    axes.set_yticks(range(len(rows)), rows, fontsize=9)
    axes.set_xlabel("swum on", fontsize=10)
    axes.xaxis.set_label_position("top")
    axes.set_ylabel("trained at", fontsize=10)
    for names, line in ((list(SWUM), axes.axvline), (rows, axes.axhline)):
        for k in range(1, len(names)):
            if names[k] in PHYSICS and names[k - 1] in FIDELITIES:
                line(k - 0.5, color="white", lw=4.0)
            elif names[k] in FIDELITIES and names[k].split()[0] != names[k - 1].split()[0]:
                line(k - 0.5, color="white", lw=1.5)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    counts = sorted({len(results["runs"][row]) for row in rows})
    seeds = " to ".join(map(str, dict.fromkeys((counts[0], counts[-1]))))
    figure.colorbar(shown, ax=axes, shrink=0.85, pad=0.015, extend="max").set_label(
        "colour: strokes more than the best of the column [%]\n"
        f"numbers: strokes to finish, interquartile mean\nof {seeds} seeds and {results['settings']['paths']} paths",
        fontsize=9,
    )
    figure.savefig(file)
