"""Speed: throughput of strokes and environments, cold start, and what ten fixed things took before.

    python -m studies.benchmark                          # ten fixed things, a row of the history
    python -m studies.benchmark --also throughput start  # with the numbers of docs/speed.md

A run adds a row with its date to `speed_history.json`. The fixed things are processor times, as multiples of that of
one fixed loop, which is timed just before and just after: runs on machines of one kind, as busy as they please, can be
compared; another processor has other ratios. Caches and memory are shared with other work of a machine, however, so
what differs by less than 20 % is the same. Other numbers are medians, with the range of the middle half.
"""

import gc
import os
import statistics
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest.mock import patch

import gymnasium as gym
import numpy as np

from seastar_gym.envs import observation
from seastar_gym.files import save_figure
from seastar_gym.gaits import STRAIGHT
from seastar_gym.lanes.compile import entry_point
from seastar_gym.lanes.dispatch import code_for
from seastar_gym.lanes.registers import N_LANES, add_product, borrow, load, store
from seastar_gym.rods import interval as stroke
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator, StrokeReport, batch
from studies.frame import Results, Study, require_known, rounded
from studies.gpu import EVERYTHING, scenes
from studies.operations import count_operations, flops
from studies.pages import markdown
from studies.provenance import provenance
from studies.style import INK, subplots

ROOT = Path(__file__).resolve().parents[1]
UNIT = {"unit": "20 million times 8 fused products of one robot per lane"}
"""What ratios are multiples of."""
FIDELITIES: tuple[Fidelity, ...] = ("fast", "balanced", "accurate", "reference")
NODES_PER_LIMB = (5, 10, 20, 40, 80, 160, 320, 640)
"""Nodes per limb over which the cost is measured."""
BATCH = 512
"""Robots of a batch."""
ENVIRONMENTS = {"SeastarSwim-v0": "strokes of 1 s", "SeastarSwimTimedModerate-v0": "decisions of 0.2 s"}
NEIGHBOURS = {"Swimmer-v5": "0.04 s", "HalfCheetah-v5": "0.05 s"}
"""Environments of MuJoCo, timed where it is installed, and how long a decision is."""
Clock = Callable[[], float]
Row = tuple[str, str, float, float, float]
"""What a number is, its unit, its median, and the range of the middle half of its repeats."""


# Throughput


def repeat(run: Callable[[], object], seconds: float) -> list[float]:
    """Durations of repeated runs [s], after a first run that does not count, for about `seconds` [s]."""
    run()
    durations: list[float] = []
    while len(durations) < 5 or sum(durations) < seconds:
        start = time.perf_counter()
        run()
        durations.append(time.perf_counter() - start)
    return durations


def row(what: str, unit: str, values: list[float]) -> Row:
    """Row of a number from its repeats."""
    low, middle, high = np.percentile(values, [25, 50, 75])
    return what, unit, float(middle), float(low), float(high)


def straight(scene: Scene, n_robots: int, threads: int = 1) -> Callable[[], StrokeReport]:
    """A stroke of all robots in the straight swim."""
    return partial(Simulator(scene, n_robots, threads).stroke, np.tile(STRAIGHT, (n_robots, 1)))


def real_time_factors(scene: Scene, n_robots: int, seconds: float) -> list[float]:
    """Real-time factors of a batch on one core: simulated over computing time."""
    return [n_robots * scene.actuator.period / each for each in repeat(straight(scene, n_robots), seconds)]


def threads_speedup(scene: Scene, n_robots: int, seconds: float) -> list[float]:
    """Ratios of the duration of a stroke on one thread to that on two, which take turns."""
    one, two = (straight(scene, n_robots, threads) for threads in (1, 2))
    return [min(repeat(one, 0.0)) / min(repeat(two, 0.0)) for _ in range(max(5, int(seconds)))]


def iteration_seconds(scene: Scene, seconds: float) -> list[float]:
    """Durations per robot and Newton iteration [s], including everything else that a stroke does."""
    swim = straight(scene, 8 * N_LANES)
    iterations = int(swim().newton_iterations.sum())
    return [each / iterations for each in repeat(swim, seconds)]


def exponent(scene: Scene, seconds: float) -> float:
    """Exponent of the cost of a Newton iteration at rest over the number of nodes."""
    cost = []
    for n in NODES_PER_LIMB:
        simulator = Simulator(replace(scene, robot=replace(scene.robot, nodes_per_limb=n)), N_LANES, threads=1)
        rest = partial(simulator.stroke, np.zeros((N_LANES, 5)))
        cost.append(statistics.median(repeat(rest, seconds)) / rest().newton_iterations.max())
    return float(np.polyfit(np.log(5 * np.array(NODES_PER_LIMB) - 4), np.log(cost), 1)[0])


def step_of(env: Any, n: int) -> tuple[float, float]:
    """Processor time of a step beyond its kernels, and in them [s], means of n random steps.

    Kernels are the machine code of the strokes and of the observation, as Python calls it.
    """
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(n)]
    env.step(actions[0])
    in_kernels = 0.0

    def timed(kernel: Callable[..., None]) -> Callable[..., None]:
        codes: list[Callable[..., None]] = []

        def call(*arguments: Any) -> None:
            nonlocal in_kernels
            if not codes:
                codes.append(code_for(kernel, *arguments))
            start = time.thread_time()
            codes[0](*arguments)
            in_kernels += time.thread_time() - start

        call.at = lambda form: call  # type: ignore[attr-defined]  # as entry points are asked for their lanes
        return call

    advance, observe = timed(stroke.advance), timed(observation.observe)
    with patch.object(batch, "advance", advance), patch.object(observation, "observe", observe):
        start = time.thread_time()
        for action in actions:
            env.step(action)
        whole = time.thread_time() - start
    return (whole - in_kernels) / n, in_kernels / n


def environment(id: str, n_robots: int | None = None) -> Any:
    """One environment at `fast`, or a batch on one core, whose episodes do not end."""
    options: dict[str, Any] = {"fidelity": "fast", "max_episode_steps": 10**9, "path": [[10.0, 0.0], [10.0, 10.0]]}
    if n_robots is None:
        return gym.make(id, **options)
    return gym.make_vec(id, n_robots, vectorization_mode="vector_entry_point", threads=1, **options)


def memory_per_robot(scene: Scene, n_robots: int = BATCH) -> tuple[float, float]:
    """Memory of a robot in a batch [KiB], and memory that a stroke leaves allocated per robot [B]."""
    tracemalloc.start()
    swim = straight(scene, n_robots)
    held = tracemalloc.get_traced_memory()[0]
    swim()
    gc.collect()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(20):
        swim()
    gc.collect()
    left = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    return held / n_robots / 1024, max(0, left) / 20 / n_robots


def throughput(seconds: float) -> Iterator[Row]:
    """Speed of strokes and environments. seconds: For which a number is measured."""
    chapter = Scene(Seastar(nodes_per_limb=10), numerics=Numerics.preset("chapter"))
    yield row(f"batch of {BATCH}, one core", "x real time", real_time_factors(chapter, BATCH, 4 * seconds))
    yield row("two cores over one", "x", threads_speedup(chapter, BATCH, seconds))
    for name, scene in {"ten nodes, 3 ms": chapter, "fast": Scene.preset("fast")}.items():
        yield row(f"one robot alone, one core, {name}", "x real time", real_time_factors(scene, 1, seconds))
    iterations = [1e6 * each for each in iteration_seconds(chapter, 4 * seconds)]
    yield row("time per robot and Newton iteration, all included", "us", iterations)
    yield row("operations of it", "kflop", [flops(count_operations(chapter)["iteration"]) / 1e3])
    yield row("exponent of the cost over nodes, N = 5 to 640", "1", [exponent(chapter, seconds / 4)])
    held, left = memory_per_robot(chapter, BATCH)
    yield row(f"memory per robot, batch of {BATCH}", "KiB", [held])
    yield row("memory that a stroke leaves behind, per robot", "B", [left])
    for id, what in ENVIRONMENTS.items():
        for n_robots in (None, BATCH):
            env, n = environment(id, n_robots), max(3, int(seconds * (20 if n_robots else 200)))
            beyond, kernels = np.array([step_of(env, n) for _ in range(5)]).T
            env.close()
            name = f"{n_robots or 'one'}, fast, {what}"
            yield row(f"step of {name}: Python", "ms", [1e3 * each for each in beyond])
            yield row(f"step of {name}: kernels", "ms", [1e3 * each for each in kernels])
            yield row(f"decisions of {name}", "1/s", [(n_robots or 1) / each for each in beyond + kernels])
    for id, what in NEIGHBOURS.items() if find_spec("mujoco") else ():
        env = gym.make(id, max_episode_steps=10**9)
        rates = [1.0 / step_of(env, max(3, int(2000 * seconds)))[0] for _ in range(5)]
        env.close()
        yield row(f"decisions of {id}, {what}", "1/s", rates)


# Cold start


IMPORT = "import gymnasium", "import seastar_gym"
FIRST = "import seastar_gym as s; from studies.gpu import EVERYTHING, scenes"
SWIM = "scene = {}; n = scene.n_robots or 1; s.Simulator(scene, n).stroke([[0, 1, 0, 0, -1]] * n)"
FIRST_SCENES = {
    "balanced": "s.Scene.preset('balanced')",
    "wires": "s.Scene(actuator=s.SmaWires()).at('balanced')",
    "all terms": "scenes()[EVERYTHING]",
}
"""Scenes whose first strokes are timed, in Python."""


def process_seconds(before: str, timed: str, cache: str) -> float:
    """Processor time of code in a fresh interpreter [s]. cache: Folder of machine code, the user's own if empty."""
    code = f"import time; {before}; start = time.process_time(); {timed}; print(time.process_time() - start)"
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout)


def cold_start(seconds: float) -> Iterator[Row]:
    """Processor times of the import, of the first strokes ever, and of the first stroke of a later process."""
    with tempfile.TemporaryDirectory() as cache:
        yield row("import of seastar_gym, beyond Gymnasium's", "s", [process_seconds(*IMPORT, cache) for _ in range(5)])
    for name, scene in FIRST_SCENES.items():
        with tempfile.TemporaryDirectory() as cache:
            first, *later = (process_seconds(FIRST, SWIM.format(scene), cache) for _ in range(4))
        yield row(f"first stroke ever, {name}", "s", [first])
        yield row(f"first stroke of a process, {name}, warm cache", "s", later)


# Ten fixed things


@entry_point
def fused_products(values, n):  # type: ignore[no-untyped-def]
    """Compute n fused products in each of eight independent chains; values: Start and factors, shape (18, N_LANES)."""
    rows = borrow(values)
    c, d = load(rows, 16), load(rows, 17)
    x0, x1, x2, x3 = load(rows, 0), load(rows, 1), load(rows, 2), load(rows, 3)
    x4, x5, x6, x7 = load(rows, 4), load(rows, 5), load(rows, 6), load(rows, 7)
    for _ in range(n):
        x0, x1, x2, x3 = add_product(c, x0, d), add_product(c, x1, d), add_product(c, x2, d), add_product(c, x3, d)
        x4, x5, x6, x7 = add_product(c, x4, d), add_product(c, x5, d), add_product(c, x6, d), add_product(c, x7, d)
    store(rows, 0, x0 + x1 + x2 + x3 + x4 + x5 + x6 + x7)


def unit() -> float:
    """Processor time of the fixed loop [s]."""
    chains = np.full((18, N_LANES), 0.5)
    start = time.process_time()
    fused_products(chains, 20_000_000)
    return time.process_time() - start


def stroke_of(scene: Scene, n_robots: int) -> Clock:
    """Clock of a stroke of the straight swim on one core; one stroke has gone before."""
    swim = straight(scene, n_robots)
    swim()

    def seconds() -> float:
        start = time.process_time()
        swim()
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
    scene = "s.Scene(s.Seastar(nodes_per_limb=10), numerics=s.Numerics())"
    with tempfile.TemporaryDirectory() as cache:
        return process_seconds("pass", f"import seastar_gym as s; {SWIM.format(scene)}", cache)


def things() -> dict[str, tuple[int, Callable[[], Clock]]]:
    """What is timed, by name: how often, and how a clock of it is made."""
    cache = os.environ.get("NUMBA_CACHE_DIR", "")
    return {
        "first stroke ever": (1, lambda: first_stroke),
        "import": (5, lambda: lambda: process_seconds("pass", "import seastar_gym", cache)),
        "one robot, fast": (9, lambda: stroke_of(Scene.preset("fast"), 1)),
        **{f"512 robots, {name}": (5, partial(stroke_of, Scene.preset(name), BATCH)) for name in FIDELITIES},
        "all terms, 64 robots": (5, lambda: stroke_of(scenes()[EVERYTHING], 64)),
        "step of one environment, 0.2 s": (
            9, lambda: lambda: sum(step_of(environment("SeastarSwimTimedModerate-v0"), 100)),
        ),
        "training of 4,096 strokes": (1, lambda: training),
    }  # fmt: skip


def ratio(clock: Clock, rounds: int) -> float:
    """Median of a clock over the fixed loop just before and after it."""
    found = []
    for _ in range(rounds):
        before, seconds, after = unit(), clock(), unit()
        found.append(2.0 * seconds / (before + after))
    return rounded(statistics.median(found), 3)


def history() -> dict[str, float]:
    """Ratios of all things."""
    unit()
    found = {}
    for name, (rounds, clock) in things().items():
        found[name] = ratio(clock(), rounds)
        print(f"{name}: {found[name]:,.3g}", flush=True)
    return found


# The study


PARTS: dict[str, Callable[[float], Iterator[Row]]] = {"throughput": throughput, "start": cold_start}


@dataclass(frozen=True)
class Options:
    """Speed of the simulator on this machine."""

    also: tuple[str, ...] = ()
    """"throughput" and "start", the numbers of the page beside the history."""
    seconds: float = 1.0
    """For which a number of the throughput is measured, about."""

    def __post_init__(self) -> None:
        require_known("part", self.also, PARTS)


def run(options: Options, results: Results) -> None:
    """Time everything, and add a row."""
    found: dict[str, Any] = {name: value for name, value in provenance("").items() if name != "command"}
    words = ["git", "rev-parse", "--short", "HEAD"]  # says nothing outside a checkout
    found["commit"] = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()
    found["ratios"] = history()
    rows = [each for part in options.also for each in PARTS[part](options.seconds)]
    found["figures"] = {what: [unit, *(rounded(each) for each in numbers)] for what, unit, *numbers in rows}
    results.read()
    results.update(results.about)
    results.row(["runs"])[time.strftime("%Y-%m-%d %H:%M")] = found
    results.save()


def figures(results: Mapping[str, Any]) -> str:
    """Table in Markdown of throughput and start in the last run."""
    last = list(results["runs"].values())[-1].get("figures", {})
    rows = [
        (what, f"{middle:,.4g}", unit, f"{low:,.3g} to {high:,.3g}") for what, (unit, middle, low, high) in last.items()
    ]
    return markdown(["what", "median", "unit", "middle half"], rows, (0, 2))


def draw(results: Mapping[str, Any], path: Path) -> None:
    """Draw every thing as a bar: its time in the last run over that in the first."""
    runs = list(results["runs"].items())
    (first, before), (last, now) = runs[0], runs[-1]
    ratios = {name: now["ratios"][name] / value for name, value in before["ratios"].items() if name in now["ratios"]}
    figure, axes = subplots(1, 1, figsize=(7.2, 3.8))
    bars = axes.barh(list(ratios), list(ratios.values()), height=0.6)
    axes.bar_label(bars, fmt="%.2f", label_type="center", color="white", fontsize="small")
    axes.axvline(1.0, color=INK, lw=1.0)
    axes.grid(False, axis="y")
    axes.invert_yaxis()
    ends = (f"commit {run['commit']} of {date.split()[0]}" for date, run in ((last, now), (first, before)))
    axes.set(xlabel=" over ".join(ends), title="processor time, over that of the first run")
    save_figure(figure, path)


STUDY = Study(
    "benchmark", run, Options, "speed/speed_history.json", settings=lambda _: UNIT,
    pictures={"speed_history.png": draw}, tables={"speed figures": figures},
)  # fmt: skip
