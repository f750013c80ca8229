"""The atlas of stability: `python -m studies.stability`.

How the solver fares from 10 microseconds to 1 s of time step, against stiffness, thickness, resolution, drag, density,
rattled robots and commands up to the largest peak angle. Prints a summary and writes every cell as CSV, the summary as
Markdown, and three pictures: what every cell needed, Newton iterations per step, and the error of the hub's path.

A cell is a scene at a time step, see stability_cells.py.

`--long` instead makes 10,000 strokes of random commands with 256 robots; `--cost` measures what never breaking costs a
healthy robot, see hardening.py.
"""

import argparse
import csv
import itertools
import math
import os
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from seastar_gym.scene import Numerics, Scene
from seastar_gym.scene.numerics import Fidelity, SchemeName
from seastar_gym.simulator import Simulator
from studies.speed.hardening import SETTINGS, cost_table, measure_cost
from studies.stability.cases import (
    CHAPTER_TROUBLE,
    QUICK_STEPS,
    STEPS,
    SWEEPS,
    Sweep,
    format_value,
    quick_sweeps,
)
from studies.stability.cells import (
    Cell,
    commands_of,
    converged_way,
    largest_strain,
    run_cell,
    stroke_duration,
)

Floats = NDArray[np.float64]

GROWTH_ROUNDING = 1e-11
"""Growth of energy in a step, over the energy, that is rounding."""


# --- the atlas -------------------------------------------------------------------------------------------------------


def atlas(
    sweeps: Sequence[Sweep] = SWEEPS,
    steps: Sequence[float] = STEPS,
    scheme: SchemeName = "implicit-euler",
    progress: bool = True,
    workers: int | None = None,
) -> list[Cell]:
    """All cells, in the order of sweeps, values and steps."""
    columns = [(sweep, value) for sweep in sweeps for value in sweep.values]
    bar = tqdm(total=len(columns) * len(steps), unit="cell", smoothing=0.02, disable=not progress)

    def column(sweep: Sweep, value: float | None) -> list[Cell]:
        """All steps of one value; steps with strokes of the same duration share their converged run."""
        cells = []
        for duration, members in itertools.groupby(steps, stroke_duration):
            try:
                converged = converged_way(sweep.case(value), duration)
            except ValueError:
                converged = None  # refused: the cells say why
            for step in members:
                cells.append(run_cell(sweep, value, step, scheme, converged))
                bar.update()
        return cells

    with bar, ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        # The longest columns first, so that no thread ends with one of them alone.
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
    "against", "cells", "refused", "strokes", "failed", "Newton iterations per step (most)", "steps halved",
    "energy grew", "error at 3, 20 ms",
)  # fmt: skip


def summarise(cells: Iterable[Cell], sweeps: Sequence[Sweep]) -> list[list[str]]:
    """Rows of the summary, one per sweep and one for all; columns as in SUMMARY."""
    everything = list(cells)
    rows = []
    for sweep in sweeps:
        first, last = format_value(sweep, sweep.values[0]), format_value(sweep, sweep.values[-1])
        own = [cell for cell in everything if cell.sweep == sweep.name]
        rows.append([f"{sweep.label}: {first} ... {last} {sweep.unit}".strip(), *_figures(own), _errors(own, sweep)])
    return [*rows, ["all", *_figures(everything), ""]]


def _figures(cells: list[Cell]) -> list[str]:
    """From "cells" to "energy grew"."""
    ran = [cell for cell in cells if not cell.refused]
    iterations = [cell.iterations for cell in ran]
    grew = sum(max(cell.growth, cell.growth_in_vacuum) > GROWTH_ROUNDING for cell in ran)
    return [
        str(len(cells)), str(len(cells) - len(ran)), str(sum(cell.robots for cell in ran)),
        str(sum(cell.failed for cell in ran)), f"{np.median(iterations):.2g} ({max(iterations):.0f})",
        f"{sum(cell.halvings > 0 for cell in ran)} cells", f"{grew} cells" if grew else "nowhere",
    ]  # fmt: skip


def _errors(cells: list[Cell], sweep: Sweep) -> str:
    """At the chapter's value."""
    found = {cell.step: cell.error for cell in cells if cell.value == sweep.chapter}
    errors = [found.get(step, math.nan) for step in (3e-3, CHAPTER_TROUBLE)]
    return ", ".join(f"{100 * error:.2g}" if math.isfinite(error) else "-" for error in errors) + " %"


def as_table(rows: Sequence[Sequence[str]]) -> Table:
    """The summary for a terminal of 100 columns or more."""
    title = "Stability: one stroke per robot, from 10 µs to 1 s of time step"
    table = Table(title=title, box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column(SUMMARY[0])
    for name, column in zip(SUMMARY[1:], list(zip(*rows, strict=True))[1:], strict=True):
        table.add_column(name, justify="right", width=max(map(len, [*name.split(), *column])))
    for row in rows[:-1]:
        table.add_row(*row)
    table.add_section()
    table.add_row(*rows[-1])
    return table


def write_markdown(rows: Sequence[Sequence[str]], file: Path) -> None:
    """The summary for a page."""
    lines = [SUMMARY, ["---", *["---:"] * (len(SUMMARY) - 1)], *rows]
    file.write_text("".join(f"| {' | '.join(line)} |\n" for line in lines), encoding="utf-8")


def write_csv(cells: Iterable[Cell], file: Path) -> None:
    """One line per cell; columns as in Cell, in SI units but for the values of sweeps."""
    names = [one.name for one in fields(Cell)]
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(names)
        for cell in cells:
            writer.writerow(["vacuum" if n == "value" and cell.value is None else getattr(cell, n) for n in names])


# --- long runs -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LongRun:
    """Random commands, stroke after stroke.

    failed: Robots that failed. repairs, halvings, energy_cuts: See StrokeReport, all strokes together.
    strain, speed [m/s]: Largest at the end of a stroke. strain_late, speed_late: The same in the last tenth.
    farthest: Largest distance of a hub from where it began [m].
    """

    strokes: int
    robots: int
    failed: int
    iterations_per_stroke: float
    repairs: int
    halvings: int
    energy_cuts: int
    strain: float
    strain_late: float
    speed: float
    speed_late: float
    farthest: float
    seconds: float


def long_run(
    strokes: int = 10_000,
    robots: int = 256,
    fidelity: Fidelity = "fast",
    threads: int | None = None,
    progress: bool = True,
) -> LongRun:
    """Make strokes of random commands; every robot draws its own in every stroke."""
    simulator = Simulator(Scene(numerics=Numerics.preset(fidelity)), robots, threads)
    rng, start = np.random.default_rng(0), time.perf_counter()
    iterations, repairs, halvings, cuts, strain, speed = np.zeros((6, strokes))
    for k in tqdm(range(strokes), unit="stroke", disable=not progress):
        report = simulator.stroke(rng.integers(-1, 2, (robots, simulator.scene.robot.n_limbs)))
        iterations[k], repairs[k] = report.newton_iterations.mean(), report.repairs.sum()
        halvings[k], cuts[k] = report.halvings.sum(), report.energy_cuts.sum()
        strain[k], speed[k] = largest_strain(simulator), np.linalg.norm(simulator.velocities, axis=-1).max()
    late = -max(1, strokes // 10)
    return LongRun(
        strokes=strokes, robots=robots, failed=int(simulator.failed.sum()),
        iterations_per_stroke=float(iterations.mean()), repairs=int(repairs.sum()), halvings=int(halvings.sum()),
        energy_cuts=int(cuts.sum()), strain=float(strain.max()), strain_late=float(strain[late:].max()),
        speed=float(speed.max()), speed_late=float(speed[late:].max()),
        farthest=float(np.linalg.norm(simulator.hub_position(), axis=-1).max()), seconds=time.perf_counter() - start,
    )  # fmt: skip


def long_table(run: LongRun) -> Table:
    """For a terminal."""
    table = Table("quantity", "value", title="Long run of random commands")
    for one in fields(LongRun):
        table.add_row(one.name.replace("_", " "), f"{getattr(run, one.name):.5g}")
    return table


# --- the study -------------------------------------------------------------------------------------------------------


def main() -> None:
    """Measure, write, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="a coarser grid, in a fraction of the time")
    parser.add_argument("--scheme", choices=get_args(SchemeName), default="implicit-euler")
    parser.add_argument("--long", action="store_true", help="10,000 strokes of 256 robots instead of the atlas")
    parser.add_argument("--cost", action="store_true", help="what hardening costs, instead of the atlas")
    parser.add_argument("--out", type=Path, default=Path("runs/stability"), help="folder for CSV and pictures")
    options = parser.parse_args()
    console = Console()
    if options.long:
        console.print(long_table(long_run(1000 if options.quick else 10_000)))
        return
    if options.cost:
        console.print(cost_table([measure_cost(numerics) for numerics in SETTINGS]))
        return
    from studies.stability.pictures import draw_atlas

    sweeps, steps = (quick_sweeps(), QUICK_STEPS) if options.quick else (SWEEPS, STEPS)
    start = time.perf_counter()
    cells = atlas(sweeps, steps, options.scheme)
    options.out.mkdir(parents=True, exist_ok=True)
    rows = summarise(cells, sweeps)
    files = [options.out / "stability.csv", options.out / "stability.md"]
    write_csv(cells, files[0])
    write_markdown(rows, files[1])
    files += draw_atlas(cells, sweeps, steps, options.scheme, options.out)
    console.print(as_table(rows))
    console.print(f"{time.perf_counter() - start:.0f} s. In {options.out}: {', '.join(one.name for one in files)}")
