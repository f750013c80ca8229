"""Picture of the study: seconds round the pentagon over heat per metre."""

from collections.abc import Mapping
from pathlib import Path

from seastar_gym.evaluation.pictures import COLOURS, FAINT_INK, INK
from studies.learning.in_time.tables import PENTAGON, Runs
from studies.style import new_figure

MARKERS = "osD^vP*Xhp<>"


def draw(runs: Mapping[str, Runs], file: Path) -> None:
    """Draw every policy that swims round the pentagon at `fast`, one colour and marker for each training."""
    figure = new_figure(8.4, 4.6)
    axes = figure.subplots()
    for number, (name, found) in enumerate(runs.items()):
        swims = [run["pentagon"]["fast"] for run in found.values() if run["pentagon"].get("fast", {}).get("arrived")]
        if swims:
            axes.plot(
                [one["energy_J"] / PENTAGON for one in swims], [one["seconds"] for one in swims], ls="", ms=6,
                marker=MARKERS[number % len(MARKERS)], color=COLOURS[number % len(COLOURS)], alpha=0.8, label=name,
            )  # fmt: skip
    axes.set_xlabel("electric energy per metre of the path [J/m]", color=INK)
    axes.set_ylabel("seconds round the pentagon", color=INK)
    axes.tick_params(labelcolor=INK, color=FAINT_INK)
    axes.grid(alpha=0.3)
    if axes.get_lines():
        figure.legend(loc="outside right upper", frameon=False, fontsize=9)
    figure.savefig(file, dpi=130)
