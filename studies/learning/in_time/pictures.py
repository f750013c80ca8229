"""Picture of the study: seconds round the pentagon over heat per metre."""

from collections.abc import Mapping
from pathlib import Path

from studies.learning.in_time.tables import PENTAGON, Runs
from studies.style import CYCLE, INK, subplots

MARKERS = "osD^vP*X"
LIMIT = 1250.0
"""Heat per metre [J/m] up to which the axis reaches; what is beyond stands at its end, with its number."""


def draw(runs: Mapping[str, Runs], file: Path) -> None:
    """Draw every policy that swims round the pentagon at `fast`, one colour and marker for each training."""
    figure, axes = subplots(figsize=(6.8, 5.2))
    shown = 0
    for name, found in runs.items():
        swims = [run["pentagon"]["fast"] for run in found.values() if run["pentagon"].get("fast", {}).get("arrived")]
        heat, seconds = [one["energy_J"] / PENTAGON for one in swims], [one["seconds"] for one in swims]
        if swims:
            colour, marker = CYCLE[shown % len(CYCLE)], MARKERS[shown % len(MARKERS)]
            axes.plot([min(LIMIT, each) for each in heat], seconds, ls="", ms=7, marker=marker, color=colour, alpha=0.8,
                      mew=0, clip_on=False, label=name)  # fmt: skip
            for each, time in zip(heat, seconds, strict=True):
                if each > LIMIT:
                    axes.annotate(f"{each:,.0f} J/m →", (LIMIT, time), (-8, 0), textcoords="offset points", color=INK,
                                  ha="right", va="center")  # fmt: skip
            shown += 1
    axes.set(
        xlabel="electric energy per metre of the path [J/m]", ylabel="seconds round the pentagon", xlim=(150.0, LIMIT)
    )
    if shown:
        figure.legend(title="decides every .., and what else is special; one mark for each seed", alignment="left",
                      loc="outside upper left", ncols=3)  # fmt: skip
    figure.savefig(file)
