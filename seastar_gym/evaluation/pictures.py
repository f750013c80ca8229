"""Pictures of swims. matplotlib is imported where something is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.scenery import Flow, flow_of
from seastar_gym.evaluation.swim import Swim
from seastar_gym.files import save_figure
from seastar_gym.scene.water import AnyCurrent

Floats = NDArray[np.float64]

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FRAMES_PER_STROKE, FPS = 3, 30
"""Frames of a video per stroke of a second, and per second: it passes ten times as fast."""

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8c6d1f", "#56b4e9", "#6a3d9a", "#e69f00")
LINE_STYLES = ("-", "--", ":")
"""Agents beyond the colours begin the colours again in the next style."""
INK, FAINT_INK, PLANNED, FLOW = "#3a404a", "#80868f", "#b4bcc8", "#b0d1e0"
STROKES_PER_DOT = 10
STRAY, MARGIN = 0.3, 0.12
"""Room around the path [path extents]: for swims that go astray, and for all."""
ARROWS = 10
"""Arrows of a current along the longer side of a picture."""
MM = 1000.0


def draw_traces(swims: Sequence[Swim], waypoint_radius: float, file: Path, current: AnyCurrent | None = None) -> None:
    """Writes a PNG picture of the hubs' ways along the path of the first swim, and of a current of the water.

    waypoint_radius: [m].
    """
    from matplotlib.figure import Figure

    path = MM * np.concatenate([np.zeros((1, 2)), swims[0].waypoints])
    low, high = view(path, MM * np.concatenate([swim.hub for swim in swims]))
    width, height = high - low
    figure = Figure(figsize=(6.0, 6.0 * height / width))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    _style_axes(axes)
    flow = flow_in(current, low, high)
    if flow.words:
        start, way = MM * flow.arrows[:, 0], MM * np.diff(flow.arrows, axis=1)[:, 0]
        axes.quiver(*start.T, *way.T, angles="xy", scale_units="xy", scale=1.0, width=2.5e-3, color=FLOW, zorder=0.5)
    _draw_path(axes, path, MM * waypoint_radius)
    for number, swim in enumerate(swims):
        _draw_trace(axes, swim, number)
    dots = f"agents, with a dot every {STROKES_PER_DOT} {swims[0].counted_in}"
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, ncols=2, alignment="left",
        title=f"{dots}; {flow.words}" if flow.words else dots,
    )  # fmt: skip
    save_figure(figure, file, dpi=160, bbox_inches="tight", pad_inches=0.15)


def view(path: Floats, hubs: Floats) -> tuple[Floats, Floats]:
    """Corners of the picture [mm]; a swim that goes astray may widen it by STRAY path extents, no more."""
    extent = max(float(np.ptp(path, axis=0).max()), 50.0)
    low = np.maximum(np.minimum(path.min(axis=0), hubs.min(axis=0)), path.min(axis=0) - STRAY * extent)
    high = np.minimum(np.maximum(path.max(axis=0), hubs.max(axis=0)), path.max(axis=0) + STRAY * extent)
    return low - MARGIN * extent, high + MARGIN * extent


def flow_in(current: AnyCurrent | None, low: Floats, high: Floats) -> Flow:
    """Arrows of a current in a picture between two corners [mm]."""
    return flow_of(current, low / MM, high / MM, float((high - low).max()) / MM / ARROWS)


def _style_axes(axes: Axes) -> None:
    axes.set(xlabel="x [mm]", ylabel="y [mm]")
    axes.tick_params(labelcolor=INK, color=FAINT_INK)
    axes.grid(color="#eceff3", linewidth=0.8)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(FAINT_INK)


def _draw_path(axes: Axes, path: Floats, radius: float) -> None:
    """path: From its start [mm], shape (n + 1, 2). radius: Of the waypoints [mm]."""
    from matplotlib.patches import Circle
    from matplotlib.patheffects import withStroke

    axes.plot(*path.T, color=PLANNED, linestyle=(0, (5, 4)), linewidth=1.2, zorder=1)
    for x, y in path[1:]:
        axes.add_patch(Circle((x, y), radius, facecolor="#f1f4f7", edgecolor=PLANNED, zorder=1.5))
    axes.plot(0.0, 0.0, marker="D", markersize=6, color=INK, zorder=5)
    for place, text, direction in _labels(path):
        axes.annotate(
            text, tuple(place + radius * direction), xytext=tuple(9.0 * direction), textcoords="offset points",
            color=INK, fontsize=9, ha="center", va="center", zorder=6,
            path_effects=[withStroke(linewidth=2.5, foreground="w")],
        )  # fmt: skip


def _labels(path: Floats) -> list[tuple[Floats, str, Floats]]:
    """Where to write what: the waypoints' numbers, several at one place together, and "start"; and to which side."""
    numbers: dict[tuple[float, ...], list[int]] = {}
    for number, point in enumerate(np.round(path, 3) + 0.0):
        numbers.setdefault(tuple(point), []).append(number)
    labels = []
    for here in numbers.values():
        place = path[here[0]]
        legs = path[[near for number in here for near in (number - 1, number + 1) if 0 <= near < len(path)]] - place
        away = -sum((leg / np.hypot(*leg) for leg in legs if leg.any()), np.zeros(2))
        # Opposite legs leave no side to prefer.
        direction = away / np.hypot(*away) if np.hypot(*away) > 1e-3 else np.array([0.0, 1.0])
        labels.append((place, ", ".join(str(number) if number else "start" for number in here), direction))
    return labels


def _draw_trace(axes: Axes, swim: Swim, number: int) -> None:
    """The first swim comes on top; wider lines below it still show where the others swam the same way."""
    hub = MM * swim.hub
    colour = COLOURS[number % len(COLOURS)]
    style = LINE_STYLES[number // len(COLOURS) % len(LINE_STYLES)]
    width, level = 1.4 + 0.4 * min(number, 4), 4.0 - 0.01 * number
    name = f" {swim.agent}" if swim.agent.startswith("_") else swim.agent  # labels that begin with "_" are not shown
    label = f"{name}: {swim.result}".replace("$", r"\$")
    axes.plot(*hub.T, color=colour, linestyle=style, linewidth=width, zorder=level, label=label)
    dots = hub[STROKES_PER_DOT::STROKES_PER_DOT]
    axes.plot(*dots.T, color=colour, linestyle="", marker="o", markersize=width + 2.0, zorder=level)
    marker = "o" if swim.finished else "X"
    axes.plot(*hub[-1], color=colour, marker=marker, markersize=9, markeredgecolor="w", zorder=level + 0.5)
