"""Tables and picture of the work-precision study."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from seastar_gym.files import save_figure
from seastar_gym.scene.numerics import Fidelity
from studies.accuracy.pictures import CHAPTERS, OTHERS, OURS, PUBLISHED, published_error
from studies.accuracy.rows import front
from studies.pages import markdown
from studies.style import INK, MS, PERCENT, as_numbers, as_percent, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Row = Mapping[str, Any]
"""Numbers of a setting."""
Column = Literal["largest_error", "median_error", "straight_error"]

SETTLED = 0.01
"""Problems whose limit errs by more have no largest errors that mean anything: their medians are told instead."""


def label(row: Row) -> tuple[str, str]:
    """Nodes, and scheme and step, in words."""
    nodes = f"{row['nodes_per_limb']}" + (", chapter's" if row["discretisation"] == "chapter" else "")
    return nodes, f"{row['scheme']}, {MS * row['step']:g} ms"


def error(row: Row, column: Column = "largest_error") -> float:
    """Error in per cent: of the worst sequence, the median one, or the straight swim; infinite if the solver failed."""
    return math.inf if row[column] is None else PERCENT * float(row[column])


def settled(found: Row) -> bool:
    """Whether the worst sequences of a problem have a limit."""
    return float(found["limit_error"]) < SETTLED


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Small multiples of error over time: all problems with the same axes, and the straight swim with other codes."""
    problems = results["problems"]
    figure, axes = subplots(3, 3, figsize=(10.5, 10.0), sharey=True)
    grid = axes[0, 0].get_gridspec()
    for each in axes[0]:
        each.remove()
    wide = figure.add_subplot(grid[0, :], sharey=axes[1, 0])
    wide.grid(True, which="major", color="0.92", lw=0.8)
    small = axes[1:].ravel()
    for each in small[1:]:
        each.sharex(small[0])
    name, first = next((name, found) for name, found in problems.items() if "straight_distance" in found)
    _draw_panel(wide, first["settings"], f"{name}: straight swim, with published codes", "straight_error")
    _draw_published(wide, first["straight_distance"])
    for panel, (name, found) in zip(small, problems.items(), strict=False):
        column: Column = "largest_error" if settled(found) else "median_error"
        which = "worst" if settled(found) else "median"
        _draw_panel(panel, found["settings"], f"{name}: {which} of {found['sequences']} sequences", column)
    for each in small[len(problems) :]:
        each.set_axis_off()
    figure.supxlabel("processor time per stroke of a robot, one core [ms]  (slower →)", fontsize=11)
    figure.supylabel("largest distance from the path in the continuum, over its length", fontsize=11)
    figure.legend(*wide.get_legend_handles_labels(), loc="outside upper center", ncols=4, fontsize=10)
    save_figure(figure, file)


def _draw_panel(axes: Axes, rows: Sequence[Row], title: str, column: Column) -> None:
    """Draw settings as dots, the best of them as a line, and presets as squares with their initials."""
    kinds = (("continuum", OURS, "our discretisation"), ("chapter", CHAPTERS, "the chapter's discretisation"))
    for discretisation, colour, name in kinds:
        mine = [row for row in rows if row["discretisation"] == discretisation]
        axes.plot([row["ms_per_stroke"] for row in mine], [error(row, column) for row in mine], "o", ms=4, mew=0,
                  alpha=0.5, color=colour)  # fmt: skip
        best = front(mine, lambda row: error(row, column), lambda row: -float(row["ms_per_stroke"]), 0.0)
        axes.plot([row["ms_per_stroke"] for row in best], [error(row, column) for row in best],
                  drawstyle="steps-post", color=colour, lw=1.5, label=name)  # fmt: skip
    presets = [row for row in rows if row["preset"]]
    for preset in presets:
        x, y = preset["ms_per_stroke"], error(preset, column)
        colour = CHAPTERS if preset["discretisation"] == "chapter" else OURS
        axes.plot(x, y, "s", ms=8.5, color=colour, mec=INK, mew=0.9,
                  label="presets, by their initials" if preset is presets[0] else None)  # fmt: skip
        axes.annotate(preset["preset"][0], (x, y), (0, -0.5), textcoords="offset points", fontsize=7.5,
                      color="white", ha="center", va="center", fontweight="bold")  # fmt: skip
    axes.set(xscale="log", yscale="log")
    axes.set_title(title, loc="left")
    as_numbers(axes.xaxis)
    as_percent(axes.yaxis)


def _draw_published(axes: Axes, limit: float) -> None:
    names = dict.fromkeys(each.name for each in PUBLISHED)
    for name, marker in zip(names, "D^vP", strict=True):
        mine = [each for each in PUBLISHED if each.name == name]
        points = [(MS / each.speed, PERCENT * published_error(each.step, limit)) for each in mine]
        axes.plot(*zip(*points, strict=True), marker, ms=7, color=OTHERS, mec=INK, mew=0.8, ls="", label=name)
    for step, which, shift, side in ((10e-3, min, -9, "right"), (3e-3, max, 9, "left")):
        x = which(MS / each.speed for each in PUBLISHED if each.step == step)
        axes.annotate(f"h = {MS * step:g} ms", (x, PERCENT * published_error(step, limit)), (shift, 0), fontsize=9,
                      textcoords="offset points", color=INK, va="center", ha=side)  # fmt: skip


def of_presets(results: Mapping[str, Any]) -> str:
    """Table of the presets in Markdown, and what is concluded from all settings."""
    problems = results["problems"]
    head = ["preset", "error, chapter's robot", "error, others", "time per stroke, chapter's robot [ms]"]
    table = markdown(head, [_use(preset, problems) for preset in get_args(Fidelity)])
    return f"{table}\n\n{_conclusion(problems)} {_doubt(problems)}"


def of_settings(results: Mapping[str, Any]) -> str:
    """Table of all settings in Markdown."""
    problems = results["problems"]
    return markdown(["N", "scheme and step", *problems], _rows(problems), (0, 1))


def _doubt(problems: Mapping[str, Any]) -> str:
    """Sentences on the error of the limits."""
    clear = [found["limit_error"] for found in problems.values() if settled(found)]
    said = f"The reference solution itself errs by at most {PERCENT * max(clear):.2g} %." if clear else ""
    for name, found in problems.items():
        if not settled(found):
            said += (
                f" Not so for {name}, where {PERCENT * found['limit_error']:.2g} % are in doubt on the worst sequence. "
                "The picture shows medians there."
            )
    return said.strip()


def _of(preset: str, found: Mapping[str, Any]) -> Row:
    return next(row for row in found["settings"] if row["preset"] == preset)


def _use(preset: str, problems: Mapping[str, Any]) -> list[str]:
    first, *others = (_of(preset, found) for found in problems.values() if settled(found))
    errors = sorted(error(row) for row in others)
    span = f"{errors[0]:.2g} to {errors[-1]:.2g} %" if errors else ""
    return [f"`{preset}`", f"{error(first):.2g} %", span, f"{first['ms_per_stroke']:.2g}"]


def _conclusion(problems: Mapping[str, Any]) -> str:
    """Sentence on how much faster ours is at the least error that the chapter's discretisation reaches."""
    gains = []
    for found in problems.values():
        if settled(found):
            chapters = [row for row in found["settings"] if row["discretisation"] == "chapter"]
            best = min(chapters, key=error)
            ours = [row for row in found["settings"] if row not in chapters and error(row) <= error(best)]
            gains.append(best["ms_per_stroke"] / min(row["ms_per_stroke"] for row in ours) if ours else 0.0)
    if not gains or not all(gains):
        return "On some robot no setting of the continuum's discretisation reaches the least error of the chapter's."
    return (
        "On every robot whose worst sequence converges, the continuum's discretisation reaches the least error of the "
        f"chapter's, with up to 37 nodes, {min(gains):.0f} to {max(gains):.0f} times faster."
    )


def _rows(problems: Mapping[str, Any]) -> list[list[str]]:
    def cell(row: Row) -> str:
        errors = (error(row), error(row, "median_error"))
        worst, median = (f"{each:.2g} %" if math.isfinite(each) else "fails" for each in errors)
        return f"{worst}, {median}; {row['ms_per_stroke']:.2g}"

    columns = [found["settings"] for found in problems.values()]
    return [[*label(same[0]), *map(cell, same)] for same in zip(*columns, strict=True)]
