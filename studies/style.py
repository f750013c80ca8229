"""Style of all studies' pictures: one place for colours, letters, units and axes.

A picture begins with `subplots` or `new_figure`, and `seastar_gym.files.save_figure` writes it. matplotlib is imported
only where something is drawn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure


INK, FAINT, GRID = "#1b1f26", "#80868f", "#ebebeb"
CYCLE = ("#3366aa", "#cc7a00", "#118855", "#cc3355", "#8844aa", "#5aa2d6")
"""Colours of lines that have no name of their own."""
COLOURS = {
    "implicit-euler": CYCLE[1], "sdirk2": CYCLE[3], "sdirk3": CYCLE[4], "implicit-midpoint": CYCLE[0],
    "adapted": CYCLE[2],
}  # fmt: skip
"""Colours of schemes."""
MM, MS, PERCENT = 1e3, 1e3, 100.0
"""Millimetres per metre, milliseconds per second, and per cent of one."""
DPI = 130
SETTINGS: dict[str, Any] = {
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.edgecolor": FAINT,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.titlesize": "medium",
    "figure.labelsize": "medium",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "legend.frameon": False,
    "savefig.dpi": DPI,
}
"""Settings of matplotlib that differ from its own."""


def apply_style() -> None:
    """Let matplotlib draw in this style from now on."""
    import matplotlib
    from matplotlib.rcsetup import cycler

    settings: Any = {**SETTINGS, "axes.prop_cycle": cycler(color=CYCLE)}
    matplotlib.rcParams.update(settings)


def new_figure(width: float, height: float, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """Empty figure. width, height: Size [inches]."""
    from matplotlib.figure import Figure

    apply_style()
    return Figure(figsize=(width, height), layout=layout)


def subplots(
    *shape: int,
    figsize: tuple[float, float],
    grid: bool = True,
    layout: Literal["constrained"] | None = "constrained",
    **keywords: Any,
) -> tuple[Figure, Any]:
    """Figure with empty axes. grid: Whether they have lines behind them. keywords: Of `Figure.subplots`."""
    figure = new_figure(*figsize, layout)
    axes = figure.subplots(*shape, **keywords)
    for each in np.ravel(axes) if grid else ():
        each.grid(True, which="major")
    return figure, axes


def as_percent(axis: Any) -> None:
    """Label the ticks of an axis like 0.1 %."""
    axis.set_major_formatter(lambda value, _: f"{value:g} %")


def as_numbers(axis: Any) -> None:
    """Label the ticks of an axis like 0.1 and 10,000."""
    axis.set_major_formatter(lambda value, _: f"{value:,.0f}" if value >= 1.0 else f"{value:g}")
