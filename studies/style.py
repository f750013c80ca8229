"""Style of all studies' pictures: a picture begins with `subplots` or `new_figure`, and `save_figure` writes it."""

from pathlib import Path
from typing import Any, Literal

import matplotlib.style
import numpy as np
from matplotlib.figure import Figure

INK, FAINT = "#1b1f26", "#80868f"
CYCLE = ("#3366aa", "#cc7a00", "#118855", "#cc3355", "#8844aa", "#5aa2d6")
"""Colours of lines that have no name of their own, as style.mplstyle has them."""
MM, MS = 1e3, 1e3
"""Millimetres per metre, milliseconds per second."""


def new_figure(width: float, height: float, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """Empty figure. width, height: Size [inches]."""
    matplotlib.style.use(Path(__file__).with_suffix(".mplstyle"))
    return Figure(figsize=(width, height), layout=layout)


def subplots(*shape: int, figsize: tuple[float, float], layout: Any = "constrained", **more: Any) -> tuple[Figure, Any]:
    """Figure with empty axes that have lines behind them. more: Of `Figure.subplots`."""
    figure = new_figure(*figsize, layout)
    axes = figure.subplots(*shape, **more)
    for each in np.ravel(axes):
        each.grid(True, which="major")
    return figure, axes
