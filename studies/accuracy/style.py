"""Style of the accuracy study's pictures: colours, units and axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure


COLOURS = {
    "implicit-euler": "#cc7a00",
    "sdirk2": "#cc3355",
    "sdirk3": "#8844aa",
    "implicit-midpoint": "#3366aa",
    "adapted": "#118855",
}
INK, FAINT = "#1b1f26", "#80868f"
MM, MS, PERCENT = 1e3, 1e3, 100.0
DPI = 130


def subplots(*shape: int, **keywords: Any) -> tuple[Figure, Any]:
    """Figure with empty axes in the study's style."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(*shape, layout="constrained", **keywords)
    for each in np.ravel(axes):
        each.grid(True, which="major", color="0.92", lw=0.8)
        each.set_axisbelow(True)
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def as_percent(axis: Any) -> None:
    """Label the ticks of an axis like 0.1 %."""
    axis.set_major_formatter(lambda value, _: f"{value:g} %")


def as_numbers(axis: Any) -> None:
    """Label the ticks of an axis like 0.1 and 10,000."""
    axis.set_major_formatter(lambda value, _: f"{value:,.0f}" if value >= 1.0 else f"{value:g}")
