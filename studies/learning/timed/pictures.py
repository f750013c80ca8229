"""Picture of the study: seconds round the pentagon over heat per metre."""

from collections.abc import Mapping
from pathlib import Path

from studies.learning.timed.tables import PENTAGON, Runs
from studies.style import CYCLE, as_numbers, subplots

MARKERS = "osD^vP*X"


def draw(runs: Mapping[str, Runs], file: Path) -> None:
    """Draw every policy that swims round the pentagon at `fast`, one colour and marker for each training."""
    figure, axes = subplots(figsize=(6.8, 5.2))
    shown = 0
    for name, found in runs.items():
        swims = [run["pentagon"]["fast"] for run in found.values() if run["pentagon"].get("fast", {}).get("arrived")]
        if swims:
            heat, seconds = [one["energy_J"] / PENTAGON for one in swims], [one["seconds"] for one in swims]
            colour, marker = CYCLE[shown % len(CYCLE)], MARKERS[shown % len(MARKERS)]
            axes.plot(heat, seconds, ls="", ms=7, marker=marker, color=colour, alpha=0.8, mew=0, label=name)
            shown += 1
    axes.set(xlabel="electric energy per metre of the path [J/m]", ylabel="seconds round the pentagon", xscale="log")
    if shown:
        axes.set_xticks([200, 300, 500, 1000, 2000])
        as_numbers(axes.xaxis)
        axes.set_xticks([], minor=True)
        figure.legend(title="decides every .., and what else is special; one mark for each seed", alignment="left",
                      loc="outside upper left", ncols=3, fontsize="small", columnspacing=1.0)  # fmt: skip
    figure.savefig(file)
