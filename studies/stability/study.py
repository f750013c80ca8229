"""Robustness and accuracy of the solver with time steps from 10 microseconds to 1 s.

The atlas varies eight quantities against the time step: Young's modulus, rod radius, resolution, drag, density, random
initial velocities and shifts, and the peak angle. Each of its cells is a scene at a time step. Prints a summary, and
writes all cells as CSV, what pictures and summary show of them as JSON, and three pictures: what the solver needed to
converge, Newton iterations per step, and the error of the hub's path.
"""

import itertools
import math
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from seastar_gym.scene.numerics import SchemeName
from studies.chapter import ISSUES_FROM, REAL_TIME_FROM
from studies.frame import Results, Study, rounded, write_rows
from studies.pages import markdown
from studies.stability.cases import STEPS, SWEEPS, Sweep, format_value
from studies.stability.cells import Cell, commands_of, converged_displacements, run_cell, stroke_duration
from studies.stability.pictures import draw as draw_cells

GROWTH_ROUNDING = 1e-11
"""Relative growth of the energy in a step that is attributed to rounding."""


def atlas(
    sweeps: Sequence[Sweep] = SWEEPS,
    steps: Sequence[float] = STEPS,
    scheme: SchemeName = "implicit-euler",
    workers: int | None = None,
) -> list[Cell]:
    """Measure all cells of the atlas; returns them in the order of sweeps, values and steps."""
    columns = [(sweep, value) for sweep in sweeps for value in sweep.values]
    bar = tqdm(total=len(columns) * len(steps), unit="cell", smoothing=0.02)

    def column(sweep: Sweep, value: float | None) -> list[Cell]:
        """Cells of one value at all steps; steps with strokes of the same duration share their converged run."""
        cells = []
        for duration, members in itertools.groupby(steps, stroke_duration):
            try:
                converged = converged_displacements(sweep.case(value), duration)
            except ValueError:
                converged = None  # run_cell records why the scene is refused
            for step in members:
                cells.append(run_cell(sweep, value, step, scheme, converged))
                bar.update()
        return cells

    with bar, ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        # The longest columns go first, so that no thread is left with one of them at the end.
        order = sorted(range(len(columns)), key=lambda k: -_weight(*columns[k]))
        found = dict(zip(order, pool.map(lambda k: column(*columns[k]), order), strict=True))
    return [cell for k in range(len(columns)) for cell in found[k]]


def _weight(sweep: Sweep, value: float | None) -> float:
    try:
        case = sweep.case(value)
    except ValueError:
        return 0.0
    return case.robot.n_nodes * len(commands_of(case))


SUMMARY = (
    "against", "cells", "refused", "strokes", "failed", "Newton iterations per step (most)", "substeps",
    "energy grew", "error at 3, 20 ms",
)  # fmt: skip


def summarise(cells: Iterable[Cell], sweeps: Sequence[Sweep]) -> list[list[str]]:
    """Rows of the summary, one per sweep and one for all cells; columns as in SUMMARY."""
    everything = list(cells)
    rows = []
    for sweep in sweeps:
        first, last = format_value(sweep, sweep.values[0]), format_value(sweep, sweep.values[-1])
        own = [cell for cell in everything if cell.sweep == sweep.name]
        rows.append([f"{sweep.label}: {first} ... {last} {sweep.unit}".strip(), *_figures(own), _errors(own, sweep)])
    return [*rows, ["all", *_figures(everything), ""]]


def _figures(cells: list[Cell]) -> list[str]:
    """Columns "cells" to "energy grew" of the summary."""
    ran = [cell for cell in cells if not cell.refused]
    iterations = [cell.iterations for cell in ran]
    grew = sum(max(cell.growth, cell.growth_in_vacuum) > GROWTH_ROUNDING for cell in ran)
    return [
        str(len(cells)), str(len(cells) - len(ran)), str(sum(cell.robots for cell in ran)),
        str(sum(cell.failed for cell in ran)), f"{np.median(iterations):.2g} ({max(iterations):.0f})",
        f"{sum(cell.halvings > 0 for cell in ran)} cells", f"{grew} cells" if grew else "nowhere",
    ]  # fmt: skip


def _errors(cells: list[Cell], sweep: Sweep) -> str:
    """Errors [%] at the chapter's value with time steps of 3 and 20 ms."""
    found = {cell.step: cell.error for cell in cells if cell.value == sweep.chapter}
    errors = [found.get(step, math.nan) for step in (REAL_TIME_FROM, ISSUES_FROM)]
    return ", ".join(f"{100 * error:.2g}" if math.isfinite(error) else "-" for error in errors) + " %"


KEPT = (
    "sweep", "value", "step", "refused", "robots", "failed", "iterations", "regularised", "backtracks", "halvings",
    "growth", "growth_in_vacuum", "error",
)  # fmt: skip
"""What pictures and summary show of a cell."""


def as_data(cells: Iterable[Cell], scheme: SchemeName) -> dict[str, Any]:
    """Cells as plain data; None where a cell has no number, and for vacuum."""
    rows = [[_plain(getattr(cell, name)) for name in KEPT] for cell in cells]
    return {"scheme": scheme, "columns": list(KEPT), "cells": rows}


def _plain(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return rounded(value, 6) if math.isfinite(value) else None


def from_data(results: Mapping[str, Any]) -> list[Cell]:
    """Cells from plain data."""
    cells = []
    for row in results["cells"]:
        kept: dict[str, Any] = dict(zip(results["columns"], row, strict=True))
        numbers = {name: math.nan for name, each in kept.items() if each is None and name != "value"}
        cells.append(Cell(**{**kept, **numbers}))
    return cells


def write_csv(cells: Iterable[Cell], file: Path) -> None:
    """Write one line per cell; columns as in `Cell`, in SI units except for the values of sweeps."""
    names = [one.name for one in fields(Cell)]
    rows = (["vacuum" if n == "value" and cell.value is None else getattr(cell, n) for n in names] for cell in cells)
    write_rows(file, names, rows)


@dataclass(frozen=True)
class Options:
    """Robustness and accuracy of the solver over time steps."""

    scheme: SchemeName = "implicit-euler"
    """Scheme of the atlas."""


def run(options: Options, results: Results) -> None:
    """Run the atlas."""
    start = time.perf_counter()
    cells = atlas(SWEEPS, STEPS, options.scheme)
    write_csv(cells, results.out / "stability.csv")
    results.update(as_data(cells, options.scheme))
    print(f"{time.perf_counter() - start:.0f} s. Written, too: {results.out / 'stability.csv'}")


def sweeps_of(cells: Sequence[Cell]) -> list[Sweep]:
    """The sweeps that cells are of, with their values."""
    values = {one.name: tuple(dict.fromkeys(cell.value for cell in cells if cell.sweep == one.name)) for one in SWEEPS}
    return [replace(one, values=values[one.name]) for one in SWEEPS if values[one.name]]


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Draw a picture from plain data: the one that the file's name ends with, such as stability_needs.png."""
    cells = from_data(results)
    draw_cells(cells, sweeps_of(cells), list(dict.fromkeys(cell.step for cell in cells)), results["scheme"], file)


TOLD = ("against", "failed", "Newton iterations per step (most)")
"""Columns of the page."""


def table(results: Mapping[str, Any]) -> str:
    """Some columns of the summary in Markdown, from plain data."""
    cells = from_data(results)
    kept = [SUMMARY.index(name) for name in TOLD]
    return markdown(TOLD, [[row[k] for k in kept] for row in summarise(cells, sweeps_of(cells))])


STUDY = Study(
    "stability",
    run,
    Options,
    "stability/stability.json",
    Path("runs/stability"),
    pictures={f"stability_{name}.png": draw for name in ("needs", "iterations", "error")},
    tables={"stability": table},
)
