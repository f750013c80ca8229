"""Page and picture of the work-precision study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.accuracy.pictures import CHAPTERS, OTHERS, OURS, PUBLISHED, published_error
from studies.accuracy.style import DPI, INK, MS, PERCENT, as_numbers, as_percent, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Row = Mapping[str, Any]
"""Numbers of a setting."""

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


def error(row: Row, straight: bool = False) -> float:
    """Error in per cent: of the worst sequence, or of the straight swim."""
    return PERCENT * float(row["straight_error" if straight else "largest_error"])


def front(rows: Sequence[Row], straight: bool) -> list[Row]:
    """Settings that no other setting beats in both time and error, fastest first."""
    chosen: list[Row] = []
    for row in sorted(rows, key=lambda row: float(row["ms_per_stroke"])):
        if not chosen or error(row, straight) < error(chosen[-1], straight):
            chosen.append(row)
    return chosen


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Small multiples of error over time: all problems with the same axes, and the straight swim with other codes."""
    import matplotlib.pyplot as plt

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
    _draw_panel(wide, first["settings"], f"{name}: straight swim, with published codes", straight=True)
    _draw_published(wide, first["straight_distance"])
    for panel, (name, found) in zip(small, problems.items(), strict=False):
        _draw_panel(panel, found["settings"], f"{name}: worst of {found['sequences']} sequences", straight=False)
    for each in small[len(problems) :]:
        each.set_axis_off()
    figure.supxlabel("processor time per stroke of a robot, one core [ms]  (dearer →)", fontsize=11)
    figure.supylabel("largest distance from the path in the continuum, over its length", fontsize=11)
    figure.legend(*wide.get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False, fontsize=10)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=DPI)
    plt.close(figure)


def _draw_panel(axes: Axes, rows: Sequence[Row], title: str, straight: bool) -> None:
    """Draw settings as dots, the best of them as a line, and presets as squares with their initials."""
    kinds = (("continuum", OURS, "our discretisation"), ("chapter", CHAPTERS, "the chapter's discretisation"))
    for discretisation, colour, name in kinds:
        mine = [row for row in rows if row["discretisation"] == discretisation]
        axes.plot([row["ms_per_stroke"] for row in mine], [error(row, straight) for row in mine], "o", ms=4, mew=0,
                  alpha=0.5, color=colour)  # fmt: skip
        best = front(mine, straight)
        axes.plot([row["ms_per_stroke"] for row in best], [error(row, straight) for row in best],
                  drawstyle="steps-post", color=colour, lw=1.5, label=name)  # fmt: skip
    presets = [row for row in rows if row["preset"]]
    for preset in presets:
        x, y = preset["ms_per_stroke"], error(preset, straight)
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
        for each, point in zip(mine, points, strict=True):
            axes.annotate(f"{MS * each.step:g} ms", point, (0, -13), textcoords="offset points", fontsize=8,
                          color=INK, ha="center")  # fmt: skip


def as_page(results: Mapping[str, Any], picture: str) -> str:
    """Page in Markdown."""
    problems, versions = results["problems"], ("python", "seastar-gym", "numpy", "numba", "llvmlite")
    doubt = max(found["limit_error"] for found in problems.values())
    lines = [
        "# Work and precision on six robots", "",
        "Written by `python -m studies.accuracy.work_precision`; its docstring (`--help`) tells what is measured. "
        f"Machine: {results['machine']}. Versions: {', '.join(f'{name} {results[name]}' for name in versions)}. "
        f"The limit's own error is at most {PERCENT * doubt:.2g} %.", "",
        f"![Error over processor time per stroke]({picture})", "",
        "A line is what no other measured setting of its discretisation beats. Letters are the presets. Errors are "
        "whole ones, not the promised sums of space and time ([accuracy.md](accuracy.md)): they are smaller where "
        "the two cancel.", "",
        "## Use this when", "",
        "| preset | use it for | largest error, chapter's robot | over the other robots | time per stroke [ms] |",
        "|---|---|---:|---:|---:|",
        *(_use(preset, problems) for preset in USES), "",
        _conclusion(problems), "",
        "## What is left out", "", LEFT_OUT, "",
        "## Numbers", "",
        f"Largest error, and processor time per stroke [ms]; [the data]({results['file']}) have medians, too.", "",
        f"| N | scheme and step | {' | '.join(problems)} |", "|---|---|" + "---:|" * len(problems),
        *_rows(problems), "",
    ]  # fmt: skip
    return "\n".join(lines)


def _of(preset: str, found: Mapping[str, Any]) -> Row:
    return next(row for row in found["settings"] if row["preset"] == preset)


def _use(preset: str, problems: Mapping[str, Any]) -> str:
    first, *others = (_of(preset, found) for found in problems.values())
    errors = sorted(error(row) for row in others)
    span = f"{errors[0]:.2g} to {errors[-1]:.2g} %" if errors else ""
    return f"| `{preset}` | {USES[preset]} | {error(first):.2g} % | {span} | {first['ms_per_stroke']:.2g} |"


def _conclusion(problems: Mapping[str, Any]) -> str:
    """Sentence on where the chapter's discretisation is worth its time."""
    gains = []
    for found in problems.values():
        theirs = min(error(row) for row in found["settings"] if row["discretisation"] == "chapter")
        dearest = min(
            row["ms_per_stroke"]
            for row in found["settings"]
            if row["discretisation"] == "chapter" and error(row) == theirs
        )
        ours = [
            row["ms_per_stroke"]
            for row in found["settings"]
            if row["discretisation"] == "continuum" and error(row) <= theirs
        ]
        gains.append(dearest / min(ours) if ours else 0.0)
    if not all(gains):
        return "On some robot no setting of ours reaches the least error of the chapter's discretisation."
    return (
        "The least error that the chapter's discretisation reaches here, with whatever nodes and steps, ours reaches "
        f"in a {min(gains):.0f}th to a {max(gains):.0f}th of the time."
    )


def _rows(problems: Mapping[str, Any]) -> list[str]:
    columns = [found["settings"] for found in problems.values()]
    return [
        f"| {label(same[0])} | " + " | ".join(f"{error(row):.2g} %, {row['ms_per_stroke']:.2g}" for row in same) + " |"
        for same in zip(*columns, strict=True)
    ]
