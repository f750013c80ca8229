"""Pictures of the accuracy study: work against precision, and convergence in time and space."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Numerics
from studies.accuracy.ringing import ringing
from studies.accuracy.style import COLOURS, DPI, FAINT, INK, MS, PERCENT, as_numbers, as_percent, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from studies.accuracy.rows import Row, Study

Floats = NDArray[np.float64]


def kind_of(numerics: Numerics) -> str:
    """Key of COLOURS for a setting: its scheme, or "adapted"."""
    return numerics.scheme if numerics.path_tolerance is None else "adapted"


def draw_all(found: Study, folder: Path) -> list[Path]:
    """Write all pictures into a folder and return their paths."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    paths = []
    for name, draw in (("work_precision", work_precision), ("convergence", convergence), ("ringing", ringing)):
        figure: Figure = draw(found)
        paths.append(folder / f"{name}.png")
        figure.savefig(paths[-1], dpi=DPI)
        plt.close(figure)
    return paths


def work_precision(found: Study) -> Figure:
    """Error over speed: all settings, the front, the presets and the chapter's two time steps."""
    figure, axes = subplots(1, 2, figsize=(12.5, 5.6), sharey=True)
    rows = [row for row in found.rows if row.nodes_per_limb == 10]
    panels: tuple[tuple[str, str, str, str], ...] = (
        ("path", "path_promise", "speed", "Worst of pairs, pentagon and random commands; mixed batch"),
        ("straight", "straight_promise", "straight_speed", "Straight swim {2+, 5-} alone; batch of straight swims"),
    )
    for each, (error, promise, speed, title) in zip(axes, panels, strict=True):
        _draw_settings(each, rows, lambda row: getattr(row, error), lambda row: getattr(row, speed))  # noqa: B023
        _draw_front(each, rows, lambda row: getattr(row, promise), lambda row: getattr(row, speed))  # noqa: B023
        _mark(each, rows, lambda row: getattr(row, promise), lambda row: getattr(row, speed))  # noqa: B023
        each.set(xscale="log", yscale="log", xlabel="simulated over computing seconds, one core  (faster →)")
        each.set_title(title, fontsize=10.5, loc="left")
        as_numbers(each.xaxis)
    axes[0].set(ylabel="path error over 10 strokes, of the path's length", ylim=(0.004, 80.0))
    as_percent(axes[0].yaxis)
    axes[0].legend(frameon=False, fontsize=8.5, loc="upper left", ncols=2)
    figure.suptitle("What speed costs: every dot is a scheme, a time step and a Newton tolerance", x=0.01, ha="left")
    return figure


RowNumber = Callable[["Row"], float]


def _draw_settings(axes: Axes, rows: Sequence[Row], error: RowNumber, speed: RowNumber) -> None:
    for kind, colour in COLOURS.items():
        mine = [row for row in rows if kind_of(row.numerics) == kind]
        name = "implicit-midpoint, adapted steps" if kind == "adapted" else kind
        x, y = [speed(row) for row in mine], [PERCENT * error(row) for row in mine]
        axes.plot(x, y, "o", ms=3.6, mew=0, alpha=0.45, color=colour, label=name)


def _draw_front(axes: Axes, rows: Sequence[Row], error: RowNumber, speed: RowNumber) -> None:
    from studies.accuracy.rows import front

    best = front(rows, error, speed)
    x, y = np.array([(speed(row), PERCENT * error(row)) for row in best]).T
    axes.plot(x, y, drawstyle="steps-pre", color=INK, lw=1.3, label="front: the least error that can be promised")


def _mark(axes: Axes, rows: Sequence[Row], error: RowNumber, speed: RowNumber) -> None:
    """Mark the presets and the chapter's two time steps."""
    from matplotlib.patheffects import withStroke

    from studies.accuracy.rows import presets

    by_numerics = {row.numerics: row for row in rows}
    marks = [(f'"{name}"', by_numerics[n], "s") for name, n in presets().items() if name != "chapter"]
    for step in (3e-3, 20e-3):
        row = by_numerics.get(Numerics("implicit-euler", step))
        if row is not None:
            marks.append((f"the chapter's scheme, {MS * step:g} ms", row, "*"))
    for name, row, marker in marks:
        x, y, chapter = speed(row), PERCENT * error(row), marker == "*"
        axes.plot(x, y, marker, ms=12 if chapter else 7, color=COLOURS[kind_of(row.numerics)], mec=INK, mew=1.0)
        left = chapter or row.numerics.path_tolerance is not None
        axes.annotate(
            name, (x, y), (10, 9) if chapter else (-6 if left else 6, -14), textcoords="offset points", fontsize=8.5,
            color=INK, ha="right" if left else "left", path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )  # fmt: skip


def convergence(found: Study) -> Figure:
    """Error over the time step for the straight swim and the worst swim, and error over the nodes per limb."""
    figure, (straight, worst, space) = subplots(1, 3, figsize=(13.5, 4.6))
    fixed = [row for row in found.rows if row.nodes_per_limb == 10 and row.numerics.path_tolerance is None]
    tightest_last = sorted(fixed, key=lambda row: -row.numerics.newton_tolerance)
    rows = list({(row.numerics.scheme, row.numerics.step): row for row in tightest_last}.values())
    for axes, error, title in (
        (straight, "straight", "Time step: straight swim"),
        (worst, "path", "Time step: worst of pairs and random commands"),
    ):
        for kind, colour in list(COLOURS.items())[:4]:
            points = sorted(
                (MS * row.numerics.step, PERCENT * getattr(row, error)) for row in rows if row.numerics.scheme == kind
            )
            axes.loglog(*np.array(points).T, "o-", ms=4, lw=1.4, color=colour, label=kind)
        axes.set(xlabel="time step h [ms]", ylim=(0.001, 40.0))
        axes.set_title(title, fontsize=10.5, loc="left")
    _slopes(straight, (0.25, 20.0), {1: 1.3e-1, 2: 2.0e-3})
    for axes in (straight, worst):
        as_percent(axes.yaxis)
        as_numbers(axes.xaxis)
    straight.set_ylabel("path error against h → 0, same N")
    straight.legend(frameon=False, fontsize=8.5, loc="upper left")
    edges = np.array([each.nodes_per_limb - 1 for each in found.space])
    for error, colour, name in (("path", INK, "worst path"), ("straight", FAINT, "straight swim")):
        values = PERCENT * np.array([getattr(each, error) for each in found.space])
        space.loglog(edges + 1, values, "o-", ms=4, lw=1.4, color=colour, label=name)
    ten = next(each for each in found.space if each.nodes_per_limb == 10)
    space.annotate(
        "the chapter's N = 10", (10, PERCENT * ten.straight), (0, -30), textcoords="offset points", fontsize=8.5,
        ha="center", arrowprops={"arrowstyle": "-", "color": FAINT},
    )  # fmt: skip
    space.set(xlabel="nodes per limb N", ylabel="path error against N → ∞, h → 0")
    space.set_xticks(edges + 1, [str(n + 1) for n in edges])
    space.set_yticks([0.5, 1, 2, 5, 10, 20, 50])
    space.minorticks_off()
    as_percent(space.yaxis)
    space.set_title("Resolution of the limbs", fontsize=10.5, loc="left")
    space.legend(frameon=False, fontsize=8.5)
    return figure


def _slopes(axes: Axes, ends: tuple[float, float], orders: dict[int, float]) -> None:
    """Draw dashed lines error = c h^order; ends: first and last h [ms], orders: c of every order."""
    for order, c in orders.items():
        h = np.array(ends)
        axes.loglog(h, c * h**order, "--", lw=0.9, color=FAINT)
        axes.annotate(f"order {order}", (h[1], c * h[1] ** order), (4, 0), textcoords="offset points", fontsize=8,
                      color=FAINT, va="center", annotation_clip=False)  # fmt: skip
