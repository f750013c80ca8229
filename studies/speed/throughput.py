"""How fast the simulator is on this machine: `python -m studies.speed.throughput`.

Measures what the README states about speed, prints it beside the chapter's figure, and writes `throughput.csv` and
`throughput.png`. Real-time factor: simulated seconds of all robots over seconds of computing. Figures are medians
of several repeats after a warm-up; the spread beside them is the range of the middle half of the repeats.
"""

import argparse
import csv
import gc
import os
import platform
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from seastar_gym.command import run_command
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Numerics, Scene
from seastar_gym.simd.compilation import entry_point
from seastar_gym.simd.lanes import N_LANES, add_product, borrow, load, store
from seastar_gym.simulator import Simulator
from studies.speed.operations import count_operations, flops
from studies.speed.parts import part_seconds

CHAPTER = 1.0
"""The chapter's real-time factor at h = 3 ms: one robot, one thread of an AMD Ryzen 1950X (Fig. 13.9)."""
NODES_PER_LIMB = (5, 10, 20, 40, 80, 160, 320, 640)
BATCHES = (1, 2, 4, 8, 16, 32, 64, 128, 512, 2048)


@dataclass(frozen=True)
class Figure:
    """One row of the table. quartiles: of the repeats, or None where only one value makes sense."""

    what: str
    value: float
    unit: str
    quartiles: tuple[float, float] | None = None


def median(what: str, unit: str, values: list[float]) -> Figure:
    """The median of repeats, with its quartiles."""
    low, middle, high = np.percentile(values, [25, 50, 75])
    return Figure(what, float(middle), unit, (float(low), float(high)))


# --- the simulator ---------------------------------------------------------------------------------------------------


def repeat(run: Callable[[], object], seconds: float, at_least: int = 5) -> list[float]:
    """Durations [s] of repeated runs, after one that does not count, for about `seconds`."""
    run()
    durations: list[float] = []
    while len(durations) < at_least or sum(durations) < seconds:
        start = time.perf_counter()
        run()
        durations.append(time.perf_counter() - start)
    return durations


def stroke_durations(scene: Scene, n_robots: int, threads: int, seconds: float) -> list[float]:
    """Durations [s] of strokes of the straight swim."""
    simulator = Simulator(scene, n_robots, threads)
    commands = np.tile(STRAIGHT, (n_robots, 1))
    return repeat(lambda: simulator.stroke(commands), seconds)


def real_time_factors(scene: Scene, n_robots: int, threads: int, seconds: float) -> list[float]:
    """Simulated seconds per second of computing."""
    return [n_robots * scene.actuator.period / d for d in stroke_durations(scene, n_robots, threads, seconds)]


def threads_speedup(scene: Scene, n_robots: int, seconds: float) -> list[float]:
    """Ratios of the duration on one thread to that on two, measured in turn."""
    commands = np.tile(STRAIGHT, (n_robots, 1))
    one, two = Simulator(scene, n_robots, threads=1), Simulator(scene, n_robots, threads=2)
    ratios = []
    for _ in range(max(5, int(seconds * 4))):
        ratios.append(repeat(lambda: one.stroke(commands), 0.0, 1)[0] / repeat(lambda: two.stroke(commands), 0.0, 1)[0])
    return ratios


def cost_over_nodes(scene: Scene, seconds: float) -> list[tuple[int, float]]:
    """(N, microseconds per robot and step) of a fixed motion, for N nodes per limb."""
    rows = []
    for n in NODES_PER_LIMB:
        finer = replace(scene, robot=replace(scene.robot, nodes_per_limb=n))
        simulator = Simulator(finer, N_LANES, threads=1)
        commands = np.zeros((N_LANES, 5))  # one Newton iteration per step for any N: what is compared is its cost
        duration = float(np.median(repeat(partial(simulator.stroke, commands), seconds)))
        iterations = int(simulator.stroke(commands).newton_iterations.max())
        rows.append((n, duration / N_LANES / iterations * 1e6))
    return rows


def exponent(rows: list[tuple[int, float]]) -> float:
    """Slope of log cost over the logarithm of the number of nodes, 5 N - 4."""
    nodes, cost = np.array(rows).T
    slope: float = np.polyfit(np.log(5 * nodes - 4), np.log(cost), 1)[0]
    return slope


@entry_point
def fused_products(values, n):
    """Sixteen independent chains of fused products: nothing else can be faster. values: shape (18, N_LANES)."""
    rows = borrow(values)
    c, d = load(rows, 16), load(rows, 17)
    x0, x1, x2, x3 = load(rows, 0), load(rows, 1), load(rows, 2), load(rows, 3)
    x4, x5, x6, x7 = load(rows, 4), load(rows, 5), load(rows, 6), load(rows, 7)
    for _ in range(n):
        x0, x1, x2, x3 = add_product(c, x0, d), add_product(c, x1, d), add_product(c, x2, d), add_product(c, x3, d)
        x4, x5, x6, x7 = add_product(c, x4, d), add_product(c, x5, d), add_product(c, x6, d), add_product(c, x7, d)
    store(rows, 0, x0 + x1 + x2 + x3 + x4 + x5 + x6 + x7)


def peak_gigaflops(seconds: float) -> list[float]:
    """What one core reaches on fused products alone."""
    values = np.full((18, N_LANES), 0.5)
    n = 200_000
    return [8 * 2 * N_LANES * n / d / 1e9 for d in repeat(lambda: fused_products(values, n), seconds)]


def peak_speedup(seconds: float) -> list[float]:
    """What the second core is worth to fused products alone, in turn: no batch can gain more."""
    chains, n = [np.full((18, N_LANES), 0.5) for _ in range(2)], 2_000_000
    ratios = []
    with ThreadPoolExecutor(2) as pool:
        for _ in range(max(5, int(seconds * 4))):
            one = repeat(lambda: [fused_products(chain, n) for chain in chains], 0.0, 1)[0]
            two = repeat(lambda: list(pool.map(fused_products, chains, [n, n])), 0.0, 1)[0]
            ratios.append(one / two)
    return ratios


def iteration_seconds(scene: Scene, seconds: float) -> list[float]:
    """Seconds per robot and Newton iteration, everything else that a stroke does included."""
    simulator = Simulator(scene, 8 * N_LANES, threads=1)
    commands = np.tile(STRAIGHT, (simulator.n_robots, 1))
    iterations = int(simulator.stroke(commands).newton_iterations.sum())
    return [d / iterations for d in repeat(lambda: simulator.stroke(commands), seconds)]


# --- the environment and the process ---------------------------------------------------------------------------------


def environment_share(n_robots: int, seconds: float) -> list[float]:
    """Share of a vector environment's step that is not the simulator's stroke, at the fastest preset, in turn."""
    env = gym.make_vec(
        "seastar_gym:SeastarSwim-v0", num_envs=n_robots, vectorization_mode="vector_entry_point", fidelity="fast",
        actions="joint", max_episode_steps=10**9, threads=1, path=[[10.0, 0.0]],
    )  # fmt: skip
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(max(5, int(20 * seconds))):
        actions = rng.integers(3**5, size=n_robots)
        batch = env.unwrapped
        commands = batch.command_table[actions]  # type: ignore[attr-defined]
        simulator = batch.simulator  # type: ignore[attr-defined]
        state = simulator.get_state()
        start = time.perf_counter()
        simulator.stroke(commands)
        stroke = time.perf_counter() - start
        simulator.set_state(state)
        start = time.perf_counter()
        env.step(actions)
        shares.append(1.0 - stroke / (time.perf_counter() - start))
    return shares[1:]


def memory_per_robot(scene: Scene, n_robots: int = 512) -> tuple[float, float]:
    """(KiB that a robot of a batch holds, bytes that a stroke leaves behind per robot)."""
    commands = np.tile(STRAIGHT, (n_robots, 1))
    tracemalloc.start()
    simulator = Simulator(scene, n_robots, threads=1)
    held = tracemalloc.get_traced_memory()[0]
    simulator.stroke(commands)
    gc.collect()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(20):
        simulator.stroke(commands)
    gc.collect()
    left = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    return held / n_robots / 1024, max(0, left) / 20 / n_robots


def process_seconds(code: str, cache: str) -> float:
    """Seconds that a fresh interpreter takes for `code`, which prints them, with numba's cache in a folder."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    output = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    return float(output.stdout)


TIMED = "import time; start = time.perf_counter(); {}; print(time.perf_counter() - start)"
FIRST_STROKE = "import seastar_gym as s; s.Simulator(s.Scene()).stroke([[0, 1, 0, 0, -1]])"


def start_up_figures() -> list[Figure]:
    """Import, first stroke ever and first stroke of a later process."""
    with tempfile.TemporaryDirectory() as cache:
        imports = [process_seconds(TIMED.format("import seastar_gym"), cache) for _ in range(5)]
        first = process_seconds(TIMED.format(FIRST_STROKE), cache)
        later = [process_seconds(TIMED.format(FIRST_STROKE), cache) for _ in range(5)]
    return [
        median("import of seastar_gym", "s", imports),
        Figure("first stroke ever, with import and compilation", first, "s"),
        median("first stroke of a process, with import, warm cache", "s", later),
    ]


# --- the study -------------------------------------------------------------------------------------------------------


def measure(seconds: float, progress: bool = True) -> tuple[list[Figure], dict[str, list[tuple[int, float]]]]:
    """All rows of the table, and the curves of the picture (real-time factor over batch size and over N)."""
    chapter = Scene(numerics=Numerics.preset("chapter"))
    steps = {
        "batch": lambda: [median("batch, one core", "x real time", real_time_factors(chapter, 512, 1, 4 * seconds))],
        "threads": lambda: [
            median("two cores over one", "x", threads_speedup(chapter, 512, seconds)),
            median("two cores over one, fused products alone", "x", peak_speedup(seconds)),
        ],
        "alone": lambda: [
            median("one robot alone, one core", "x real time", real_time_factors(chapter, 1, 1, seconds))
        ],
        "peak": lambda: peak_figures(chapter, seconds),
        "environment": lambda: [
            median(
                "environment's share of a step, preset fast", "%", [100 * s for s in environment_share(512, seconds)]
            )
        ],
        "memory": lambda: memory_figures(chapter),
        "start": start_up_figures,
    }
    figures: list[Figure] = []
    curves: dict[str, list[tuple[int, float]]] = {}
    bar = tqdm(total=len(steps) + 2, disable=not progress, unit="measurement")
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


def peak_figures(scene: Scene, seconds: float) -> list[Figure]:
    """Operations of an iteration, the processor's peak, and the share of it that whole strokes reach."""
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
    """What a robot holds, and what a stroke leaves behind."""
    held, left = memory_per_robot(scene)
    return [
        Figure("memory per robot, batch of 512", held, "KiB"),
        Figure("memory that a stroke leaves behind, per robot", left, "B"),
    ]


def machine() -> str:
    """A line about the machine."""
    return f"{os.cpu_count()} cores, {platform.machine()}, {N_LANES} lanes, Python {platform.python_version()}"


def as_table(figures: list[Figure]) -> Table:
    """For the terminal."""
    table = Table(title=f"Implicit Euler, h = 3 ms, N = 10 ({machine()}); the chapter: {CHAPTER:g} x real time")
    for column, justify in (("what", "left"), ("median", "right"), ("unit", "left"), ("middle half", "right")):
        table.add_column(column, justify=justify)  # type: ignore[arg-type]
    for figure in figures:
        spread = "" if figure.quartiles is None else f"{figure.quartiles[0]:,.3g} .. {figure.quartiles[1]:,.3g}"
        table.add_row(figure.what, f"{figure.value:,.4g}", figure.unit, spread)
    return table


def write_csv(figures: list[Figure], curves: dict[str, list[tuple[int, float]]], path: Path) -> None:
    """Table and curves."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["what", "x", "value", "unit", "quartile_1", "quartile_3"])
        for figure in figures:
            writer.writerow([figure.what, "", figure.value, figure.unit, *(figure.quartiles or ("", ""))])
        for name, rows in curves.items():
            unit = "us" if name.startswith("us") else "x real time"
            writer.writerows([name, x, value, unit, "", ""] for x, value in rows)


def draw(curves: dict[str, list[tuple[int, float]]], path: Path) -> None:
    """Real-time factor over batch size, and cost over nodes per limb."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    for threads, colour in ((1, "#4477aa"), (2, "#ee6677")):
        x, y = np.array(curves[f"batch, {threads} thread{'s' * (threads > 1)}"]).T
        left.loglog(x, y, "o-", color=colour, label=f"{threads} thread{'s' * (threads > 1)}")
    left.axhline(CHAPTER, color="0.4", ls="--", lw=1)
    left.text(BATCHES[-1], CHAPTER * 1.15, "the chapter", ha="right", color="0.3")
    left.set(
        xlabel="robots in the batch", ylabel="simulated over computing seconds", title="Real-time factor, h = 3 ms"
    )
    left.legend(frameon=False)
    n, cost = np.array(curves["us per step over N"]).T
    right.loglog(n, cost, "o-", color="#4477aa", label="measured")
    nodes: NDArray[np.float64] = 5 * n - 4
    right.loglog(n, cost[1] * nodes / nodes[1], "--", color="0.4", lw=1, label="proportional to the number of nodes")
    right.set(xlabel="nodes per limb N", ylabel="time per robot and iteration [µs]", title="Cost over resolution")
    right.set_xticks(n, [f"{int(k)}" for k in n])
    right.minorticks_off()
    right.legend(frameon=False)
    for axes in (left, right):
        axes.grid(True, which="major", color="0.9")
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="shorter measurements, noisier")
    parser.add_argument("--out", type=Path, default=Path("runs/throughput"), help="folder for CSV and picture")
    options = parser.parse_args()
    figures, curves = measure(0.2 if options.quick else 1.0)
    options.out.mkdir(parents=True, exist_ok=True)
    write_csv(figures, curves, options.out / "throughput.csv")
    draw(curves, options.out / "throughput.png")
    console = Console()
    console.print(as_table(figures))
    console.print(f"Written: {options.out / 'throughput.csv'}, {options.out / 'throughput.png'}")


if __name__ == "__main__":
    run_command(main)
