"""Speed of the simulator on this machine.

Measures the numbers that the README states about speed, prints them beside the chapter's, and writes `throughput.csv`
and `throughput.png`. The real-time factor is the simulated time of all robots over the computing time. Numbers are
medians of several repeats after a warm-up; beside them stands the range of the middle half of the repeats.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from seastar_gym.accuracy.measure import machine
from seastar_gym.files import save_figure
from seastar_gym.scene import Numerics, Scene, Seastar
from studies.frame import Results, Study, write_rows
from studies.pages import markdown, show
from studies.speed.kernels import part_seconds, peak_gigaflops, peak_speedup
from studies.speed.operations import count_operations, flops
from studies.speed.process import (
    FIRST_SCENES,
    IMPORT,
    environment_share,
    first_stroke,
    memory_per_robot,
    process_seconds,
    step_of_one,
)
from studies.speed.strokes import cost_over_nodes, exponent, iteration_seconds, real_time_factors, threads_speedup
from studies.style import CYCLE, FAINT, INK, subplots

CHAPTER = 1.0
"""The chapter's real-time factor at h = 3 ms: one robot, one thread of an AMD Ryzen 1950X (Fig. 13.9)."""
BATCHES = (1, 2, 4, 8, 16, 32, 64, 128, 512, 2048)
"""Numbers of robots on the curves of the real-time factor."""


@dataclass(frozen=True)
class Figure:
    """A measured number, one row of the table; quartiles: Those of the repeats, or None for a single measurement."""

    what: str
    value: float
    unit: str
    quartiles: tuple[float, float] | None = None


def median(what: str, unit: str, values: list[float]) -> Figure:
    """Figure from the median and the quartiles of repeats."""
    low, middle, high = np.percentile(values, [25, 50, 75])
    return Figure(what, float(middle), unit, (float(low), float(high)))


def start_up_figures() -> list[Figure]:
    """Processor times of the import, of the first strokes ever, and of the first stroke of a later process."""
    first = dict[str, float]()
    for name in FIRST_SCENES:
        with tempfile.TemporaryDirectory() as cache:
            first[name] = first_stroke(name, cache)
            if name == "balanced":
                imports = [process_seconds(IMPORT, cache) for _ in range(5)]
                later = [first_stroke(name, cache) for _ in range(5)]
    return [
        median("import of seastar_gym, beyond Gymnasium's", "s", imports),
        *(Figure(f"first stroke ever, {name}", seconds, "s") for name, seconds in first.items()),
        median("first stroke of a process, balanced, warm cache", "s", later),
    ]


def measure(seconds: float = 1.0) -> tuple[list[Figure], dict[str, list[tuple[int, float]]]]:
    """Rows of the table, and the curves of the picture: real-time factor over batch size, and cost over N."""
    chapter = Scene(Seastar(nodes_per_limb=10), numerics=Numerics.preset("chapter"))
    steps = {
        "batch": lambda: [median("batch, one core", "x real time", real_time_factors(chapter, 512, 1, 4 * seconds))],
        "threads": lambda: [
            median("two cores over one", "x", threads_speedup(chapter, 512, seconds)),
            median("two cores over one, fused products alone", "x", peak_speedup(seconds)),
        ],
        "alone": lambda: [
            median(f"one robot alone, one core{what}", "x real time", real_time_factors(scene, 1, 1, seconds))
            for what, scene in {"": chapter, ", fast": Scene.preset("fast")}.items()
        ],
        "peak": lambda: peak_figures(chapter, seconds),
        "environment": lambda: environment_figures(seconds),
        "memory": lambda: memory_figures(chapter),
        "start": start_up_figures,
    }
    figures: list[Figure] = []
    curves: dict[str, list[tuple[int, float]]] = {}
    bar = tqdm(total=len(steps) + 2, unit="measurement")
    for name, step in steps.items():
        bar.set_description(name)
        figures += step()
        bar.update()
    bar.set_description("nodes")
    curves["us per step over N"] = cost_over_nodes(chapter, seconds / 4)
    figures.append(Figure("exponent of the cost over nodes, N = 5..640", exponent(curves["us per step over N"]), "1"))
    bar.update()
    bar.set_description("batch sizes")
    for threads in (1, 2):
        curves[f"batch, {threads} thread{'s' * (threads > 1)}"] = [
            (n, float(np.median(real_time_factors(chapter, n, threads, seconds / 4)))) for n in BATCHES
        ]
    bar.update()
    bar.close()
    return figures, curves


def environment_figures(seconds: float) -> list[Figure]:
    """What a step of the environments takes beyond the kernels, of a batch and of one robot."""
    figures = [
        median("environment's share of a step, preset fast", "%", [100 * s for s in environment_share(512, seconds)])
    ]
    for id, what in {"SeastarSwim-v0": "a stroke", "SeastarSwimTimedModerate-v0": "0.2 s"}.items():
        beyond, kernels = zip(*(step_of_one(id, max(10, int(200 * seconds))) for _ in range(5)), strict=True)
        figures += [
            median(f"step of one environment, {what}, beyond its kernels", "ms", [1e3 * s for s in beyond]),
            median(f"- its kernels, {what}", "ms", [1e3 * s for s in kernels]),
        ]
    return figures


def peak_figures(scene: Scene, seconds: float) -> list[Figure]:
    """Operations of a Newton iteration, the peak rate of one core, and the share of it that strokes reach."""
    operations = flops(count_operations(scene)["iteration"])
    peak, duration = peak_gigaflops(seconds), iteration_seconds(scene, 4 * seconds)
    reached = operations / float(np.median(duration)) / 1e9
    parts = part_seconds(scene, seconds / 4)
    return [
        median("time per robot and Newton iteration, all included", "us", [1e6 * d for d in duration]),
        *(median(f"- of this, {name}", "us", [1e6 * d for d in durations]) for name, durations in parts.items()),
        Figure("operations per robot and Newton iteration", operations / 1e3, "kflop"),
        median("peak of one core, fused products alone", "Gflop/s", peak),
        Figure("share of the peak that strokes reach", 100 * reached / float(np.median(peak)), "%"),
    ]


def memory_figures(scene: Scene) -> list[Figure]:
    """Memory of a robot, and memory that a stroke leaves allocated."""
    held, left = memory_per_robot(scene)
    return [
        Figure("memory per robot, batch of 512", held, "KiB"),
        Figure("memory that a stroke leaves behind, per robot", left, "B"),
    ]


def as_table(figures: list[Figure]) -> str:
    """Figures as a table in Markdown."""
    rows = []
    for figure in figures:
        spread = "" if figure.quartiles is None else f"{figure.quartiles[0]:,.3g} .. {figure.quartiles[1]:,.3g}"
        rows.append([figure.what, f"{figure.value:,.4g}", figure.unit, spread])
    return markdown(["what", "median", "unit", "middle half"], rows, (0, 2))


def write_csv(figures: list[Figure], curves: dict[str, list[tuple[int, float]]], path: Path) -> None:
    """Write figures and curves as CSV."""
    rows = [[figure.what, "", figure.value, figure.unit, *(figure.quartiles or ("", ""))] for figure in figures]
    for name, curve in curves.items():
        unit = "us" if name.startswith("us") else "x real time"
        rows += [[name, x, value, unit, "", ""] for x, value in curve]
    write_rows(path, ["what", "x", "value", "unit", "quartile_1", "quartile_3"], rows)


def draw(curves: dict[str, list[tuple[int, float]]], path: Path) -> None:
    """Draw the real-time factor over the batch size, and the cost over the nodes per limb."""
    figure, (left, right) = subplots(1, 2, figsize=(10, 4.2))
    for threads, colour in ((1, CYCLE[0]), (2, CYCLE[1])):
        x, y = np.array(curves[f"batch, {threads} thread{'s' * (threads > 1)}"]).T
        left.loglog(x, y, "o-", color=colour, label=f"{threads} thread{'s' * (threads > 1)}")
    left.axhline(CHAPTER, color=FAINT, ls="--", lw=1)
    left.text(BATCHES[-1], CHAPTER * 1.15, "the chapter's code", ha="right", color=INK)
    left.set(xlabel="robots in the batch", ylabel="simulated over computing time", title="Speed (implicit Euler, 3 ms)")
    left.legend()
    n, cost = np.array(curves["us per step over N"]).T
    right.loglog(n, cost, "o-", label="measured")
    nodes: NDArray[np.float64] = 5 * n - 4
    right.loglog(n, cost[1] * nodes / nodes[1], "--", color=FAINT, lw=1, label="proportional to the number of nodes")
    right.set(xlabel="nodes per limb N", ylabel="time per robot and iteration [µs]", title="Cost of a Newton iteration")
    right.set_xticks(n, [f"{int(k)}" for k in n])
    right.minorticks_off()
    right.legend()
    save_figure(figure, path)


def run(results: Results) -> None:
    """Measure, write the files and print the table."""
    figures, curves = measure()
    write_csv(figures, curves, results.out / "throughput.csv")
    draw(curves, results.out / "throughput.png")
    title = f"Implicit Euler, h = 3 ms, N = 10 ({machine()}); the chapter: {CHAPTER:g} x real time"
    show(as_table(figures), title)
    print(f"Written: {results.out / 'throughput.csv'}, {results.out / 'throughput.png'}")


STUDY = Study("speed.throughput", run, out=Path("runs/throughput"), drawn=("speed/throughput.png",))
