"""The atlas of stability: `python -m seastar_gym.studies.stability`.

How the solver fares from 10 microseconds to 1 s of time step, against stiffness, thickness, resolution, drag, density,
rattled robots and commands up to the largest peak angle. Prints a summary and writes every cell as CSV, the summary as
Markdown, and three pictures: what every cell needed, Newton iterations per step, and the error of the hub's path.

A cell is a scene at a time step. Its robots make one stroke of random commands (for peak angles: of all 243 commands),
from rest or rattled. Strokes of more than MOST_STEPS steps are cut short: the pulse ramps as fast as the chapter's, and
turns back after MOST_STEPS/10 steps. Two more runs, without commands, in the cell's fluid and in vacuum, of rattled
robots look at the energy after every step.

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
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from seastar_gym.actuation.schedule import step_times
from seastar_gym.scene import Fidelity, Numerics, Scene, SchemeName, SmaPulse, Water
from seastar_gym.simulator import Simulator, State, StrokeReport
from seastar_gym.studies.hardening import SETTINGS, cost_table, measure_cost
from seastar_gym.studies.stability_cases import (
    CHAPTER_TROUBLE,
    QUICK_STEPS,
    STEPS,
    SWEEPS,
    Case,
    Sweep,
    format_value,
    quick_sweeps,
)

Floats = NDArray[np.float64]

MOST_STEPS = 2000
"""Of a stroke."""
ENERGY_STEPS = 100
"""Time steps of a run without commands."""
ROBOTS = 8
"""In a cell, but for peak angles: there one for every command."""
RATTLED = 0.1
"""Velocities [m/s] of the robots whose energy is looked at, where a cell does not say otherwise."""
REFERENCE_STEPS = 10_000
"""Of a stroke by the implicit midpoint rule; half as many must agree with it to AGREEMENT of the path."""
AGREEMENT = 0.01
GROWTH_ROUNDING = 1e-11
"""Growth of energy in a step, over the energy, that is rounding."""


# --- one cell --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cell:
    """A cell of the atlas, and a line of the CSV.

    refused: The sentence with which the scene was refused, if it was; the rest is then empty.
    failed: Robots whose status was not CONVERGED, or whose state was not finite, in any of the runs.
    iterations: Newton iterations per time step of `step`, on average over the stroke and its robots.
    repairs, backtracks, halvings, energy_cuts: See StrokeReport; all robots together.
    folded: Robots whose opening angles do not add up to a full turn after the stroke: a hub hinge went through its
        pole.
    strain, speed: Largest at the stroke's end. opening_angle: Smallest, see StrokeReport.
    growth, growth_in_vacuum: Largest growth of a robot's energy in one step without commands, over its energy (or a
        billionth of its first one, if that is more). gain, gain_in_vacuum: Largest energy over the first, less 1.
    error: Distance of the hub from that of the converged run at the end of heating and at the stroke's end, root mean
        square over robots, over that of the hub's way there; NaN where there is no converged run.
    """

    sweep: str
    value: float | None
    step: float
    refused: str = ""
    robots: int = 0
    steps: int = 0
    failed: int = 0
    iterations: float = math.nan
    repairs: int = 0
    backtracks: int = 0
    halvings: int = 0
    energy_cuts: int = 0
    folded: int = 0
    opening_angle: float = math.nan
    strain: float = math.nan
    speed: float = math.nan
    growth: float = math.nan
    growth_in_vacuum: float = math.nan
    gain: float = math.nan
    gain_in_vacuum: float = math.nan
    error: float = math.nan
    seconds: float = 0.0


def stroke_duration(step: float) -> float:
    """Of a cell's stroke [s]: the chapter's, or MOST_STEPS steps if that is less."""
    return min(1.0, MOST_STEPS * step)


def make_scene(case: Case, numerics: Numerics, duration: float) -> Scene:
    """The case's scene; a stroke that is cut short ramps as fast as a whole one."""
    whole = Scene(case.robot, case.fluid, SmaPulse(case.peak_angle), numerics)
    return replace(whole, actuator=SmaPulse(case.peak_angle * duration, 0.1 * duration, 0.9 * duration))


def commands_of(case: Case) -> Floats:
    """Commands of the robots of a case, shape (n_robots, n_limbs)."""
    n_limbs = case.robot.n_limbs
    if case.all_commands:
        return np.array(list(itertools.product((0.0, 1.0, -1.0), repeat=n_limbs)))
    commands = np.random.default_rng(1).integers(-1, 2, (ROBOTS, n_limbs)).astype(float)
    commands[0] = [0.0, 1.0, 0.0, 0.0, -1.0]
    return commands


def rattle(simulator: Simulator, speed: float, shift: float) -> None:
    """Give all nodes random velocities and shifts, the same in every cell, see Case."""
    rng, state = np.random.default_rng(2), simulator.get_state()
    shifts = rng.uniform(-1.0, 1.0, state.positions.shape) * shift * simulator.scene.robot.edge_length
    velocities = rng.standard_normal(state.positions.shape) * speed
    simulator.set_state(State(state.positions + shifts, velocities, state.time))


def swim(case: Case, numerics: Numerics, duration: float) -> tuple[Simulator, Floats, StrokeReport]:
    """A stroke of a case's robots: them, the way of their hubs to the end of heating and of the stroke [m], the report.

    The way has shape (2, n_robots, 2).
    """
    commands = commands_of(case)
    simulator = Simulator(make_scene(case, numerics, duration), len(commands), threads=1)
    rattle(simulator, case.speed, case.shift)
    begin, hubs = simulator.hub_position(), {}
    stroke = simulator.stroke_in_parts(commands, 10)
    while True:
        try:
            hubs[round(next(stroke) / duration, 6)] = simulator.hub_position()
        except StopIteration as finished:
            return simulator, np.array([hubs[0.1], hubs[1.0]]) - begin, finished.value


def converged_way(case: Case, duration: float) -> Floats | None:
    """The way that a cell's error is measured from, or None if finer steps do not agree on one."""
    ways = []
    for steps in (REFERENCE_STEPS, REFERENCE_STEPS // 2):
        _, way, report = swim(case, Numerics("implicit-midpoint", duration / steps), duration)
        if report.status.any():
            return None
        ways.append(way)
    return ways[0] if way_error(ways[1], ways[0]) <= AGREEMENT else None


def way_error(way: Floats, converged: Floats) -> float:
    """See Cell.error."""
    size = float(np.sqrt(np.mean(converged**2)))
    return float(np.sqrt(np.mean((way - converged) ** 2))) / size if size > 0.0 else math.nan


def largest_strain(simulator: Simulator) -> float:
    """Of all edges: |length over natural length - 1|."""
    robot, nodes = simulator.scene.robot, simulator.positions
    limbs = nodes[:, 1:].reshape(len(nodes), robot.n_limbs, -1, 2)
    hubs = np.broadcast_to(nodes[:, None, :1], (len(nodes), robot.n_limbs, 1, 2))
    lengths = np.linalg.norm(np.diff(np.concatenate([hubs, limbs], axis=2), axis=2), axis=-1)
    return float(np.abs(lengths / robot.edge_length - 1.0).max())


def count_folded(simulator: Simulator) -> int:
    """See Cell.folded."""
    roots = simulator.positions[:, 1 :: simulator.scene.robot.nodes_per_limb - 1] - simulator.positions[:, :1]
    directions = np.arctan2(roots[..., 1], roots[..., 0])
    angles = np.remainder(np.roll(directions, -1, axis=1) - directions + np.pi, 2.0 * np.pi) - np.pi
    return int((np.abs(angles.sum(axis=1) - 2.0 * np.pi) > 1.0).sum())


def energy_growth(case: Case, numerics: Numerics, fluid: Water | None) -> tuple[float, float, int]:
    """(growth, gain, failed robots) of rattled robots without commands, see Cell."""
    half = 0.5 * ENERGY_STEPS * numerics.step
    simulator = Simulator(Scene(case.robot, fluid, SmaPulse(0.0, half, half), numerics), ROBOTS, threads=1)
    rattle(simulator, case.speed if case.speed or case.shift else RATTLED, case.shift)
    energies = [simulator.elastic_energy() + simulator.kinetic_energy()]
    for _ in simulator.stroke_in_parts(np.zeros((ROBOTS, case.robot.n_limbs)), ENERGY_STEPS):
        energies.append(simulator.elastic_energy() + simulator.kinetic_energy())
    energy = np.array(energies)
    growth = np.diff(energy, axis=0) / np.maximum(energy[:-1], 1e-9 * energy[0])
    lost = simulator.failed | ~np.isfinite(energy).all(axis=0)
    return float(growth.max()), float((energy / energy[0]).max()) - 1.0, int(lost.sum())


def run_cell(sweep: Sweep, value: float | None, step: float, scheme: SchemeName, converged: Floats | None) -> Cell:
    """Measure one cell; converged: what converged_way gave."""
    start, case, numerics = time.perf_counter(), sweep.case(value), Numerics(scheme, step)
    try:
        simulator, way, report = swim(case, numerics, stroke_duration(step))
    except ValueError as refusal:
        return Cell(sweep.name, value, step, refused=str(refusal))
    finite = np.isfinite(simulator.positions).all(axis=(1, 2)) & np.isfinite(simulator.velocities).all(axis=(1, 2))
    in_fluid, in_vacuum = energy_growth(case, numerics, case.fluid), energy_growth(case, numerics, None)
    steps = count_steps(simulator.scene)
    return Cell(
        sweep.name, value, step, "", simulator.n_robots, steps,
        failed=int((report.status.astype(bool) | ~finite).sum()) + in_fluid[2] + in_vacuum[2],
        iterations=float(report.newton_iterations.mean()) / steps,
        repairs=int(report.repairs.sum()), backtracks=int(report.backtracks.sum()),
        halvings=int(report.halvings.sum()), energy_cuts=int(report.energy_cuts.sum()), folded=count_folded(simulator),
        opening_angle=float(report.smallest_opening_angle.min()), strain=largest_strain(simulator),
        speed=float(np.linalg.norm(simulator.velocities, axis=-1).max()),
        growth=in_fluid[0], growth_in_vacuum=in_vacuum[0], gain=in_fluid[1], gain_in_vacuum=in_vacuum[1],
        error=math.nan if converged is None else way_error(way, converged), seconds=time.perf_counter() - start,
    )  # fmt: skip


def count_steps(scene: Scene) -> int:
    """Time steps of a stroke that needs no halving."""
    return len(step_times(scene.actuator.corners, scene.numerics.step)) - 1


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
    from seastar_gym.studies.stability_pictures import draw_atlas

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


if __name__ == "__main__":
    main()
