"""Pictures of the accuracy study: work against precision, and errors of space and of time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from seastar_gym.files import save_figure
from seastar_gym.scene.numerics import PRESETS
from studies.accuracy.rows import Column, front
from studies.style import COLOURS, CYCLE, FAINT, INK, MS, PERCENT, as_numbers, as_percent, subplots
from studies.verification.published import PUBLISHED_FINALS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from studies.accuracy.rows import Row, Study

(OURS, CHAPTERS), OTHERS = CYCLE[:2], FAINT
PUBLISHED_LIMIT = 38.65e-3
"""Hub x [m] after ten strokes to which the published codes tend for short steps."""


class Published(NamedTuple):
    """A published code's speed in real time with steps [s] of ten nodes per limb, one core, its stock tolerances."""

    name: str
    step: float
    speed: float


PUBLISHED = (
    Published("dismech-rods", 10e-3, 11.8),
    Published("DDG_Tutorial_Fast", 10e-3, 8.5),
    Published("dismech-python", 10e-3, 2.4),
    Published("DDG_Tutorial (Octave)", 10e-3, 0.18),
    Published("dismech-rods", 3e-3, 4.3),
    Published("DDG_Tutorial_Fast", 3e-3, 3.5),
    Published("dismech-python", 3e-3, 0.75),
    Published("DDG_Tutorial (Octave)", 3e-3, 0.07),
)
"""Measured on the chapter's scene with hub hinges bent by their turning angle, on a 2-core AMD EPYC."""


def draw_all(found: Study, folder: Path) -> list[Path]:
    """Write all pictures into a folder and return their paths."""
    paths = []
    for name, draw in (("work_precision", work_precision), ("convergence", convergence)):
        figure: Figure = draw(found)
        paths.append(folder / f"{name}.png")
        save_figure(figure, paths[-1])
    return paths


def work_precision(found: Study) -> Figure:
    """Total error over speed: ours, the chapter's discretisation, the presets, and published codes."""
    figure, (path, straight) = subplots(2, 1, figsize=(7.2, 11.5))
    panels: tuple[tuple[Axes, Column], ...] = ((path, "path"), (straight, "straight"))
    for axes, column in panels:
        _draw_settings(axes, found.rows, column)
        _mark_presets(axes, found.rows, column, left=column == "straight")
        axes.set(xscale="log", yscale="log", xlabel="simulated over computing time, one core  (faster →)")
        axes.tick_params(labelsize=11)
        as_numbers(axes.xaxis)
        as_percent(axes.yaxis)
    _draw_published(straight, found.distances["straight"])
    path.set_title("Worst of pairs, pentagon and random commands", fontsize=12.5, loc="left")
    straight.set_title("Straight swim, with published codes", fontsize=12.5, loc="left")
    path.set_ylabel("error of space + error of time", fontsize=11.5)
    straight.set_ylabel("error of space + error of time", fontsize=11.5)
    path.set_xlim(right=3.0 * path.get_xlim()[1])
    figure.legend(*path.get_legend_handles_labels(), fontsize=11, loc="outside upper left")
    return figure


def _speed(row: Row, column: Column) -> float:
    return row.straight_speed if column == "straight" else row.speed


def _draw_settings(axes: Axes, rows: Sequence[Row], column: Column) -> None:
    """Draw all settings as dots, and what can be promised at a speed as a line."""
    for discretisation, colour, name in (
        ("continuum", OURS, "our discretisation"),
        ("chapter", CHAPTERS, "the chapter's"),
    ):
        mine = [row for row in rows if row.resolution.discretisation == discretisation]
        x, y = [_speed(row, column) for row in mine], [PERCENT * row.total(column) for row in mine]
        axes.plot(x, y, "o", ms=3.6, mew=0, alpha=0.35, color=colour)
        best = front(mine, lambda row: row.promise(column), lambda row: _speed(row, column))
        x, y = np.array([(_speed(row, column), PERCENT * row.promise(column)) for row in best]).T
        label = f"{name}: the least error that can be promised"
        axes.plot(x, y, drawstyle="steps-pre", color=colour, lw=1.8, label=label)


def _mark_presets(axes: Axes, rows: Sequence[Row], column: Column, left: bool) -> None:
    """Mark the presets, with their names on the left or on the lower right."""
    from matplotlib.patheffects import withStroke

    by_setting = {row.resolution: row for row in rows}
    for name, setting in PRESETS.items():
        row = by_setting[setting]
        x, y = _speed(row, column), PERCENT * row.promise(column)
        colour = CHAPTERS if name == "chapter" else OURS
        axes.plot(x, y, "s", ms=8, color=colour, mec=INK, mew=1.0)
        axes.annotate(
            f"{name}, N = {setting.nodes_per_limb}", (x, y), (-9, -4) if left else (7, -14), textcoords="offset points",
            fontsize=10.5, color=INK, ha="right" if left else "left",
            path_effects=[withStroke(linewidth=3, foreground="white")],
        )  # fmt: skip


def published_error(step: float, limit: float) -> float:
    """Error of space plus error of time of the published codes' straight swim; limit: the continuum's distance [m]."""
    finals = PUBLISHED_FINALS | {3e-3: 37.7359448e-3}
    return abs(PUBLISHED_LIMIT / limit - 1.0) + abs(finals[step] / PUBLISHED_LIMIT - 1.0)


def _draw_published(axes: Axes, limit: float) -> None:
    for step, marker in ((10e-3, "D"), (3e-3, "^")):
        mine = [each for each in PUBLISHED if each.step == step]
        error = PERCENT * published_error(step, limit)
        axes.plot([each.speed for each in mine], [error] * len(mine), marker, ms=7, color=OTHERS, mec=INK, mew=0.8)
        first = min(mine, key=lambda each: each.speed)
        axes.annotate(
            f"h = {MS * step:g} ms", (first.speed, error), (-9, 3 if step == 10e-3 else -6),
            textcoords="offset points", fontsize=9.5, ha="right", va="center", color=INK,
        )  # fmt: skip
    top = PERCENT * published_error(10e-3, limit)
    for name, speed, ha in (
        ("DDG_Tutorial\n(Octave)", 0.18, "center"), ("dismech-\npython", 2.4, "center"),
        ("DDG_Tutorial_Fast,\ndismech-rods", 8.5, "left"),
    ):  # fmt: skip
        axes.annotate(name, (speed, top), (0, 9), textcoords="offset points", fontsize=9.5, color=INK, ha=ha)
    axes.set_xlim(left=0.004)
    axes.set_ylim(top=4.0 * top)


def convergence(found: Study) -> Figure:
    """Error of time over the time step, and error of space over the nodes per limb, for both discretisations."""
    from matplotlib.ticker import NullLocator

    figure, (time, space) = subplots(1, 2, figsize=(11.5, 4.9))
    fixed = [row for row in found.rows if row.mesh[1] == 10 and row.resolution.numerics.path_tolerance is None]
    tightest_last = sorted(fixed, key=lambda row: -row.resolution.numerics.newton_tolerance)
    for discretisation, line in (("chapter", ":"), ("continuum", "-")):
        rows = {
            (row.resolution.numerics.scheme, row.resolution.numerics.step): row
            for row in tightest_last
            if row.resolution.discretisation == discretisation
        }
        for kind, colour in list(COLOURS.items())[:4]:
            mine = [(h, row) for (scheme, h), row in rows.items() if scheme == kind]
            points = sorted((MS * h, PERCENT * row.time.path) for h, row in mine)
            label = kind if discretisation == "continuum" else None
            if points:
                time.loglog(*np.array(points).T, f"o{line}", ms=4, lw=1.4, color=colour, label=label)
    time.set(xlabel="time step h [ms]", ylabel="error of time, worst path, N = 10")
    time.set_title("Time: the chapter's discretisation dotted, ours solid", fontsize=10.5, loc="left")
    time.legend(fontsize=8.5)
    time.set_xticks([0.1, 0.3, 1, 3, 10, 30], minor=False)
    time.xaxis.set_minor_locator(NullLocator())
    as_numbers(time.xaxis)
    as_percent(time.yaxis)
    nodes = sorted({row.mesh[1] for row in found.rows})
    for discretisation, colour, name in (("chapter", CHAPTERS, "the chapter's"), ("continuum", OURS, "ours")):
        by_nodes = {row.mesh[1]: row.space for row in found.rows if row.resolution.discretisation == discretisation}
        edges = np.array(sorted(n for n in by_nodes if by_nodes[n].path > 0.0))
        for column, line, what in (("path", "-", "worst path"), ("gait", "--", "gaits"), ("straight", ":", "straight")):
            values = [PERCENT * getattr(by_nodes[n], column) for n in edges]
            space.loglog(edges - 1, values, f"o{line}", ms=4, lw=1.4, color=colour, label=f"{name}, {what}")
    space.set_xticks([n - 1 for n in nodes], ["" if n in (11, 12) else str(n) for n in nodes])
    space.minorticks_off()
    space.set(xlabel="nodes per limb N", ylabel="error of space")
    space.set_title("Space: against infinitely many nodes", fontsize=10.5, loc="left")
    as_percent(space.yaxis)
    space.legend(fontsize=8.5, loc="center right")
    return figure
