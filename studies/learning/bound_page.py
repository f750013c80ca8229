"""Picture of the speeds by direction. Needs no torch."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from studies.style import CYCLE, subplots

MIXED = "best periodic gaits, mixed"
"""Name of the speeds of straight gaits that are swum in turn."""


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Draw the speeds by direction, in the sector of 36 degrees that turns and mirror images repeat."""
    figure, axes = subplots(figsize=(6.4, 4.4))
    directions, speeds = results["directions_deg"], dict(results["mm_per_stroke"])
    axes.plot(directions, speeds.pop(MIXED), label="best mix of straight gaits: every periodic gait of up to four\n"
              "strokes was tried, and those that do not turn are swum in turn")  # fmt: skip
    for (name, swum), colour in zip(speeds.items(), CYCLE[1:], strict=False):
        axes.plot(directions, swum, "o", color=colour, label=f"agent {name}, from rest to a waypoint in that direction")
    axes.set(
        xlabel="direction of the swim, from limb 1 [degrees]; 36 is midway between two limbs", xticks=directions,
        ylabel="speed [mm per stroke]",
    )  # fmt: skip
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.4 * (high - low))
    axes.legend(loc="upper right")
    figure.savefig(file)
