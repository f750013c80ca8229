"""Page and picture of the work-precision study."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from studies.accuracy.pictures import CHAPTERS, OTHERS, OURS, PUBLISHED, published_error
from studies.provenance import footer
from studies.style import DPI, INK, MS, PERCENT, as_numbers, as_percent, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Row = Mapping[str, Any]
"""Numbers of a setting."""
Column = Literal["largest_error", "median_error", "straight_error"]

SETTLED = 0.01
"""Problems whose limit errs by more have no largest errors that mean anything: their medians are told instead."""

USES = {
    "fast": "Searches, first trainings, demonstrations: what counts is the number of strokes",
    "balanced": "Everything else, to begin with: trainings that are kept, trials, tables",
    "accurate": "Numbers that are published, and differences between robots or gaits of a few per cent",
    "reference": "The truth that others are compared with, a few swims at a time",
    "chapter": "Repeating the chapter's figures and those of codes with its discretisation; for nothing else",
}
"""What every preset is for."""
LEFT_OUT = (
    "Left out are settings of ours: implicit Euler and SDIRK3 with the continuum's discretisation, adapted steps, "
    "other Newton tolerances, error bars. Left out are codes that were not given these scenes: "
    "PyElastica, Elastica (C++), SoRoSim, SOFA, MuJoCo and every code that solves the water, too. The four published "
    "codes were given the chapter's robot only, in the straight swim, and two of them, dismech-python and DDG_Tutorial "
    "(Octave), have errors that are taken from the other two, whose scheme and discretisation they share."
)


def label(row: Row) -> str:
    """Setting in words."""
    nodes = f"{row['nodes_per_limb']}" + (", chapter's" if row["discretisation"] == "chapter" else "")
    return f"{nodes} | {row['scheme']}, {MS * row['step']:g} ms"


def error(row: Row, column: Column = "largest_error") -> float:
    """Error in per cent: of the worst sequence, the median one, or the straight swim; infinite if the solver failed."""
    return math.inf if row[column] is None else PERCENT * float(row[column])


def settled(found: Row) -> bool:
    """Whether the worst sequences of a problem have a limit."""
    return float(found["limit_error"]) < SETTLED


def front(rows: Sequence[Row], column: Column) -> list[Row]:
    """Settings that no other setting beats in both time and error, fastest first."""
    chosen: list[Row] = []
    for row in sorted(rows, key=lambda row: float(row["ms_per_stroke"])):
        if not chosen or error(row, column) < error(chosen[-1], column):
            chosen.append(row)
    return chosen


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Small multiples of error over time: all problems with the same axes, and the straight swim with other codes."""
    problems = results["problems"]
    figure, axes = subplots(3, 3, figsize=(10.5, 10.0), sharey=True)
    grid = axes[0, 0].get_gridspec()
    for each in axes[0]:
        each.remove()
    wide = figure.add_subplot(grid[0, :], sharey=axes[1, 0])
    wide.grid(True, which="major", color="0.92", lw=0.8)
    wide.spines[["top", "right"]].set_visible(False)
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
    figure.supxlabel("processor time per stroke of a robot, one core [ms]  (dearer →)", fontsize=11)
    figure.supylabel("largest distance from the path in the continuum, over its length", fontsize=11)
    figure.legend(*wide.get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False, fontsize=10)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=DPI)


def _draw_panel(axes: Axes, rows: Sequence[Row], title: str, column: Column) -> None:
    """Draw settings as dots, the best of them as a line, and presets as squares with their initials."""
    kinds = (("continuum", OURS, "our discretisation"), ("chapter", CHAPTERS, "the chapter's discretisation"))
    for discretisation, colour, name in kinds:
        mine = [row for row in rows if row["discretisation"] == discretisation]
        axes.plot([row["ms_per_stroke"] for row in mine], [error(row, column) for row in mine], "o", ms=4, mew=0,
                  alpha=0.5, color=colour)  # fmt: skip
        best = front(mine, column)
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
    axes.set_title(title, fontsize=10, loc="left", color=INK)
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


def as_page(results: Mapping[str, Any], picture: str) -> str:
    """Page in Markdown."""
    problems = results["problems"]
    lines = [
        "# Work and precision on six robots", "",
        "Written by `python -m studies.accuracy.work_precision`; its docstring (`--help`) tells what is measured. "
        "Times are measured beside other work of the machine.", "",
        f"![Error over processor time per stroke]({picture})", "",
        "A line is what no other measured setting of its discretisation beats. Letters are the presets. Errors are "
        "whole ones, not the promised sums of space and time ([accuracy.md](accuracy.md)): they are smaller where "
        "the two cancel. " + _doubt(problems), "",
        "## Use this when", "",
        "Errors are those of the worst sequence, for robots whose worst sequences have a limit.", "",
        "| preset | use it for | error, chapter's robot | error, others | time per stroke, chapter's robot [ms] |",
        "|---|---|---:|---:|---:|",
        *(_use(preset, problems) for preset in USES), "",
        _conclusion(problems), "",
        "## What is left out", "", LEFT_OUT, "",
        "## Numbers", "",
        f"Error of the worst and of the median sequence, and processor time per stroke [ms] "
        f"([data]({results['file']})).", "",
        f"| N | scheme and step | {' | '.join(problems)} |", "|---|---|" + "---:|" * len(problems),
        *_rows(problems), "", "---", "", footer(results, results["file"]), "",
    ]  # fmt: skip
    return "\n".join(lines)


def _doubt(problems: Mapping[str, Any]) -> str:
    """Sentences on the error of the limits."""
    clear = [found["limit_error"] for found in problems.values() if settled(found)]
    said = f"The limit itself errs by at most {PERCENT * max(clear):.2g} %." if clear else ""
    for name, found in problems.items():
        if not settled(found):
            said += (
                f" Not so for {name}, where {PERCENT * found['limit_error']:.2g} % are in doubt on the worst sequence: "
                "while limbs press on each other, paths depend on the mesh and the step, and no refinement settles "
                "them; why is not known. There medians are drawn."
            )
    return said.strip()


def _of(preset: str, found: Mapping[str, Any]) -> Row:
    return next(row for row in found["settings"] if row["preset"] == preset)


def _use(preset: str, problems: Mapping[str, Any]) -> str:
    first, *others = (_of(preset, found) for found in problems.values() if settled(found))
    errors = sorted(error(row) for row in others)
    span = f"{errors[0]:.2g} to {errors[-1]:.2g} %" if errors else ""
    return f"| `{preset}` | {USES[preset]} | {error(first):.2g} % | {span} | {first['ms_per_stroke']:.2g} |"


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
        return "On some robot no setting of ours reaches the least error of the chapter's discretisation."
    return (
        "The least error that the chapter's discretisation reaches here, with up to 37 nodes, ours reaches "
        f"{min(gains):.0f} to {max(gains):.0f} times faster, on every robot whose worst sequence has a limit."
    )


def _rows(problems: Mapping[str, Any]) -> list[str]:
    def cell(row: Row) -> str:
        errors = (error(row), error(row, "median_error"))
        worst, median = (f"{each:.2g} %" if math.isfinite(each) else "fails" for each in errors)
        return f"{worst}, {median}; {row['ms_per_stroke']:.2g}"

    columns = [found["settings"] for found in problems.values()]
    return [f"| {label(same[0])} | {' | '.join(map(cell, same))} |" for same in zip(*columns, strict=True)]
