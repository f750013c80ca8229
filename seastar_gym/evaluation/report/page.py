"""The report of an evaluation: one HTML page that needs nothing beside it, neither files nor network.

It is `page.html` with plotly.js, the tables, the pictures of charts.py and the recorded swims written into it.
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
import plotly.offline

from seastar_gym.evaluation.pictures import flow_in
from seastar_gym.evaluation.playback import UNIT, Playback
from seastar_gym.evaluation.report.charts import Curve, curves_figure, paths_figure, to_html
from seastar_gym.evaluation.results import COLUMNS, Row, in_words, number
from seastar_gym.evaluation.swim import Swim
from seastar_gym.evaluation.trials import COLUMNS as TRIALS
from seastar_gym.evaluation.trials import as_shown, read_trials
from seastar_gym.files import write_atomically
from seastar_gym.scene.water import AnyCurrent

PAGE = Path(__file__).parent / "page.html"


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
    """Write the page. Beside the curves stand strokes of others round the pentagon.

    waypoint_radius: [m]. current: Of the water. films: Files beside the page, by agent.
    """
    table, curves = ResultsTable("Results", COLUMNS, in_words(swims)), {curve.name for curve in remarks.curves}
    is_pentagon = isinstance(path, str) and path == "pentagon"
    finished = [done for done in swims if is_pentagon and done.finished and done.agent not in curves]
    baselines = {done.agent: done.strokes for done in finished}
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
        "swims": _script_safe(_recorded(playbacks, swims[0].waypoints, waypoint_radius, current)),
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
    if value is not None and {f"{name}_low", f"{name}_high"} <= set(row):
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


def _script_safe(text: str) -> str:
    """JSON that may stand within a script element, whatever its strings say."""
    return text.replace("<", "\\u003c")
