"""The report of an evaluation: one HTML page that needs nothing beside it, neither files nor network.

It is `report.html` with plotly.js, the tables, pictures of traced paths and of learning curves, and the recorded swims
written into it.
"""

import html
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote

import numpy as np
import plotly.graph_objects as go
import plotly.io
import plotly.offline
from numpy.typing import NDArray

from seastar_gym.evaluation.pictures import COLOURS, FAINT_INK, FLOW, INK, MM, PLANNED, STROKES_PER_DOT, flow_in, view
from seastar_gym.evaluation.playback import UNIT, Playback
from seastar_gym.evaluation.results import Row, columns_of, in_words, number
from seastar_gym.evaluation.swim import Swim
from seastar_gym.evaluation.trials import COLUMNS as TRIALS
from seastar_gym.evaluation.trials import as_shown, read_trials
from seastar_gym.files import read_rows, write_atomically
from seastar_gym.scene.water import AnyCurrent

PAGE = Path(__file__).with_suffix(".html")

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
    for place in path[1:]:
        (x0, y0), (x1, y1) = place - MM * waypoint_radius, place + MM * waypoint_radius
        figure.add_shape(type="circle", x0=x0, y0=y0, x1=x1, y1=y1, line_color=PLANNED, layer="below")
    for k, done in reversed(list(enumerate(swims))):  # the first swim comes on top
        figure.add_trace(_trace(done, k))
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
    """Decisions trained, shape (n,)."""
    pentagon: Floats
    """Simulated time round the pentagon [s], infinite where it was not finished, shape (n,)."""

    @classmethod
    def of(cls, name: str, progress: Sequence[Sequence[float]], period: float = 1.0) -> "Curve":
        """From rows of decisions trained, decisions round the pentagon, waypoints reached. ValueError for none.

        period: Time between decisions [s].
        """
        if not progress:
            raise ValueError(f"The training of {name} has no learning curve yet: it was stopped before a checkpoint.")
        trained, pentagon, waypoints = np.array(progress, dtype=float).T
        return cls(name, trained, np.where(waypoints == PENTAGON_WAYPOINTS, period * pentagon, np.inf))


def read_progress(folder: Path) -> list[list[int]]:
    """The rows of a training's progress.csv: decisions trained, those round the pentagon, and waypoints reached."""
    rows = read_rows(folder / "progress.csv")
    for row in rows:
        if len(row.fields) != 3:
            raise row.refused("every line must have decisions trained, decisions round the pentagon, waypoints reached")
    return [row.integers() for row in rows]


def curves_figure(curves: Sequence[Curve], baselines: Mapping[str, float]) -> go.Figure:
    """Time round the pentagon over the course of trainings; of several, with their median and range.

    baselines: Times of other agents [s].
    """
    figure = go.Figure()
    if len(curves) > 2:
        _add_band(figure, curves)
    for k, curve in enumerate(curves):
        figure.add_scatter(
            x=curve.trained.tolist(), y=_with_gaps(curve.pentagon), name=html.escape(curve.name), mode="lines+markers",
            line={"color": COLOURS[k % len(COLOURS)], "width": 1 if len(curves) > 2 else 2}, marker={"size": 5},
        )  # fmt: skip
    _add_unfinished(figure, curves)
    for name, seconds in baselines.items():
        figure.add_hline(
            y=seconds, line={"color": FAINT_INK, "dash": "dash"},
            annotation_text=f"agent {html.escape(name)}: {seconds:.4g} s", annotation_position="top left",
        )  # fmt: skip
    figure.update_layout(
        xaxis={"title": "decisions trained", "rangemode": "tozero"}, yaxis={"title": "time round the pentagon [s]"},
        legend_y=1.01, margin=MARGIN,
    )  # fmt: skip
    return figure


def _add_unfinished(figure: go.Figure, curves: Sequence[Curve]) -> None:
    """Crosses above the curves where a policy did not finish the pentagon yet: a training shows from its begin."""
    early = [trained for curve in curves for trained in curve.trained[np.isinf(curve.pentagon)].tolist()]
    if not early:
        return
    finished = np.concatenate([curve.pentagon[np.isfinite(curve.pentagon)] for curve in curves])
    above = 1.05 * float(finished.max()) if finished.size else 1.0
    figure.add_scatter(
        x=early, y=[above] * len(early), name="not finished", mode="markers", hoverinfo="x", cliponaxis=False,
        marker={"symbol": "x", "size": 8, "color": FAINT_INK},
    )  # fmt: skip


def _with_gaps(values: Floats) -> list[float | None]:
    """Numbers for a line that has gaps where they are infinite."""
    return [value if np.isfinite(value) else None for value in values.tolist()]


def _add_band(figure: go.Figure, curves: Sequence[Curve]) -> None:
    """Median and range of the curves at the lengths that they have in common; one that did not finish is worst."""
    trained = sorted(set.intersection(*(set(curve.trained.tolist()) for curve in curves)))
    values = np.array([[_at(curve, one) for one in trained] for curve in curves]).reshape(len(curves), -1)
    best, worst, median = values.min(axis=0), values.max(axis=0), np.median(values, axis=0)
    finished = np.flatnonzero(np.isfinite(worst))
    parts = np.split(finished, np.flatnonzero(np.diff(finished) > 1) + 1)  # no range spans what is not finished
    for part in parts if finished.size else []:
        band = {"x": [trained[k] for k in part], "mode": "lines", "line": {"width": 0}, "hoverinfo": "skip"}
        figure.add_scatter(y=best[part].tolist(), showlegend=False, **band)
        figure.add_scatter(
            y=worst[part].tolist(), name="range", legendgroup="range", showlegend=bool(part[0] == finished[0]),
            fill="tonexty", fillcolor="#d9e6f2", **band,
        )  # fmt: skip
    figure.add_scatter(
        x=trained, y=_with_gaps(median), name="median", mode="lines", line={"color": INK, "width": 3}
    )  # fmt: skip


def _at(curve: Curve, trained: float) -> float:
    return float(curve.pentagon[curve.trained == trained][0])


@dataclass(frozen=True, eq=False)
class ResultsTable:
    """A table of the report. rows: As in the CSV. columns: Those to show, and their titles.

    Where a row has "NAME_low" and "NAME_high" too, they stand behind its number NAME, as a confidence interval.
    """

    title: str
    columns: Mapping[str, str]
    rows: Sequence[Row]


@dataclass(frozen=True, eq=False)
class Remarks:
    """Remarks of a report besides the evaluation: texts, commands, learning curves and further results."""

    title: str = "Evaluation"
    sentences: Sequence[str] = ()
    commands: Sequence[str] = ()
    curves: Sequence[Curve] = ()
    tables: Sequence[ResultsTable] = ()


def write_report(
    file: Path,
    path: Any,
    swims: Sequence[Swim],
    playbacks: Sequence[Playback],
    waypoint_radius: float,
    remarks: Remarks,
    *,
    current: AnyCurrent | None = None,
    films: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Write the page. Beside the curves stand times of others round the pentagon.

    waypoint_radius: [m]. current: Of the water. films: Files beside the page, by agent.
    """
    table, curves = (
        ResultsTable("Results", columns_of(swims), in_words(swims)),
        {curve.name for curve in remarks.curves},
    )
    is_pentagon = isinstance(path, str) and path == "pentagon"
    finished = [done for done in swims if is_pentagon and done.finished and done.agent not in curves]
    baselines = {done.agent: float(done.time[-1]) for done in finished}
    sections = [
        _section(table.title, table_html(table)),
        _section("Playback", PLAYER + _films(films)),
        _section("Paths", _figure(to_html(paths_figure(swims, waypoint_radius, current), "paths"), "square")),
    ]
    sections += [_section(more.title, table_html(more)) for more in remarks.tables]
    if remarks.curves:
        figure = to_html(curves_figure(remarks.curves, baselines), "curves")
        sections.append(_section("Learning curves", _figure(figure, "wide")))
    sections.append(_section("Terms", _terms()))
    if remarks.commands or remarks.sentences:
        sections.append(_section("How it was made", _remarks(remarks)))
    parts = {
        "title": html.escape(remarks.title),
        "plotly": plotly.offline.get_plotlyjs(),
        "sections": "\n".join(sections),
        # Within a script element, whatever its strings say.
        "swims": _recorded(playbacks, swims[0].waypoints, waypoint_radius, current).replace("<", "\\u003c"),
    }
    page = re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], PAGE.read_text(encoding="utf-8"))
    write_atomically(file, page)


def _section(title: str, content: str) -> str:
    return f"<section>\n<h2>{html.escape(title)}</h2>\n{content}\n</section>"


def _films(films: Mapping[str, str]) -> str:
    links = (f'<a href="{quote(file)}">{html.escape(agent)}</a>' for agent, file in films.items())
    return f"\n<p>Films: {', '.join(links)}</p>" if films else ""


def _figure(figure: str, shape: str) -> str:
    return f'<div class="figure {shape}">{figure}</div>'


def table_html(table: ResultsTable) -> str:
    """A table as a piece of a page."""
    head = "".join(
        f"<th{_side(name)}>{html.escape(' '.join(title.split()))}</th>" for name, title in table.columns.items()
    )
    body = "\n".join("<tr>" + "".join(_cell(row, name) for name in table.columns) + "</tr>" for row in table.rows)
    return f'<div class="table"><table><thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table></div>'


def _side(name: str) -> str:
    """Words begin on the left, numbers end on the right."""
    return ' class="words"' if name in ("agent", "path", "disturbance", "fidelity") else ""


def trials_table(file: Path) -> ResultsTable:
    """Table of the CSV of trials. ValueError: it is none."""
    rows = [as_shown(row) for row in read_trials(file)]
    return ResultsTable("Trials, with 95 % confidence intervals", TRIALS, rows)


def _cell(row: Row, name: str) -> str:
    value, side = row[name], _side(name)
    text = html.escape(number(value))
    if value is not None and row.get(f"{name}_low") is not None:
        low, high = (html.escape(number(row[f"{name}_{end}"])) for end in ("low", "high"))
        text += f" <small>[{low}, {high}]</small>"
    if "error" in name and row.get("strokes_to_finish", name) is None:
        side = f' class="faint" title="{NEVER_ARRIVED}"'
    return f'<td{side} data-name="{name}">{text}</td>'


NEVER_ARRIVED = "Of the part that was swum: the last waypoint was not reached."
TERMS = {
    "stroke, decision": "The time for which one command holds: a stroke if it is a second, otherwise a decision.",
    "3+, 4\u2212": "Limb 3 turns anti-clockwise at the hub, limb 4 clockwise.",
    "strokes to finish, time": "Until the hub came within the radius of the last waypoint; \u2013 where it did not.",
    "cross-track error": "Distance of the hub from the planned path at the end of a stroke. It is grey where the last "
    "waypoint was not reached: it is then that of the part that was swum.",
    "limbs heated [1/m]": "Limbs whose heating began, per metre of the hub's way.",
    "energy [J/m]": "Electric energy of that heat, per metre of the hub's way; \u2013 where the actuator has no "
    "heating power.",
    "learning curve": "How the policy swims the pentagon as training goes on, without exploration. A cross is a policy "
    "that does not get round in time; at 0 it is untrained.",
    "[low, high]": "Ends of the 95 % confidence interval of a mean, by bootstrap.",
}
"""Words of the page, and what they mean."""


def _terms() -> str:
    rows = (f"<dt>{html.escape(term)}</dt><dd>{html.escape(meaning)}</dd>" for term, meaning in TERMS.items())
    return f"<dl>{''.join(rows)}</dl>"


def _remarks(remarks: Remarks) -> str:
    sentences = "\n".join(f"<p>{html.escape(sentence)}</p>" for sentence in remarks.sentences)
    return f"{sentences}\n<pre>{html.escape(chr(10).join(remarks.commands))}</pre>"


TEXT_MARGIN = 30.0
"""[mm]: for the names of heated limbs, beyond their tips."""

PLAYER = """<div id="agents" role="radiogroup" aria-label="agent"></div>
<div class="player">
<div>
<div class="figure square"><div id="playback"></div></div>
<div class="controls">
<button id="play" type="button">Play</button>
<input id="time" type="range" min="0" value="0" step="1" aria-label="time">
</div>
<p id="readout"></p>
</div>
<div class="strokes"><h3>Commands</h3><ol id="strokes"></ol></div>
</div>"""


def _recorded(playbacks: Sequence[Playback], waypoints: Any, waypoint_radius: float, current: AnyCurrent | None) -> str:
    """Recorded swims for the page's player, as JSON; lengths in millimetres."""
    path = 1e3 * np.concatenate([np.zeros((1, 2)), waypoints])
    reach = 1e3 * max(float(np.ptp(playback.frames[0].positions, axis=0).max()) for playback in playbacks) / 2
    low, high = path.min(axis=0) - reach - TEXT_MARGIN, path.max(axis=0) + reach + TEXT_MARGIN
    return json.dumps(
        {
            "unit": 1e3 * UNIT,
            "path": np.round(path, 2).tolist(),
            "radius": 1e3 * waypoint_radius,
            "x": [low[0], high[0]],
            "y": [low[1], high[1]],
            "current": np.round(1e3 * flow_in(current, low, high).arrows, 1).tolist(),
            "swims": [playback.packed() for playback in playbacks],
        },
        separators=(",", ":"),
    )
