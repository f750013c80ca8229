"""The chapter's figures: `python -m studies.chapter` writes Figs. 13.2 and 13.5b to 13.9 as PNG.

Each swim is computed with the chapter's numerics and once more converged; what the chapter states about it, and what
both give, is printed and written to `statements.csv`.
"""

import argparse
import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from seastar_gym import gaits
from seastar_gym.gaits import STRAIGHT, pentagon_gait
from seastar_gym.scene import Numerics, Scene, SmaPulse
from seastar_gym.simulator import Simulator, SolverStatus
from studies.chapter import pictures
from studies.chapter.pictures import MM, Cost, Swim

Floats = NDArray[np.float64]

CHAPTER = Numerics("implicit-euler", 3e-3)
CONVERGED, NEARLY_CONVERGED = Numerics("implicit-midpoint", 0.25e-3), Numerics("implicit-midpoint", 1e-3)
PAIRS = {
    name.replace(",", ", ").replace("-", "⁻").replace("+", "⁺"): command for name, command in gaits.PAIRS.items()
}
SIDE = gaits.SWIMMING_STROKES + gaits.RESTING_STROKES
"""Strokes of a side of the pentagon."""
BISECTORS = (36.0, 72.0, 108.0, 144.0)
"""Of the pairs at rest, on the side they swim to [degrees]."""
STEPS = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 40.0]) * 1e-3
QUICK_STEPS = np.array([0.3, 1.0, 3.0, 10.0, 20.0, 40.0]) * 1e-3
BATCH = 64


# --- swims -----------------------------------------------------------------------------------------------------------


def label(numerics: Numerics) -> str:
    """For legends."""
    name = {CHAPTER: "the chapter's setting", CONVERGED: "converged"}.get(numerics, "nearly converged")
    scheme = numerics.scheme.replace("-", " ").replace("euler", "Euler")
    return f"{name} ({scheme}, {1e3 * numerics.step:g} ms)"


def swim(numerics: Numerics, commands: ArrayLike, samples_per_stroke: int) -> Swim:
    """Follows robots from rest over strokes; commands: shape (n_strokes, n_robots, n_limbs)."""
    commands = np.asarray(commands, float)
    scene = Scene(numerics=numerics)
    simulator = Simulator(scene, commands.shape[1])
    samples = [(0.0, simulator.positions, simulator.velocities)]
    for stroke, command in enumerate(commands):
        for since in simulator.stroke_in_parts(command, samples_per_stroke):
            now = stroke * scene.actuator.period + since
            samples.append((now, simulator.positions, simulator.velocities))
        if simulator.failed.any():
            raise RuntimeError(SolverStatus.NOT_CONVERGED.sentence)
    times, positions, velocities = (np.array(values) for values in zip(*samples, strict=True))
    return Swim(label(numerics), scene, commands, times, positions, velocities)


def computing_seconds(simulator: Simulator, seconds: float) -> float:
    """Computing time of a stroke of the straight swim [s], the shortest of repeats that take about this many seconds.

    The shortest, because whatever else the machine does can only add to it.
    """
    commands = np.tile(STRAIGHT, (simulator.n_robots, 1))
    simulator.stroke(commands)
    durations: list[float] = []
    while len(durations) < 3 or sum(durations) < seconds:
        start = time.perf_counter()
        simulator.stroke(commands)
        durations.append(time.perf_counter() - start)
    return min(durations)


def needs_repair(scene: Scene) -> bool:
    """Whether Newton's matrix is ever indefinite in ten strokes of the straight swim."""
    simulator = Simulator(scene)
    return any(simulator.stroke(STRAIGHT[None]).repairs[0] > 0 for _ in range(10))


def cost(steps: Floats, seconds: float, progress: Callable[[], object] = lambda: None) -> Cost:
    """Fig. 13.9 on one thread of this machine; seconds: of measuring per point."""
    alone, in_batch, repaired = [], [], []
    for step in steps:
        scene = Scene(numerics=Numerics("implicit-euler", float(step)))
        period = scene.actuator.period
        alone.append(computing_seconds(Simulator(scene, 1, threads=1), seconds) / period)
        in_batch.append(computing_seconds(Simulator(scene, BATCH, threads=1), seconds) / period / BATCH)
        repaired.append(needs_repair(scene))
        progress()
    return Cost(steps, np.array(alone), np.array(in_batch), BATCH, np.array(repaired))


# --- what the chapter states -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Statement:
    """A sentence of the chapter beside a quantity that it is about. values: In the chapter's setting, converged."""

    sentence: str
    quantity: str
    unit: str
    values: tuple[float, ...]


def stroke_motion(straight: Swim) -> tuple[float, float, float, float]:
    """Of the last stroke, on x: (way while heated, way on until it turns, way back [m], time of turning [s])."""
    start, end = straight.at_strokes()[-2:]
    x, since = straight.hub()[start : end + 1, 0], straight.time[start : end + 1] - straight.time[start]
    heated = int(np.searchsorted(since, straight.scene.actuator.corners[1] - 1e-9))
    farthest = int(np.argmax(x))
    return x[heated] - x[0], x[farthest] - x[heated], x[farthest] - x[-1], float(since[farthest])


def straight_statements(swims: Sequence[Swim]) -> list[Statement]:
    """About Fig. 13.6."""
    moves = list(zip(*(stroke_motion(swim) for swim in swims), strict=True))
    forward = "the robot swims forward during the actuating phase ..."
    back = "... but moves slightly backward in the cooling state"
    no_y = "no displacement along the Y-axis"
    return [
        Statement("the net motion of the robot is forward", "x after 10 strokes", "mm",
                  tuple(MM * s.hub()[-1, 0] for s in swims)),
        Statement(forward, "forward while heated, 10th stroke", "mm", tuple(MM * np.array(moves[0]))),
        Statement(forward, "forward after that", "mm", tuple(MM * np.array(moves[1]))),
        Statement(back, "backward", "mm", tuple(MM * np.array(moves[2]))),
        Statement(back, "turns back at", "s", moves[3]),
        Statement(no_y, "largest |y|", "mm", tuple(MM * np.abs(s.hub()[:, 1]).max() for s in swims)),
    ]  # fmt: skip


def pentagon_statements(swims: Sequence[Swim]) -> list[Statement]:
    """About Figs. 13.2 and 13.7."""
    corners = [s.hub()[s.at_strokes()[:: SIDE]] for s in swims]
    sides = [np.hypot(*np.diff(c, axis=0).T) for c in corners]
    stops = [s.at_strokes()[gaits.SWIMMING_STROKES :: SIDE] for s in swims]
    rests = [s.at_strokes()[SIDE :: SIDE] for s in swims]
    coasts = [np.hypot(*(s.hub()[r] - s.hub()[b]).T) for s, r, b in zip(swims, rests, stops, strict=True)]
    rest = "left unactuated for 5 s to bring the robot to a complete stop"
    same = "the same initial conditions for each straight component"
    return [
        Statement("regular pentagon", "mean side", "mm", tuple(MM * d.mean() for d in sides)),
        Statement(same, "longest minus shortest side", "mm", tuple(MM * np.ptp(d) for d in sides)),
        Statement("a closed path", "end to start", "mm", tuple(MM * np.hypot(*c[-1]) for c in corners)),
        Statement(rest, "hub coasts back in the rest", "mm", tuple(MM * c.mean() for c in coasts)),
        Statement(rest, "hub's speed after the rest", "mm/s",
                  tuple(MM * np.hypot(*s.hub_velocity()[r].T).max() for s, r in zip(swims, rests, strict=True))),
        Statement(rest, "fastest node after the rest", "mm/s",
                  tuple(MM * np.hypot(*s.velocities[r, 0].T).max() for s, r in zip(swims, rests, strict=True))),
    ]  # fmt: skip


def pair_statements(swims: Sequence[Swim]) -> list[Statement]:
    """About Fig. 13.8."""
    ends = [s.positions[-1, :, 0] for s in swims]
    order = "the maximum with limbs #1 and #4, a lower efficiency with #1 and #2"
    rows = [
        Statement(order, f"distance of {name}", "mm", tuple(MM * np.hypot(*end[k]) for end in ends))
        for k, name in enumerate(PAIRS)
    ]
    off = [np.degrees(np.arctan2(end[:, 1], end[:, 0])) - BISECTORS for end in ends]
    return [
        *rows,
        Statement("always moves along the bisector", "largest angle off it", "degrees",
                  tuple(np.abs(o).max() for o in off)),
    ]  # fmt: skip


def cost_statements(cost: Cost) -> list[Statement]:
    """About Fig. 13.9; the one column is implicit Euler, as in the chapter."""
    at_3 = int(np.argmin(np.abs(cost.steps - pictures.CHAPTER_REAL_TIME)))
    slope = np.polyfit(np.log(cost.steps), np.log(cost.in_batch), 1)[0]
    faster = "faster than real time when h is 3 ms or more"
    return [
        Statement(faster, "real-time factor at 3 ms, one robot alone", "", (1.0 / cost.alone[at_3],)),
        Statement(faster, f"the same per robot of {cost.n_robots}", "", (1.0 / cost.in_batch[at_3],)),
        Statement("time linearly scales with step size", "exponent of h", "", (slope,)),
        Statement("numerical issues at h of 20 ms or more", "smallest h at which Newton's matrix is indefinite", "ms",
                  tuple(1e3 * cost.steps[cost.repaired][:1])),
    ]  # fmt: skip


def as_table(statements: Sequence[Statement]) -> Table:
    """For the terminal."""
    table = Table(title="What the chapter states, and what its setting and the converged one give")
    table.add_column("the chapter", max_width=36)
    table.add_column("quantity", max_width=30)
    for column in ("its setting", "converged"):
        table.add_column(column, justify="right", no_wrap=True)
    last = ""
    for row in statements:
        cells = [f"{value:.4g} {row.unit}".rstrip() for value in row.values]
        if row.sentence != last:
            table.add_section()
        table.add_row("" if row.sentence == last else row.sentence, row.quantity, *cells)
        last = row.sentence
    return table


def write_csv(statements: Sequence[Statement], file: Path) -> None:
    """The same as a file."""
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["the chapter", "quantity", "unit", "its setting", "converged"])
        writer.writerows([row.sentence, row.quantity, row.unit, *row.values] for row in statements)


# --- the study -------------------------------------------------------------------------------------------------------


def make_figures(out: Path, quick: bool = False, progress: bool = True) -> list[Statement]:
    """Computes all swims and writes all figures into a folder; quick: a coarser converged solution, fewer steps."""
    out.mkdir(parents=True, exist_ok=True)
    both = CHAPTER, NEARLY_CONVERGED if quick else CONVERGED
    steps, seconds = (QUICK_STEPS, 0.01) if quick else (STEPS, 0.5)
    bar = tqdm(total=4 + len(steps), unit="part", disable=not progress)
    actuator = SmaPulse()
    pictures.draw_pulse(actuator, out / "fig_13_5b.png")

    bar.set_description("straight swim")
    straight = [swim(numerics, np.tile(STRAIGHT, (10, 1, 1)), 200) for numerics in both]
    pictures.draw_straight(straight[1], straight[0], out / "fig_13_6.png")
    statements = straight_statements(straight)
    bar.update()

    bar.set_description("pentagon")
    pentagon = [swim(numerics, pentagon_gait()[:, None], 20) for numerics in both]
    pictures.draw_pentagon_snapshots(pentagon[1], pentagon[0], out / "fig_13_2.png")
    bar.update()
    pictures.draw_pentagon(pentagon[1], pentagon[0], out / "fig_13_7a.png")
    pictures.draw_pentagon_signals(pentagon[1], out / "fig_13_7b.png")
    statements += pentagon_statements(pentagon)
    bar.update()

    bar.set_description("pairs")
    pairs = [swim(numerics, np.tile(list(PAIRS.values()), (10, 1, 1)), 50) for numerics in both]
    pictures.draw_pairs(pairs[1], pairs[0], list(PAIRS), out / "fig_13_8.png")
    statements += pair_statements(pairs)
    bar.update()

    bar.set_description("time steps")
    costs = cost(steps, seconds, bar.update)
    pictures.draw_cost(costs, out / "fig_13_9.png")
    bar.close()
    return statements + cost_statements(costs)


def main() -> None:
    """Compute, draw, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--quick", action="store_true", help="nearly converged only (1 ms), and fewer time steps in Fig. 13.9"
    )
    parser.add_argument("--out", type=Path, default=Path("runs/chapter"), help="folder for the figures")
    options = parser.parse_args()
    statements = make_figures(options.out, options.quick)
    write_csv(statements, options.out / "statements.csv")
    console = Console()
    console.print(as_table(statements))
    console.print(f"Written: {', '.join(str(file) for file in sorted(options.out.glob('*.png')))}")
