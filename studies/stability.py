"""Robustness and accuracy of the solver with time steps from 10 microseconds to 1 s.

The atlas varies eight quantities against the time step: Young's modulus, rod radius, resolution, drag, density, random
initial velocities and shifts, and the peak angle. Each of its cells is a scene at a time step, whose robots make one
stroke of random commands (for peak angles: of all 243 commands), from rest or from a random initial state. Strokes of
more than MOST_STEPS steps are cut short: the pulse ramps as fast as the chapter's and turns back after MOST_STEPS/10
steps. Two more runs without commands, one in the cell's fluid and one in vacuum, record the energy of randomly moving
robots after every step.
"""

import itertools
import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import EngFormatter
from tqdm import tqdm

from seastar_gym.files import save_figure
from seastar_gym.scene import Numerics, Scene, Seastar, SmaPulse, Water
from seastar_gym.scene.numerics import SchemeName
from seastar_gym.simulator import Simulator, State, StrokeReport
from seastar_gym.simulator.drive import step_times
from seastar_gym.simulator.simulator import completed
from studies.chapter import ISSUES_FROM, REAL_TIME_FROM
from studies.frame import Floats, Results, Study
from studies.pages import markdown
from studies.style import FAINT, INK, new_figure

STEPS = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 2e-2, 5e-2, 1e-1, 3e-1, 1.0)
"""Time steps of the atlas [s]."""
MOST_STEPS, ENERGY_STEPS, REFERENCE_STEPS = 2000, 100, 10_000
"""Time steps of a stroke at most, of a run without commands, and of the converged stroke of the midpoint rule."""
ROBOTS = 8
"""Number of robots in a cell. Cells of peak angles have one for every command instead."""
ENERGY_RUN_SPEED = 0.1
"""Standard deviation of the initial velocities [m/s] in the energy runs of cases without initial motion."""
AGREEMENT = 0.01
"""Largest relative difference of the converged path from the one with half as many steps."""
GROWTH_ROUNDING = 1e-11
"""Relative growth of the energy in a step that is attributed to rounding."""


@dataclass(frozen=True)
class Case:
    """A scene without its time step, and the initial state of its robots.

    speed: Standard deviation of the random initial velocities, per component and node [m/s].
    shift: Largest random initial displacement of a node, per component, as a fraction of the edge length.
    all_commands: Simulate one robot for every command of -1, 0 and +1 per limb.
    """

    robot: Seastar = Seastar(nodes_per_limb=10)
    fluid: Water | None = field(default_factory=Water)
    peak_angle: float = math.pi / 5
    speed: float = 0.0
    shift: float = 0.0
    all_commands: bool = False

    def commands(self) -> Floats:
        """Commands of the robots, shape (n_robots, n_limbs)."""
        if self.all_commands:
            return np.array(list(itertools.product((0.0, 1.0, -1.0), repeat=self.robot.n_limbs)))
        commands = np.random.default_rng(1).integers(-1, 2, (ROBOTS, self.robot.n_limbs)).astype(float)
        commands[0] = [0.0, 1.0, 0.0, 0.0, -1.0]
        return commands


class Sweep(NamedTuple):
    """A quantity that the atlas varies. values: In `unit`; None is vacuum. case: Of a value. chapter: Its value."""

    label: str
    unit: str
    values: tuple[Any, ...]
    case: Callable[[Any], Case]
    chapter: float


def robot(**changes: float) -> Case:
    """Case of the chapter's robot with changes."""
    return Case(robot=replace(Seastar(nodes_per_limb=10), **changes))  # type: ignore[arg-type]


SWEEPS = (
    Sweep("Young's modulus", "Pa", tuple(10.0**k for k in range(2, 12)), lambda E: robot(youngs_modulus=E), 1e6),
    Sweep(
        "rod radius", "mm", (0.01, 0.03, 0.1, 0.3, 0.8, 1.6, 4.0, 10.0, 20.0),
        lambda r: robot(rod_radius=1e-3 * r), 1.6,
    ),
    Sweep("nodes per limb", "", (2, 3, 5, 10, 20, 40, 80, 160, 320, 640), lambda N: robot(nodes_per_limb=N), 10),
    Sweep(
        "drag coefficient", "", (None, 0.0, 0.01, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4),
        lambda c: Case(fluid=None if c is None else Water(drag_coefficient=c)), 1.0,
    ),
    Sweep(
        "density of limbs over water", "", (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0),
        lambda ratio: robot(density=1000.0 * ratio), 1.0,
    ),
    Sweep(
        "random velocities of nodes", "m/s", (0.0, 0.001, 0.01, 0.1, 1.0, 10.0, 30.0, 100.0),
        lambda speed: Case(speed=speed), 0.0,
    ),
    Sweep(
        "random shifts of nodes", "% of an edge", (0.0, 0.3, 1.0, 3.0, 10.0, 20.0, 30.0),
        lambda shift: Case(shift=0.01 * shift), 0.0,
    ),
    Sweep(
        "peak angle, all 243 commands", "°", (9.0, 18.0, 36.0, 54.0, 72.0, 90.0, 108.0, 135.0, 162.0, 179.0),
        lambda angle: Case(peak_angle=math.radians(angle), all_commands=True), 36.0,
    ),
)  # fmt: skip


def format_value(value: float | None) -> str:
    """Text of a value without its unit, such as 10⁶, 1.6 or vacuum."""
    if value is None:
        return "vacuum"
    if value >= 1e4:
        return "10" + str(round(math.log10(value))).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{value:g}"


# A cell of the atlas


@dataclass(frozen=True)
class Cell:
    """Measurements of a scene at a time step.

    sweep: Label of the quantity, whose value this is; step: Time step [s].
    robots: Number of robots, and of those whose status was not CONVERGED, or whose state was not finite, in any run.
    iterations: Newton iterations per nominal time step, averaged over the stroke and its robots.
    regularised, backtracks, halvings: Counts of StrokeReport, summed over robots.
    growth: Largest relative growth of a robot's energy in one step without commands, in the fluid or in vacuum.
        Energies below a billionth of the initial one count as that billionth.
    error: Distance of the hub from the converged one, relative to the hub's displacement: root mean squares over
        robots, at the end of heating and at the stroke's end. NaN where there is no converged run.
    """

    sweep: str
    value: float | None
    step: float
    robots: int = 0
    failed: int = 0
    iterations: float = math.nan
    regularised: int = 0
    backtracks: int = 0
    halvings: int = 0
    growth: float = math.nan
    error: float = math.nan


def stroke_duration(step: float) -> float:
    """Duration of a cell's stroke [s]: the chapter's, or MOST_STEPS steps if that is less."""
    return min(1.0, MOST_STEPS * step)


def make_scene(case: Case, numerics: Numerics, duration: float) -> Scene:
    """Scene of a case; a stroke that is cut short ramps as fast as a whole one."""
    whole = Scene(case.robot, case.fluid, SmaPulse(case.peak_angle), numerics)
    return replace(whole, actuator=SmaPulse(case.peak_angle * duration, 0.1 * duration, 0.9 * duration))


def disturb(simulator: Simulator, speed: float, shift: float) -> None:
    """Add random velocities [m/s] and shifts [edge lengths] to all nodes, from the same random numbers in all cells."""
    rng, state = np.random.default_rng(2), simulator.get_state()
    shifts = rng.uniform(-1.0, 1.0, state.positions.shape) * shift * simulator.scene.robot.edge_length
    velocities = rng.standard_normal(state.positions.shape) * speed
    simulator.set_state(State(state.positions + shifts, velocities, state.time))


def swim(case: Case, numerics: Numerics, duration: float) -> tuple[Simulator, Floats, StrokeReport]:
    """Simulate a stroke of a case's robots: (simulator, hub displacements, report).

    The displacements [m] have shape (2, n_robots, 2): at the end of heating, and at the end of the stroke.
    """
    commands = case.commands()
    simulator = Simulator(make_scene(case, numerics, duration), len(commands), threads=1)
    disturb(simulator, case.speed, case.shift)
    begin, hubs = simulator.hub_position(), {}

    def look(time: float) -> None:
        hubs[round(time / duration, 6)] = simulator.hub_position()

    report = completed(simulator.stroke_in_parts(commands, 10), look)
    return simulator, np.array([hubs[0.1], hubs[1.0]]) - begin, report


def converged_displacements(case: Case, duration: float) -> Floats | None:
    """Converged hub displacements of a case [m], see `swim`, or None if two fine time steps do not agree on them."""
    found = []
    for steps in (REFERENCE_STEPS, REFERENCE_STEPS // 2):
        _, displacements, report = swim(case, Numerics("implicit-midpoint", duration / steps), duration)
        if report.status.any():
            return None
        found.append(displacements)
    return found[0] if displacement_error(found[1], found[0]) <= AGREEMENT else None


def displacement_error(displacements: Floats, converged: Floats) -> float:
    """Relative error of hub displacements, see `Cell.error`; NaN if the converged hub does not move."""
    size = float(np.sqrt(np.mean(converged**2)))
    return float(np.sqrt(np.mean((displacements - converged) ** 2))) / size if size > 0.0 else math.nan


def energy_growth(case: Case, numerics: Numerics, fluid: Water | None) -> tuple[float, int]:
    """(growth, number of failed robots) of randomly moving robots without commands, see `Cell`."""
    half = 0.5 * ENERGY_STEPS * numerics.step
    simulator = Simulator(Scene(case.robot, fluid, SmaPulse(0.0, half, half), numerics), ROBOTS, threads=1)
    disturb(simulator, case.speed if case.speed or case.shift else ENERGY_RUN_SPEED, case.shift)
    energies = [simulator.elastic_energy() + simulator.kinetic_energy()]
    for _ in simulator.stroke_in_parts(np.zeros((ROBOTS, case.robot.n_limbs)), ENERGY_STEPS):
        energies.append(simulator.elastic_energy() + simulator.kinetic_energy())
    energy = np.array(energies)
    growth = np.diff(energy, axis=0) / np.maximum(energy[:-1], 1e-9 * energy[0])
    return float(growth.max()), int((simulator.failed | ~np.isfinite(energy).all(axis=0)).sum())


def run_cell(sweep: Sweep, value: float | None, step: float, scheme: SchemeName, converged: Floats | None) -> Cell:
    """Measure one cell; converged: the result of `converged_displacements` for its case and duration."""
    case, numerics = sweep.case(value), Numerics(scheme, step)
    simulator, displacements, report = swim(case, numerics, stroke_duration(step))
    finite = np.isfinite(simulator.positions).all(axis=(1, 2)) & np.isfinite(simulator.velocities).all(axis=(1, 2))
    growths, lost = zip(*(energy_growth(case, numerics, fluid) for fluid in (case.fluid, None)), strict=True)
    steps = len(step_times(simulator.scene.actuator.corners, step)) - 1  # nominal ones, without substeps
    return Cell(
        sweep.label, value, step, simulator.n_robots,
        failed=int((report.status.astype(bool) | ~finite).sum()) + sum(lost),
        iterations=float(report.newton_iterations.mean()) / steps, regularised=int(report.regularised.sum()),
        backtracks=int(report.backtracks.sum()), halvings=int(report.halvings.sum()), growth=max(growths),
        error=math.nan if converged is None else displacement_error(displacements, converged),
    )  # fmt: skip


def atlas(sweeps: Sequence[Sweep], steps: Sequence[float], scheme: SchemeName = "implicit-euler") -> list[Cell]:
    """Measure all cells of the atlas; returns them in the order of sweeps, values and steps."""
    columns = [(sweep, value) for sweep in sweeps for value in sweep.values]
    bar = tqdm(total=len(columns) * len(steps), unit="cell", smoothing=0.02)

    def column(sweep: Sweep, value: float | None) -> list[Cell]:
        """Cells of one value at all steps; steps with strokes of the same duration share their converged run."""
        cells = []
        for duration, members in itertools.groupby(steps, stroke_duration):
            converged = converged_displacements(sweep.case(value), duration)
            for step in members:
                cells.append(run_cell(sweep, value, step, scheme, converged))
                bar.update()
        return cells

    with bar, ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        return [cell for cells in pool.map(lambda each: column(*each), columns) for cell in cells]


SUMMARY = (
    "against", "cells", "strokes", "failed", "Newton iterations per step (most)", "substeps", "energy grew",
    "error at 3, 20 ms",
)  # fmt: skip
TOLD = ("against", "failed", "Newton iterations per step (most)")
"""Columns of the page."""


def summarise(cells: Sequence[Cell], sweeps: Sequence[Sweep]) -> list[list[str]]:
    """Rows of the summary, one per sweep and one for all cells; columns as in SUMMARY."""
    rows = []
    for sweep in sweeps:
        ends = " ... ".join(format_value(sweep.values[k]) for k in (0, -1))
        own = [cell for cell in cells if cell.sweep == sweep.label]
        found = {cell.step: cell.error for cell in own if cell.value == sweep.chapter}
        errors = [found.get(step, math.nan) for step in (REAL_TIME_FROM, ISSUES_FROM)]
        shown = ", ".join(f"{100 * error:.2g}" if math.isfinite(error) else "-" for error in errors)
        rows.append([f"{sweep.label}: {ends} {sweep.unit}".strip(), *figures(own), f"{shown} %"])
    return [*rows, ["all", *figures(cells), ""]]


def figures(cells: Sequence[Cell]) -> list[str]:
    """Columns "cells" to "energy grew" of the summary."""
    iterations = [cell.iterations for cell in cells]
    grew = sum(cell.growth > GROWTH_ROUNDING for cell in cells)
    return [
        str(len(cells)), str(sum(cell.robots for cell in cells)), str(sum(cell.failed for cell in cells)),
        f"{np.median(iterations):.2g} ({max(iterations):.0f})", f"{sum(cell.halvings > 0 for cell in cells)} cells",
        f"{grew} cells" if grew else "nowhere",
    ]  # fmt: skip


def table(results: Mapping[str, Any]) -> str:
    """Some columns of the summary in Markdown."""
    kept = [SUMMARY.index(name) for name in TOLD]
    return markdown(TOLD, [[row[k] for k in kept] for row in results["summary"]])


MARK, EMPTY = "#d62728", "#eceff3"
NEEDS = {
    "plain Newton": "#c7e0f4", "regularised matrix or line search": "#5aa2d6", "substeps": "#1b4f8f", "failed": MARK,
}  # fmt: skip
"""Needs of the solver, from least to most, and their colours."""
NAMES = {"implicit-euler": "Implicit Euler", "implicit-midpoint": "Implicit midpoint rule", "sdirk2": "SDIRK2"}
FRAME: dict[str, Any] = {"fill": False, "edgecolor": INK, "linewidth": 1.4}
DASHES: dict[str, Any] = {"color": MARK, "linewidth": 1.6, "linestyle": (0, (4, 2))}


class Numbers(NamedTuple):
    """A positive number of every cell, drawn on a logarithmic scale.

    colours: Name of a map. limits: Ends of the scale. tick: Format. missing: Legend of cells that have none.
    """

    title: str
    label: str
    of: Callable[[Cell], float]
    colours: str
    limits: tuple[float, float]
    tick: str
    missing: str = ""


NUMBERS = {
    "iterations": Numbers(
        "Newton iterations per time step", "Newton iterations per time step", lambda cell: cell.iterations,
        "viridis_r", (1.0, 300.0), "{x:g}",
    ),
    "error": Numbers(
        "error of the hub's path against the converged run", "error of the hub's path",
        lambda cell: 100.0 * cell.error, "magma_r", (0.01, 100.0), "{x:g} %", "no converged run",
    ),
}  # fmt: skip
"""What pictures show beside the needs of the solver, by the ends of their names."""


def need(cell: Cell) -> float:
    """Index into NEEDS of what the solver needed in a cell."""
    if cell.failed:
        return 3.0
    return 2.0 if cell.halvings else float(cell.regularised + cell.backtracks > 0)


def draw(cells: Sequence[Cell], sweeps: Sequence[Sweep], steps: Sequence[float], scheme: str, file: Path) -> None:
    """Write the picture that a file's name ends with, such as stability_needs.png."""
    numbers = NUMBERS.get(file.stem.rpartition("_")[2])
    columns, rows = min(4, len(sweeps)), math.ceil(len(sweeps) / min(4, len(sweeps)))
    figure = new_figure(3.1 * columns + 0.3, 2.75 * rows + 1.2)
    title = f"{NAMES[scheme]}: {'needs of the solver' if numbers is None else numbers.title}"
    figure.suptitle(title, x=0.01, ha="left", fontsize=13)
    note = "Strokes with steps below 1 ms are cut short after 2000 steps."
    figure.text(0.99, 0.975, note, ha="right", fontsize=8.5, color=FAINT)
    grid = figure.add_gridspec(rows + 1, columns, height_ratios=[*[1.0] * rows, 0.16])
    panels = [figure.add_subplot(grid[k // columns, k % columns]) for k in range(len(sweeps))]
    for axes, sweep in zip(panels, sweeps, strict=True):
        own = {(cell.value, cell.step): cell for cell in cells if cell.sweep == sweep.label}
        of = need if numbers is None else numbers.of
        shown = np.ma.masked_invalid([[of(own[value, h]) for h in steps] for value in sweep.values])
        if numbers is None:
            look: dict[str, Any] = {"cmap": ListedColormap(list(NEEDS.values())), "vmin": -0.5, "vmax": 3.5}
        else:
            look = {"cmap": numbers.colours, "norm": LogNorm(*numbers.limits)}
            shown = np.clip(shown, *numbers.limits)
        image = axes.pcolormesh(shown, edgecolors="white", linewidth=0.5, **look)
        finish(axes, sweep, steps)
    for axes in panels[-columns:]:
        axes.set_xlabel("time step h", fontsize=8.5)
    foot = figure.add_subplot(grid[rows, :])
    foot.axis("off")
    if numbers is None:
        patches = [Patch(color=colour, label=each) for each, colour in NEEDS.items()]
    else:
        place = foot.inset_axes((0.0, 0.55, 0.5, 0.3))
        look = {"orientation": "horizontal", "extend": "both", "format": numbers.tick, "label": numbers.label}
        bar = figure.colorbar(image, cax=place, **look)
        bar.ax.minorticks_off()
        patches = [Patch(facecolor=EMPTY, label=numbers.missing)] if numbers.missing else []
    marks = [
        Patch(label="the chapter's value", **FRAME),
        Line2D([], [], label="the chapter's numerical issues begin: 20 ms", **DASHES),
    ]  # fmt: skip
    foot.legend(
        handles=[*patches, *marks], loc="upper left", bbox_to_anchor=(0.56 if numbers else 0.0, 1.0),
        ncols=2 if numbers else 4, fontsize=9, borderaxespad=0.0,
    )  # fmt: skip
    save_figure(figure, file)


def finish(axes: Axes, sweep: Sweep, steps: Sequence[float]) -> None:
    """Add ticks, a title, and the marks of the chapter."""
    halo = [withStroke(linewidth=3.2, foreground="white")]  # lines then show on any colour
    axes.set_facecolor(EMPTY)
    axes.set_xticks(np.arange(len(steps)) + 0.5, [EngFormatter("s")(step) for step in steps], rotation=90)
    axes.set_yticks(np.arange(len(sweep.values)) + 0.5, [format_value(value) for value in sweep.values])
    axes.tick_params(length=0, labelsize=8)
    axes.set_title(f"{sweep.label} [{sweep.unit}]" if sweep.unit else sweep.label, loc="left")
    axes.spines[:].set_visible(False)
    if sweep.chapter in sweep.values:
        row = sweep.values.index(sweep.chapter)
        axes.add_patch(Rectangle((0, row), len(steps), 1, clip_on=False, path_effects=halo, **FRAME))
        axes.get_yticklabels()[row].set_fontweight("bold")
    if ISSUES_FROM in steps:
        column = steps.index(ISSUES_FROM)
        axes.axvline(column, path_effects=halo, **DASHES)
        axes.get_xticklabels()[column].set_color(MARK)


@dataclass(frozen=True)
class Options:
    """Robustness and accuracy of the solver over time steps."""

    scheme: SchemeName = "implicit-euler"
    """Scheme of the atlas."""
    quick: bool = False
    """A few cells only, in a minute."""


def run(options: Options, results: Results) -> None:
    """Run the atlas, draw it, and keep the summary."""
    sweeps = [each._replace(values=each.values[-1:]) for each in SWEEPS[:2] + SWEEPS[5:7]] if options.quick else SWEEPS
    steps = STEPS[7::2] if options.quick else STEPS
    cells = atlas(sweeps, steps, options.scheme)
    for name in ("needs", *NUMBERS):
        draw(cells, sweeps, steps, options.scheme, results.folder / f"stability_{name}.png")
    results.update(scheme=options.scheme, columns=list(SUMMARY), summary=summarise(cells, sweeps))


STUDY = Study(
    "stability", run, Options, "stability/stability.json", Path("runs/stability"), tables={"stability": table}
)
