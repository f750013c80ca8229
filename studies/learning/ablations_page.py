"""Table and picture of the ablations. Needs no torch."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from studies.style import CYCLE, FAINT, new_figure

DEFAULT = "whole commands"
"""Name of the variant without changes."""
COLUMNS = 3
LOW, HIGH = 165.0, 210.0
"""Strokes that the picture shows."""


def final_strokes(runs: Mapping[str, Any]) -> list[float]:
    """Mean strokes on the held-out paths at the end of the training, for every seed."""
    return [run["curve"][-1][1] for run in runs.values()]


def table(results: Mapping[str, Any]) -> str:
    """Table in Markdown: mean, best and worst strokes over seeds of every variant, and strokes round the pentagon."""
    lines = ["| training | held-out paths: mean strokes | pentagon, every seed |", "|---|---:|---|"]
    for name, runs in results["runs"].items():
        ends, pentagon = final_strokes(runs), ", ".join(str(run["pentagon"]) for run in runs.values())
        over_seeds = f" ({min(ends):.1f} to {max(ends):.1f})" if len(ends) > 1 else ""
        lines.append(f"| {name} | {np.mean(ends):.1f}{over_seeds} | {pentagon} |")
    return "\n".join(lines)


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Draw the learning curve of every variant beside the default one: mean and range over seeds."""
    others = [name for name in results["runs"] if name != DEFAULT] or [DEFAULT]
    rows = -(-(len(others) + 1) // COLUMNS)
    figure = new_figure(7.0, 0.5 + 2.0 * rows)
    panels = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, name in zip(panels, others, strict=False):
        for label, colour in ((DEFAULT, FAINT), (name, CYCLE[0])):
            _draw_curves(axes, results["runs"].get(label, {}), colour)
        axes.set(ylim=(LOW, HIGH))
        axes.set_title(name)
        axes.tick_params(labelbottom=True)
        axes.grid(True)
    for axes in panels[len(others) :]:
        axes.set_axis_off()
    panels[len(others)].legend(
        panels[0].get_lines()[:2], [f"{DEFAULT}:\nnothing changed", "the change in\nthe title"],
        title="line: mean of the seeds\nband: lowest to highest", alignment="left", loc="center",
    )  # fmt: skip
    figure.supxlabel("strokes trained [thousands]")
    figure.supylabel("strokes to the last waypoint, mean of the held-out paths")
    figure.savefig(file)


def _draw_curves(axes: Any, runs: Mapping[str, Any], colour: str) -> None:
    curves = np.array([run["curve"] for run in runs.values()])
    if curves.size:
        trained, strokes = 1e-3 * curves[0, :, 0], curves[:, :, 1]
        axes.fill_between(trained, strokes.min(axis=0), strokes.max(axis=0), color=colour, alpha=0.25, lw=0)
        axes.plot(trained, strokes.mean(axis=0), color=colour)
