"""History of the speed: ten fixed things, timed now and kept beside what they took before.

Each is a processor time, as a multiple of that of one fixed loop, which is timed just before and just after it: runs on
machines of one kind, as busy as they please, can be compared; another processor has other ratios. A run adds a row with
its date to `speed_history.json`. Caches and memory are shared with other work of a machine, however, so what differs by
less than 20 % is the same.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.files import save_figure
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Scene
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simulator import Simulator
from studies.frame import Results, Study, rounded
from studies.pages import markdown
from studies.provenance import provenance
from studies.speed import terms
from studies.speed.kernels import fused_products
from studies.speed.process import FIRST_STROKE, TIMED, process_seconds, step_of_one
from studies.style import CYCLE, subplots

ROOT = Path(__file__).resolve().parents[2]
UNIT = {"unit": "20 million times 8 fused products of one robot per lane"}
"""What all numbers are multiples of."""
FIDELITIES: tuple[Fidelity, ...] = ("fast", "balanced", "accurate", "reference")
Clock = Callable[[], float]


def unit() -> float:
    """Processor time of the fixed loop [s]."""
    chains = np.full((18, N_LANES), 0.5)
    start = time.process_time()
    fused_products(chains, 20_000_000)
    return time.process_time() - start


def stroke_of(scene: Scene, n_robots: int) -> Clock:
    """Clock of a stroke of the straight swim on one core; one stroke has gone before."""
    simulator, commands = Simulator(scene, n_robots, threads=1), np.tile(STRAIGHT, (n_robots, 1))
    simulator.stroke(commands)

    def seconds() -> float:
        start = time.process_time()
        simulator.stroke(commands)
        return time.process_time() - start

    return seconds


def training() -> float:
    """Processor time of a training of 4,096 strokes with its comparison [s]."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["--strokes", "4096", "--no-video", "--num-threads", "1", "--out", str(Path(folder, "run"))]
        before = os.times()
        subprocess.run([sys.executable, "train.py", *words], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def first_stroke() -> float:
    """Processor time of the first stroke ever, with import and compilation [s]."""
    with tempfile.TemporaryDirectory() as cache:
        return process_seconds(TIMED.format(FIRST_STROKE), cache)


def things() -> dict[str, tuple[int, Callable[[], Clock]]]:
    """What is timed, by name: how often, and how a clock of it is made."""
    cache = os.environ.get("NUMBA_CACHE_DIR", "")
    everything = terms.scenes()["all, a body, bent along, contact"]
    return {
        "first stroke ever": (1, lambda: first_stroke),
        "import": (5, lambda: lambda: process_seconds(TIMED.format("import seastar_gym"), cache)),
        "one robot, fast": (9, lambda: stroke_of(Scene.preset("fast"), 1)),
        **{
            f"512 robots, {name}": (5, lambda name=name: stroke_of(Scene.preset(name), 512))  # type: ignore[misc]
            for name in FIDELITIES
        },
        "64 robots, all terms": (5, lambda: stroke_of(everything, terms.GROUPS * N_LANES)),
        "step of one environment, 0.2 s": (9, lambda: lambda: sum(step_of_one("SeastarSwimTimedModerate-v0", 100))),
        "training of 4,096 strokes": (1, lambda: training),
    }


def ratio(clock: Clock, rounds: int) -> float:
    """Median of a clock over the fixed loop just before and after it."""
    found = []
    for _ in range(rounds):
        before, seconds, after = unit(), clock(), unit()
        found.append(2.0 * seconds / (before + after))
    return rounded(statistics.median(found), 3)


def commit() -> str:
    """Commit of the checkout; empty where there is none."""
    words = ["git", "rev-parse", "--short", "HEAD"]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()


def run(results: Results) -> None:
    """Time everything, and add a row."""
    unit()
    found = {}
    for name, (rounds, clock) in things().items():
        found[name] = ratio(clock(), rounds)
        print(f"{name}: {found[name]:,.3g}", flush=True)
    about = {name: value for name, value in provenance("").items() if name != "command"}
    row = {**about, "commit": commit(), "ratios": found}
    results.read()
    results.update(results.about)
    results.row(["runs"])[time.strftime("%Y-%m-%d %H:%M")] = row
    results.save()


def table(results: Mapping[str, Any]) -> str:
    """Table in Markdown of the first run and of the last."""
    runs = results["runs"]
    first, last = next(iter(runs)), next(reversed(runs))
    told = (f"{date} (`{runs[date]['commit']}`)" for date in (first, last))
    rows = []
    for name, now in runs[last]["ratios"].items():
        before = runs[first]["ratios"][name]
        rows.append([name, f"{before:,.3g}", f"{now:,.3g}", f"{now / before:.2f}"])
    return markdown(["what", *told, "last over first"], rows)


def draw(results: Mapping[str, Any], path: Path) -> None:
    """Draw every thing over the runs, as a multiple of what it took in the first."""
    runs = results["runs"]
    figure, axes = subplots(1, 1, figsize=(8, 4.2))
    first = next(iter(runs.values()))["ratios"]
    for k, name in enumerate(first):
        values = [row["ratios"].get(name, np.nan) / first[name] for row in runs.values()]
        axes.plot(values, ("o-", "s--")[k // len(CYCLE)], color=CYCLE[k % len(CYCLE)], label=name, markersize=4)
    axes.set(ylabel="time over that of the first run", ylim=(0.0, None))
    axes.set_xticks(range(len(runs)), [f"{date.split()[0]}\n{row['commit']}" for date, row in runs.items()])
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    save_figure(figure, path)


STUDY = Study(
    "speed.history", run, file="speed/speed_history.json", settings=lambda: UNIT,
    pictures={"speed_history.png": draw}, tables={"speed history": table},
)  # fmt: skip
