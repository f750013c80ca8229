"""The report's pictures, in plotly: traced paths and learning curves."""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import plotly.io
from numpy.typing import NDArray

from seastar_gym.evaluation.pictures import COLOURS, FAINT_INK, FLOW, INK, MM, PLANNED, STROKES_PER_DOT, flow_in, view
from seastar_gym.evaluation.swim import Swim
from seastar_gym.files import read_rows
from seastar_gym.scene.water import AnyCurrent

Floats = NDArray[np.float64]
DASHES = ("solid", "dash", "dot")
MARGIN = {"l": 56, "r": 12, "t": 12, "b": 48}
"""Room for the titles of axes [px]."""
PENTAGON_WAYPOINTS = 5


def to_html(figure: go.Figure, name: str) -> str:
    """The figure as a piece of a page that has plotly.js; it fills the element around it."""
    figure.update_layout(
        template="none",
        paper_bgcolor="rgba(0,0,0,0)",  # a page has a light and a dark mode
        plot_bgcolor="rgba(0,0,0,0)",
        font={"family": "system-ui, sans-serif", "size": 13, "color": INK},
        legend={"orientation": "h", "yanchor": "bottom", "x": 0.0},
        showlegend=True,
        dragmode=False,  # a finger on the picture scrolls the page
        hovermode="closest",
    )
    figure.update_xaxes(gridcolor="#eceff3", zeroline=False, linecolor=FAINT_INK, ticks="outside")
    figure.update_yaxes(gridcolor="#eceff3", zeroline=False, linecolor=FAINT_INK, ticks="outside")
    options = {"responsive": True, "displaylogo": False, "displayModeBar": False}
    return str(plotly.io.to_html(figure, config=options, include_plotlyjs=False, full_html=False, div_id=name))


def paths_figure(swims: Sequence[Swim], waypoint_radius: float, current: AnyCurrent | None = None) -> go.Figure:
    """The hubs' ways along the path of the first swim, and a current of the water. waypoint_radius: [m]."""
    path = MM * np.concatenate([np.zeros((1, 2)), swims[0].waypoints])
    low, high = view(path, MM * np.concatenate([done.hub for done in swims]))
    figure, flow = go.Figure(), flow_in(current, low, high)
    if flow.words:
        x, y = (_joined(MM * flow.arrows[:, :, axis]) for axis in (0, 1))
        figure.add_scatter(
            x=x, y=y, name=flow.words, hoverinfo="skip", mode="lines+markers", line={"color": FLOW, "width": 1.5},
            marker={
                "symbol": "arrow", "angleref": "previous", "size": [0, 10, 0] * len(flow.arrows), "color": FLOW,
                "line_width": 0,
            },
        )  # fmt: skip
    figure.add_scatter(
        x=_rounded(path[:, 0]), y=_rounded(path[:, 1]), mode="lines", name="path", hoverinfo="skip",
        line={"color": PLANNED, "dash": "dash", "width": 1.5},
    )  # fmt: skip
    for x, y in path[1:]:
        figure.add_shape(type="circle", **_circle(x, y, MM * waypoint_radius), line_color=PLANNED, layer="below")
    for number, done in reversed(list(enumerate(swims))):  # the first swim comes on top
        figure.add_trace(_trace(done, number))
    figure.update_layout(
        xaxis={"title": "x [mm]", "range": [low[0], high[0]], "constrain": "domain"},
        yaxis={"title": "y [mm]", "range": [low[1], high[1]], "scaleanchor": "x", "constrain": "domain"},
        legend={"traceorder": "reversed", "y": 1.01},
        margin=MARGIN,
    )
    return figure


def _trace(done: Swim, number: int) -> go.Scatter:
    hub = MM * done.hub
    dots = np.arange(len(hub)) % STROKES_PER_DOT == 0
    return go.Scatter(
        x=_rounded(hub[:, 0]), y=_rounded(hub[:, 1]), mode="lines+markers",
        name=html.escape(f"{done.agent} ({done.result})"),
        line={"color": COLOURS[number % len(COLOURS)], "dash": DASHES[number // len(COLOURS) % len(DASHES)]},
        marker={"size": np.where(dots, 6, 0).tolist(), "line_width": 0},
        text=[f"{done.counted_in[:-1]} {stroke}, {time:g} s" for stroke, time in enumerate(done.time.round(6))],
        hovertemplate="%{text}: %{x:.0f}, %{y:.0f} mm",
    )  # fmt: skip


def _circle(x: float, y: float, radius: float) -> dict[str, float]:
    return {"x0": x - radius, "x1": x + radius, "y0": y - radius, "y1": y + radius}


def _rounded(values: Floats) -> list[float]:
    """Millimetres to a tenth: a page is read by eyes."""
    return np.round(values, 1).tolist()


def _joined(lines: Floats) -> list[float | None]:
    """Coordinates of lines [mm], shape (n, 2), in one trace with gaps between them."""
    return [number for line in lines.round(1).tolist() for number in (*line, None)]


@dataclass(frozen=True, eq=False)
class Curve:
    """Learning curve of one training."""

    name: str
    trained: Floats
    """Strokes trained, shape (n,)."""
    pentagon: Floats
    """Strokes round the pentagon, NaN where it was not finished, shape (n,)."""

    @classmethod
    def of(cls, name: str, progress: Sequence[Sequence[float]]) -> "Curve":
        """From rows of strokes trained, strokes round the pentagon, waypoints reached. ValueError for none."""
        if not progress:
            raise ValueError(f"The training of {name} has no learning curve yet: it was stopped before a checkpoint.")
        trained, pentagon, waypoints = np.array(progress, dtype=float).T
        return cls(name, trained, np.where(waypoints == PENTAGON_WAYPOINTS, pentagon, np.nan))


def read_progress(folder: Path) -> list[list[int]]:
    """The rows of a training's progress.csv: strokes trained, strokes round the pentagon, waypoints reached."""
    rows = read_rows(folder / "progress.csv")
    for row in rows:
        if len(row.fields) != 3:
            raise row.refused("every line must have strokes trained, strokes round the pentagon, waypoints reached")
    return [row.integers() for row in rows]


def curves_figure(curves: Sequence[Curve], baselines: Mapping[str, int]) -> go.Figure:
    """Strokes round the pentagon over the course of trainings; of several, with their median and range.

    baselines: Strokes that other agents take.
    """
    figure = go.Figure()
    if len(curves) > 2:
        _add_band(figure, curves)
    for number, curve in enumerate(curves):
        figure.add_scatter(
            x=curve.trained.tolist(), y=_with_gaps(curve.pentagon), name=html.escape(curve.name), mode="lines+markers",
            line={"color": COLOURS[number % len(COLOURS)], "width": 1 if len(curves) > 2 else 2}, marker={"size": 5},
        )  # fmt: skip
    _add_unfinished(figure, curves)
    for name, strokes in baselines.items():
        figure.add_hline(
            y=strokes, line={"color": FAINT_INK, "dash": "dash"},
            annotation_text=f"agent {html.escape(name)}: {strokes}", annotation_position="top left",
        )  # fmt: skip
    figure.update_layout(
        xaxis={"title": "strokes trained", "rangemode": "tozero"}, yaxis={"title": "strokes round the pentagon"},
        legend_y=1.01, margin=MARGIN,
    )  # fmt: skip
    return figure


def _add_unfinished(figure: go.Figure, curves: Sequence[Curve]) -> None:
    """Crosses above the curves where a policy did not finish the pentagon yet: a training shows from its begin."""
    early = [trained for curve in curves for trained in curve.trained[np.isnan(curve.pentagon)].tolist()]
    if not early:
        return
    finished = np.concatenate([curve.pentagon[np.isfinite(curve.pentagon)] for curve in curves])
    above = 1.05 * float(finished.max()) if finished.size else 1.0
    figure.add_scatter(
        x=early, y=[above] * len(early), name="not finished", mode="markers", hoverinfo="x", cliponaxis=False,
        marker={"symbol": "x", "size": 8, "color": FAINT_INK},
    )  # fmt: skip


def _add_band(figure: go.Figure, curves: Sequence[Curve]) -> None:
    """Median and range of the curves at the strokes that they have in common; one that did not finish is worst."""
    trained = sorted(set.intersection(*(set(curve.trained.tolist()) for curve in curves)))
    worst = np.array([[_at(curve, one) for one in trained] for curve in curves])
    known = np.isfinite(worst).all(axis=0)
    x, values = np.array(trained)[known], worst[:, known]
    band = {"mode": "lines", "line": {"width": 0}, "hoverinfo": "skip"}
    figure.add_scatter(x=x.tolist(), y=values.min(axis=0).tolist(), showlegend=False, **band)
    figure.add_scatter(
        x=x.tolist(), y=values.max(axis=0).tolist(), name="range", fill="tonexty", fillcolor="#d9e6f2", **band
    )
    figure.add_scatter(
        x=x.tolist(), y=np.median(values, axis=0).tolist(), name="median", mode="lines", line={"color": INK, "width": 3}
    )


def _at(curve: Curve, trained: float) -> float:
    return float(curve.pentagon[curve.trained == trained][0])


def _with_gaps(values: Floats) -> list[float | None]:
    return [None if np.isnan(value) else float(value) for value in values]
