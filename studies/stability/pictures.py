"""Pictures of the atlas of stability. matplotlib is imported only where something is drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from seastar_gym.files import save_figure
from studies.chapter import ISSUES_FROM
from studies.stability.cases import Sweep, format_step, format_value
from studies.style import FAINT, INK, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from studies.stability.cells import Cell

MARK, EMPTY = "#d62728", "#eceff3"
NEEDS = ("plain Newton", "regularised matrix or line search", "substeps", "failed")
"""Needs of the solver, from least to most."""
NEED_COLOURS = ("#c7e0f4", "#5aa2d6", "#1b4f8f", "#d62728")
NAMES = {
    "implicit-euler": "Implicit Euler",
    "implicit-midpoint": "Implicit midpoint rule",
    "sdirk2": "SDIRK2",
    "sdirk3": "SDIRK3",
}
FRAME: dict[str, Any] = {"fill": False, "edgecolor": INK, "linewidth": 1.4}
DASHES: dict[str, Any] = {"color": MARK, "linewidth": 1.6, "linestyle": (0, (4, 2))}


class Numbers(NamedTuple):
    """A positive number of every cell, drawn on a logarithmic scale.

    colours: Name of a map. limits: Ends of the scale. tick: Format. missing: Legend of cells that have none.
    """

    title: str
    label: str
    of: Callable[[Cell], float]
    colours: str
    limits: tuple[float, float]
    tick: str
    missing: str = ""


NUMBERS = {
    "iterations": Numbers(
        "Newton iterations per time step", "Newton iterations per time step", lambda cell: cell.iterations,
        "viridis_r", (1.0, 300.0), "{:g}",
    ),
    "error": Numbers(
        "error of the hub's path against the converged run", "error of the hub's path",
        lambda cell: 100.0 * cell.error, "magma_r", (0.01, 100.0), "{:g} %", "no converged run",
    ),
}  # fmt: skip
"""What pictures show beside the needs of the solver, by the ends of their names."""


def draw(cells: Sequence[Cell], sweeps: Sequence[Sweep], steps: Sequence[float], scheme: str, file: Path) -> None:
    """Write the picture that a file's name ends with, such as stability_needs.png."""
    numbers = NUMBERS.get(file.stem.rpartition("_")[2])
    title = f"{NAMES[scheme]}: {'needs of the solver' if numbers is None else numbers.title}"
    figure, panels, foot = _panels(sweeps, title)
    if numbers is None:
        _draw_needs(panels, foot, cells, sweeps, steps)
    else:
        _draw_numbers(panels, foot, cells, sweeps, steps, numbers)
    save_figure(figure, file)


def _draw_needs(
    panels: list[Axes], foot: Axes, cells: Sequence[Cell], sweeps: Sequence[Sweep], steps: Sequence[float]
) -> None:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    for axes, sweep in zip(panels, sweeps, strict=True):
        grid = _grid(cells, sweep, steps, _need)
        axes.pcolormesh(grid, cmap=ListedColormap(NEED_COLOURS), vmin=-0.5, vmax=3.5, edgecolors="white", linewidth=0.5)
        _finish(axes, cells, sweep, steps)
    patches = [Patch(color=colour, label=need) for colour, need in zip(NEED_COLOURS, NEEDS, strict=True)]
    _legend(foot, [*patches, _refused_patch()])


def _need(cell: Cell) -> float:
    """Index into NEEDS of what the solver needed in a cell."""
    if cell.failed:
        return 3.0
    return 2.0 if cell.halvings else float(cell.regularised + cell.backtracks > 0)


def _draw_numbers(
    panels: list[Axes], foot: Axes, cells: Sequence[Cell], sweeps: Sequence[Sweep], steps: Sequence[float],
    numbers: Numbers,
) -> None:  # fmt: skip
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Patch

    low, high = numbers.limits
    for axes, sweep in zip(panels, sweeps, strict=True):
        grid = np.clip(_grid(cells, sweep, steps, numbers.of), low, high)
        image = axes.pcolormesh(grid, cmap=numbers.colours, norm=LogNorm(low, high), edgecolors="white", linewidth=0.5)
        _finish(axes, cells, sweep, steps)
    place = foot.inset_axes((0.0, 0.55, 0.5, 0.3))
    bar = foot.figure.colorbar(image, cax=place, orientation="horizontal", extend="both")
    ticks = [10.0**k for k in range(round(math.log10(low)), math.floor(math.log10(high)) + 1)]
    bar.set_ticks(ticks, labels=[numbers.tick.format(value) for value in ticks])
    bar.set_label(numbers.label)
    bar.ax.minorticks_off()
    patches = [Patch(facecolor=EMPTY, label=numbers.missing)] if numbers.missing else []
    _legend(foot, [*patches, _refused_patch()], 0.56)


def _panels(sweeps: Sequence[Sweep], title: str) -> tuple[Figure, list[Axes], Axes]:
    """Figure, axes of every sweep, and axes below them for legends."""
    columns = min(4, len(sweeps))
    rows = math.ceil(len(sweeps) / columns)
    figure = new_figure(3.1 * columns + 0.3, 2.75 * rows + 1.2)
    figure.suptitle(title, x=0.01, ha="left", fontsize=13)
    note = "Strokes with steps below 1 ms are cut short after 2000 steps."
    figure.text(0.99, 0.975, note, ha="right", fontsize=8.5, color=FAINT)
    grid = figure.add_gridspec(rows + 1, columns, height_ratios=[*[1.0] * rows, 0.16])
    panels = [figure.add_subplot(grid[k // columns, k % columns]) for k in range(len(sweeps))]
    for axes in panels[-columns:]:
        axes.set_xlabel("time step h", fontsize=8.5)
    foot = figure.add_subplot(grid[rows, :])
    foot.axis("off")
    return figure, panels, foot


def _grid(
    cells: Sequence[Cell], sweep: Sweep, steps: Sequence[float], number: Callable[[Cell], float]
) -> np.ma.MaskedArray[Any, Any]:
    """Number of every cell of a sweep, shape (n_values, n_steps); masked where there is none."""
    found = {(cell.value, cell.step): number(cell) for cell in cells if cell.sweep == sweep.name and not cell.refused}
    return np.ma.masked_invalid([[found.get((value, step), math.nan) for step in steps] for value in sweep.values])


def _finish(axes: Axes, cells: Sequence[Cell], sweep: Sweep, steps: Sequence[float]) -> None:
    """Add ticks, a title, the marks of the chapter, and hatching over refused cells."""
    from matplotlib.patches import Rectangle

    axes.set_facecolor(EMPTY)
    for cell in cells:
        if cell.sweep == sweep.name and cell.refused:
            corner = (steps.index(cell.step), sweep.values.index(cell.value))
            axes.add_patch(Rectangle(corner, 1, 1, facecolor="white", edgecolor=FAINT, hatch="////", linewidth=0.0))
    axes.set_xticks(np.arange(len(steps)) + 0.5, [format_step(step) for step in steps], rotation=90)
    axes.set_yticks(np.arange(len(sweep.values)) + 0.5, [format_value(sweep, value) for value in sweep.values])
    axes.tick_params(length=0, labelsize=8)
    axes.set_title(f"{sweep.label} [{sweep.unit}]" if sweep.unit else sweep.label, loc="left")
    for spine in axes.spines.values():
        spine.set_visible(False)
    if sweep.chapter in sweep.values:
        row = sweep.values.index(sweep.chapter)
        axes.add_patch(Rectangle((0, row), len(steps), 1, clip_on=False, path_effects=_halo(), **FRAME))
        axes.get_yticklabels()[row].set_fontweight("bold")
    if ISSUES_FROM in steps:
        column = steps.index(ISSUES_FROM)
        axes.axvline(column, path_effects=_halo(), **DASHES)
        axes.get_xticklabels()[column].set_color(MARK)


def _halo() -> list[Any]:
    """White outline of lines, which then show on any colour."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=3.2, foreground="white")]


def _refused_patch() -> Any:
    from matplotlib.patches import Patch

    return Patch(facecolor="white", edgecolor=FAINT, hatch="////", label="scene refused")


def _legend(foot: Axes, patches: list[Any], left: float = 0.0) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    marks = [
        Patch(label="the chapter's value", **FRAME),
        Line2D([], [], label="the chapter's numerical issues begin: 20 ms", **DASHES),
    ]
    foot.legend(
        handles=[*patches, *marks], loc="upper left", bbox_to_anchor=(left, 1.0), ncols=4 if left == 0.0 else 2,
        fontsize=9, borderaxespad=0.0,
    )  # fmt: skip
