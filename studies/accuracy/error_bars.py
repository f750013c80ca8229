"""Do the error bars of a running simulation cover, and are they sharp?

The chapter's robot and six others swim ten strokes from rest with error bars, with sequences of every class of
`seastar_gym.accuracy.commands`, drawn anew. The true error is the hub's distance, at the end of every stroke, from
that of the same robot with 73 nodes per limb and the implicit midpoint rule at 0.25 ms. A stroke is covered where its
true error is at most the estimate. From the calibration's seed comes the factor that would cover 95 % of the strokes of
each robot; with the factors that the package has, the sequences of another seed tell the coverage, the class with the
lowest, and the median of estimate over true error.

Writes the numbers as JSON and a picture.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from seastar_gym.accuracy.commands import CLASSES, draw_classes
from seastar_gym.accuracy.measure import SHORT, swim
from seastar_gym.accuracy.setting import at
from seastar_gym.files import save_figure
from seastar_gym.scene import Numerics, Scene, Seastar, Water, relaxation_time
from seastar_gym.scene.numerics import PRESETS, Resolution
from seastar_gym.simulator.error_bars import factor
from studies.accuracy.work_precision import cost
from studies.frame import Floats, Results, Study
from studies.pages import markdown
from studies.style import CYCLE, FAINT, PERCENT, subplots

ROBOTS: dict[str, Scene] = {
    "the chapter's": Scene(),
    "soft, E = 0.1 MPa": Scene(Seastar(youngs_modulus=1e5)),
    "stiff, E = 10 MPa": Scene(Seastar(youngs_modulus=1e7)),
    "thick, r = 3 mm": Scene(Seastar(rod_radius=3e-3)),
    "short, L = 5 cm": Scene(Seastar(limb_length=0.05)),
    "slippery, C_d = 0.3": Scene(fluid=Water(drag_coefficient=0.3)),
    "silicone": Scene(Seastar(relaxation_time=relaxation_time(0.1, 10.0))),
}
FIDELITIES = ("fast", "balanced", "accurate")
SETTINGS: dict[str, Resolution] = {
    "fast": PRESETS["fast"],
    "balanced": PRESETS["balanced"],
    "accurate": PRESETS["accurate"],
    "adapted to 1 %": Resolution(
        "continuum", 12, Numerics("implicit-midpoint", 5e-3, newton_tolerance=1e-5, path_tolerance=0.01)
    ),
    "sdirk2, 20 ms": Resolution("continuum", 10, Numerics("sdirk2", 20e-3, 1e-6)),
    "sdirk3, 20 ms": Resolution("continuum", 10, Numerics("sdirk3", 20e-3, 1e-6)),
    "implicit-euler, 3 ms": Resolution("continuum", 10, Numerics("implicit-euler", 3e-3)),
    "chapter": PRESETS["chapter"],
    "chapter, midpoint 5 ms": Resolution("chapter", 10, Numerics("implicit-midpoint", 5e-3, 1e-6)),
}  # fmt: skip
TRUE = Resolution("continuum", 73, SHORT)
"""What stands for the continuum: twice the edges of the finest twin, half its steps."""
LEVEL = 0.95
"""Share of strokes that estimates are to cover."""
SAMPLES, SEEDS = 6, (1000, 3000)
"""Sequences per class, and the seeds of calibration and test."""
SMALLEST = 1e-12
"""True errors [m] below it are rounding."""


class Row(NamedTuple):
    """Error bars of a robot at a setting.

    needed: Factor that covers 95 % of the calibration's strokes. coverage: Share of held-out strokes that are covered.
    lowest, lowest_class: Its lowest value over classes of commands. sharpness: Median of estimate over true error.
    error: Median true error [m].
    """

    robot: str
    setting: str
    needed: float
    coverage: float
    lowest: float
    lowest_class: str
    sharpness: float
    error: float


def true_and_estimated(scene: Scene, commands: Floats, exact: Floats) -> tuple[Floats, Floats]:
    """True and estimated errors [m], shape (STROKES, n) each. A robot whose solver fails is not covered.

    exact: Hub [m], shape (STROKES, n, 2), at ends of strokes from rest.
    """
    swum = swim(scene, commands, error_bars=True)
    true = np.linalg.norm(swum.hub - exact, axis=-1)
    return np.fmax(np.nan_to_num(true, nan=np.inf), SMALLEST), np.nan_to_num(swum.error_estimate)


def by_class(covered: NDArray[np.bool_]) -> dict[str, float]:
    """Share of covered strokes for every class."""
    shares = covered.reshape(len(covered), len(CLASSES), -1).mean(axis=(0, 2))
    return dict(zip(CLASSES, shares.tolist(), strict=True))


def measure(names: tuple[str, ...], samples: int, seeds: tuple[int, int]) -> list[Row]:
    """Measure error bars of robots of these names at all settings; seeds: of the calibration and of the test."""
    rows = []
    for name in tqdm(names, unit="robot"):
        scene = ROBOTS[name]
        drawn = [draw_classes(samples, scene.robot.n_limbs, seed) for seed in seeds]
        exact = [swim(at(scene, TRUE), commands).hub for commands in drawn]
        for setting, numbers in SETTINGS.items():
            swum = at(scene, numbers)
            (true, estimate), held_out = (
                true_and_estimated(swum, commands, hub) for commands, hub in zip(drawn, exact, strict=True)
            )
            with np.errstate(divide="ignore"):
                needed = factor(swum) * float(np.quantile(true / estimate, LEVEL))
            rows.append(judged(name, setting, needed, *held_out))
    return rows


def judged(robot: str, setting: str, needed: float, true: Floats, estimate: Floats) -> Row:
    """Row of held-out strokes, from true and estimated errors [m]."""
    covered = true <= estimate
    classes = by_class(covered)
    lowest = min(classes, key=lambda name: classes[name])
    return Row(
        robot, setting, needed, float(covered.mean()), classes[lowest], lowest,
        float(np.median(estimate / true)), float(np.median(true)),
    )  # fmt: skip


def cost_of_error_bars(setting: Resolution) -> float:
    """Processor time with error bars over that without, see `cost`, of 64 robots."""
    without, with_them = (cost(at(Scene(), setting), 64, error_bars) for error_bars in (False, True))
    return with_them / without


def rows_of(results: Mapping[str, Any]) -> list[Row]:
    """Rows from plain data."""
    return [Row(**row) for row in results["rows"]]


def of_robots(results: Mapping[str, Any]) -> str:
    """Table of coverage and sharpness at the fidelities in Markdown."""
    rows = rows_of(results)
    head = [
        "robot", "fidelity", "true error [um]", "coverage", "lowest class", "estimate / true error", "factor needed",
    ]  # fmt: skip
    table = markdown(head, [_line(row) for row in rows if row.setting in FIDELITIES], (0, 1, 4))
    return f"{table}\n\n{_shortfall(rows)}"


def of_settings(results: Mapping[str, Any]) -> str:
    """Table of factors, coverage and costs of all settings in Markdown."""
    rows, costs = rows_of(results), results["costs"]
    found = [_summary(name, [row for row in rows if row.setting == name], costs[name]) for name in SETTINGS]
    return markdown(["setting", "factor", "needed", "lowest coverage", "estimate / true error", "cost"], found)


def _shortfall(rows: list[Row]) -> str:
    """Sentence on the robots and settings that fall short of the coverage that is wanted."""
    short = [f"{row.robot} at {row.setting} ({PERCENT * row.coverage:.1f} %)" for row in rows if row.coverage < LEVEL]
    return f"Below {PERCENT * LEVEL:.0f} %, here and at the settings below: {'; '.join(short) or 'none'}."


def _line(row: Row) -> list[str]:
    lowest = "all 100 %" if row.lowest == 1.0 else f"{row.lowest_class}, {PERCENT * row.lowest:.0f} %"
    return [
        row.robot, row.setting, f"{1e6 * row.error:.3g}", f"{PERCENT * row.coverage:.1f} %", lowest,
        f"{row.sharpness:.1f}", f"{row.needed:.1f}",
    ]  # fmt: skip


def _summary(name: str, rows: list[Row], times: float) -> list[str]:
    used, needed = factor(at(Scene(), SETTINGS[name])), max(row.needed for row in rows)
    lowest, dullest = min(row.coverage for row in rows), max(row.sharpness for row in rows)
    return [name, f"{used:g}", f"{needed:.1f}", f"{PERCENT * lowest:.1f} %", f"{dullest:.1f}", f"x {times:.1f}"]


def draw(rows: list[Row], path: Path) -> None:
    """Picture of coverage and sharpness over robots, for the fidelities."""
    figure, (left, right) = subplots(1, 2, figsize=(9.2, 3.8), sharey=True)
    names = list(dict.fromkeys(row.robot for row in rows))
    for shift, (fidelity, colour) in enumerate(zip(FIDELITIES, (CYCLE[1], CYCLE[0], CYCLE[2]), strict=True)):
        some = [row for row in rows if row.setting == fidelity]
        y = [names.index(row.robot) + 0.2 * (shift - 1) for row in some]
        left.plot([PERCENT * row.coverage for row in some], y, "o", color=colour, label=fidelity)
        left.plot([PERCENT * row.lowest for row in some], y, "|", color=colour, ms=9)
        right.plot([row.sharpness for row in some], y, "o", color=colour)
    left.axvline(PERCENT * LEVEL, color=FAINT, lw=1.0)
    right.axvline(5.0, color=FAINT, lw=1.0)
    right.axvline(1.0, color=FAINT, lw=1.0)
    left.set_yticks(range(len(names)), names)
    left.invert_yaxis()
    left.set_xlabel("strokes covered [%]; bars: lowest class; line: wanted")
    right.set_xlabel("median of estimate / true error; lines: 1 and 5")
    right.set_xlim(0.0, None)
    left.set_title("Held-out sequences of all classes", loc="left")
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper right", ncols=3)
    save_figure(figure, path)


def run(results: Results) -> str | None:
    """Measure all robots."""
    rows = measure(tuple(ROBOTS), SAMPLES, SEEDS)
    costs = {name: round(cost_of_error_bars(setting), 3) for name, setting in SETTINGS.items()}
    results.update(samples=SAMPLES, costs=costs, rows=[row._asdict() for row in rows])
    failed = not all(math.isfinite(row.needed) for row in rows)
    return "The solver failed on a robot, see the table." if failed else None


STUDY = Study(
    "accuracy.error_bars",
    run,
    file="accuracy/error_bars.json",
    pictures={"error_bars.png": lambda results, file: draw(rows_of(results), file)},
    tables={"error_bars robots": of_robots, "error_bars settings": of_settings},
    drawn=("accuracy/error_bars.png",),
)
