"""Table and picture of what turning is worth. Needs no torch."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from studies.style import CYCLE, DPI, FAINT, subplots

COLOURS = {"strokes": FAINT, "wires": CYCLE[0], "planner": CYCLE[2], "learned": CYCLE[1]}


def table(results: Mapping[str, Any]) -> str:
    """Table of the results in Markdown. The last column is what the largest turn costs beyond none."""
    turns = results["turns_deg"]
    more = f"{turns[-1]:g}° less {turns[0]:g}°"
    lines = [f"| | {' | '.join(f'{turn:g}°' for turn in turns)} | {more} |", f"| --- |{' ---: |' * (len(turns) + 1)}"]
    for each in results["swims"].values():
        for what, unit in (("seconds", "s"), ("joules", "J")):
            first, last = each[what][0], each[what][-1]
            numbers = [*each[what], None if first is None or last is None else last - first]
            cells = ["-" if one is None else f"{one:.0f}" for one in numbers]
            lines.append(f"| {each['what']} [{unit}] | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Time and energy over the demanded turn."""
    figure, panels = subplots(1, 2, figsize=(8.0, 4.2))
    for axes, what, label in zip(panels, ("seconds", "joules"), ("time [s]", "electric energy [J]"), strict=True):
        for name, each in results["swims"].items():
            numbers = [np.nan if one is None else one for one in each[what]]
            axes.plot(results["turns_deg"], numbers, "o-", color=COLOURS[name], label=each["what"])
        axes.set(xlabel="demanded turn [degrees]", ylabel=f"{label} to arrive", xticks=results["turns_deg"])
        axes.set_ylim(bottom=0.0)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    figure.savefig(file, dpi=DPI)
