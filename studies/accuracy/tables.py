"""Tables of the accuracy study, among them the one that comes with the package."""

import csv
import json
import math
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from rich.table import Table

from seastar_gym.scene import fidelity
from studies.accuracy.rows import Row, Study, front, fronts, presets
from studies.speed.timing import machine

AGREEMENT = {"straight": 1e-5, "pair": 1e-4, "pentagon": 1e-4, "random": 1e-4}
"""Largest path difference of the two converged solutions, by kind of swim, with which results are stored."""
TABLE_WIDTH = 112
"""Width of the printed table [characters]."""


def summary(found: Study) -> list[tuple[str, Row]]:
    """Presets, by name, and the front of the path error, fastest first."""
    own = [row for row in found.rows if row.nodes_per_limb == 10]
    names = {numerics: name for name, numerics in presets().items()}
    chosen = {row.numerics: row for row in front(own, lambda row: row.path_promise, lambda row: row.speed)}
    chosen.update({row.numerics: row for row in own if row.numerics in names})
    return [(names.get(row.numerics, ""), row) for row in sorted(chosen.values(), key=lambda row: -row.speed)]


COLUMNS = (
    "preset", "scheme and step", "Newton tolerance", "path error", "any gait", "straight", "heading", "x real time",
)  # fmt: skip


def as_cells(name: str, row: Row) -> tuple[str, ...]:
    """Cells of one line of the summary; errors in per cent, speed as real-time factor."""
    promises = (row.path_promise, row.gait_promise, row.straight_promise)
    return (
        name, row.label, f"{row.numerics.newton_tolerance:.0e}", *(f"{100 * error:.2g} %" for error in promises),
        f"{row.heading:.2g}°", f"{two_digits(row.speed):,.0f}",
    )  # fmt: skip


def two_digits(value: float, up: bool = False) -> float:
    """Value rounded to two significant digits; up: round upwards."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1) if value > 0.0 and math.isfinite(value) else 1.0
    scaled = value / unit
    whole = math.ceil(scaled - 1e-9) if up else round(scaled)
    return float(f"{whole * unit:.2g}")


def facts(found: Study) -> list[str]:
    """Sentences about convergence that go below the table."""
    ten = next(each for each in found.space if each.nodes_per_limb == 10)
    agreement = ", ".join(f"{kind} {error:.0e}" for kind, error in found.agreement.items())
    return [
        f"Converged straight swim, N = 10: {1e3 * found.straight[0]:.5f} mm after one stroke, "
        f"{1e3 * found.straight[-1]:.4f} mm after {len(found.straight)}.",
        f"Two schemes agree on the path, as a share of its length: {agreement}.",
        f"N = 10 against N -> infinity: {100 * ten.path:.2g} % on the worst path, {100 * ten.straight:.2g} % on the "
        f"straight swim, which then goes {1e3 * found.limit:.2f} mm.",
    ]


def as_markdown(found: Study) -> str:
    """Summary in Markdown."""
    lines = [f"| {' | '.join(COLUMNS)} |", "|---|---|---:|" + "---:|" * (len(COLUMNS) - 3)]
    lines += [f"| {' | '.join(as_cells(name, row))} |" for name, row in summary(found)]
    return "\n".join([*lines, "", *facts(found), f"Speeds: one core of {machine()}."]) + "\n"


def as_table(found: Study) -> Table:
    """Summary for the terminal."""
    table = Table(title=f"Errors against h -> 0, worst cases; speed on one core ({machine()})")
    for column in COLUMNS:
        table.add_column(column, justify="left" if column in COLUMNS[:2] else "right")
    for name, row in summary(found):
        table.add_row(*as_cells(name, row), style="bold" if name else "")
    return table


def write_csv(rows: Sequence[Row], path: Path) -> None:
    """Write all columns of all settings; errors are fractions of the path's length unless the name has a unit."""
    units = {"heading": "heading_deg", "iterations": "iterations_per_stroke", "steps": "steps_per_stroke"}
    names = [field.name for field in fields(Row) if field.name != "numerics"]
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(
            ["scheme", "step_s", "newton_tolerance", "path_tolerance", *(units.get(name, name) for name in names)]
        )
        for row in rows:
            n = row.numerics
            key = [n.scheme, n.step, n.newton_tolerance, "" if n.path_tolerance is None else n.path_tolerance]
            writer.writerow([*key, *(_cell(getattr(row, name)) for name in names)])


def _cell(value: Any) -> Any:
    return float(f"{value:.5g}") if isinstance(value, float) else value


def as_promise(row: Row) -> dict[str, Any]:
    """Fields of a `fidelity.Promise` from a row: errors rounded upwards to two digits, speed rounded to two digits."""
    n = row.numerics
    return {
        "scheme": n.scheme,
        "step": n.step,
        "newton_tolerance": n.newton_tolerance,
        "path_tolerance": n.path_tolerance,
        "path_error": two_digits(row.path_promise, up=True),
        "gait_error": two_digits(row.gait_promise, up=True),
        "straight_error": two_digits(row.straight_promise, up=True),
        "heading_error": two_digits(row.heading, up=True),
        "end_error": two_digits(row.end, up=True),
        "speed": two_digits(row.speed),
    }


def store(found: Study, path: Path = fidelity.PRESETS) -> None:
    """Write the package's table; ValueError if the two converged solutions of the study do not agree."""
    for kind, allowed in AGREEMENT.items():
        if not found.agreement[kind] <= allowed:
            raise ValueError(
                f"The two converged solutions differ by {found.agreement[kind]:.1e} of the path on the {kind} swims, "
                f"and {allowed:.0e} is allowed: nothing is stored."
            )
    own = [row for row in found.rows if row.nodes_per_limb == 10]
    by_numerics = {row.numerics: row for row in own}
    table = {
        "about": "Written by python -m studies.accuracy --store; read by seastar_gym.scene.fidelity.",
        "machine": machine(),
        "presets": {name: as_promise(by_numerics[numerics]) for name, numerics in presets().items()},
        "front": [as_promise(row) for row in fronts(own)],
    }
    path.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
