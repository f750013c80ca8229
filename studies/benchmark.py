"""Speed: throughput of strokes and environments, cold start, and eleven things beside another checkout.

    git worktree add ../before 055100c4
    python -m studies.benchmark --beside ../before  # a row of the history: eleven things here and there
    python -m studies.benchmark                     # the numbers of docs/speed.md

A run adds a row with its date to `speed_history.json`. Both checkouts take turns, and the least processor time of each
counts: what else a machine does slows either. Other numbers are medians, with the range of the middle half.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from seastar_gym.files import save_figure
from seastar_gym.gaits import STRAIGHT
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator, StrokeReport
from studies.frame import Results, Study, commit_of, require_known, rounded
from studies.operations import count_operations, flops
from studies.pages import markdown
from studies.style import INK, subplots

ROOT = Path(__file__).resolve().parents[1]
FIDELITIES: tuple[Fidelity, ...] = ("fast", "balanced", "accurate", "reference")
NODES_PER_LIMB = (5, 10, 20, 40, 80, 160, 320, 640)
"""Nodes per limb over which the cost is measured."""
BATCH = 512
"""Robots of a batch."""
ENVIRONMENTS = {"SeastarSwim-v0": "strokes of 1 s", "SeastarSwimTimedModerate-v0": "decisions of 0.2 s"}
NEIGHBOURS = {"Swimmer-v5": "0.04 s", "HalfCheetah-v5": "0.05 s"}
"""Environments of MuJoCo, timed where it is installed, and how long a decision is."""
Row = tuple[str, list[Any]]
"""What a number is; its unit, its median, and the range of the middle half of its repeats."""


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
    return what, [unit, *map(rounded, np.percentile(values, [50, 25, 75]))]


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


def steps_per_second(env: Any, n: int) -> float:
    """Random steps per second of processor time, mean of n."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(n)]
    env.step(actions[0])
    start = time.thread_time()
    for action in actions:
        env.step(action)
    return n / (time.thread_time() - start)


def environment(id: str, n_robots: int | None = None) -> Any:
    """One environment at `fast`, or a batch on one core, whose episodes do not end."""
    options: dict[str, Any] = {"fidelity": "fast", "max_episode_steps": 10**9, "path": [[10.0, 0.0], [10.0, 10.0]]}
    if n_robots is None:
        return gym.make(id, **options)
    return gym.make_vec(id, n_robots, vectorization_mode="vector_entry_point", threads=1, **options)


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
    for id, what in ENVIRONMENTS.items():
        for n_robots in (None, BATCH):
            env, n = environment(id, n_robots), max(3, int(seconds * (20 if n_robots else 200)))
            rates = [(n_robots or 1) * steps_per_second(env, n) for _ in range(5)]
            env.close()
            yield row(f"decisions of {n_robots or 'one'}, fast, {what}", "1/s", rates)
    for id, what in NEIGHBOURS.items() if find_spec("mujoco") else ():
        env = gym.make(id, max_episode_steps=10**9)
        rates = [steps_per_second(env, max(3, int(2000 * seconds))) for _ in range(5)]
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


def run_in(checkout: Path, words: Sequence[str], cache: str) -> str:
    """What Python prints in a checkout. cache: Folder of machine code, the user's own if empty."""
    where = {**os.environ, "NUMBA_CACHE_DIR": cache, "PYTHONPATH": str(checkout)}
    done = subprocess.run([sys.executable, *words], cwd=checkout, env=where, capture_output=True, text=True, check=True)
    return done.stdout


def process_seconds(before: str, timed: str, cache: str, repeats: int = 1, checkout: Path = ROOT) -> float:
    """Least processor time of code, of some repeats in one fresh interpreter [s]. before: Code that is not timed."""
    code = f"""import time; found = []; {before}
for _ in range({repeats}):
    start = time.process_time(); {timed}; found.append(time.process_time() - start)
print(min(found))"""
    return float(run_in(checkout, ["-c", code], cache).split()[-1])


def cold_start(seconds: float) -> Iterator[Row]:
    """Processor times of the import, of the first strokes ever, and of the first stroke of a later process."""
    with tempfile.TemporaryDirectory() as cache:
        yield row("import of seastar_gym, beyond Gymnasium's", "s", [process_seconds(*IMPORT, cache) for _ in range(5)])
    for name, scene in FIRST_SCENES.items():
        with tempfile.TemporaryDirectory() as cache:
            first, *later = (process_seconds(FIRST, SWIM.format(scene), cache) for _ in range(4))
        yield row(f"first stroke ever, {name}", "s", [first])
        yield row(f"first stroke of a process, {name}, warm cache", "s", later)


# History

SWIM_OF = "swim = s.Simulator({0}, {1}, threads=1).stroke; commands = [[0.0, 1.0, 0.0, 0.0, -1.0]] * {1}"
STEP_OF = (
    "import gymnasium as gym; env = gym.make('{}', fidelity='fast', max_episode_steps=10**9, path=[[10.0, 0.0], "
    "[10.0, 10.0]]); env.reset(seed=0); env.action_space.seed(0)"
)
TRAINING = "train.py --strokes 4096 --no-video --num-threads 1 --out {}"
ROUNDS, MANY = 2, 9
"""Times that two checkouts take turns, and those of things that take a second or two."""
SWIMS: dict[str, tuple[Fidelity, int, int]] = {
    "one robot, fast": ("fast", 1, 100),
    "9 robots, fast": ("fast", 9, 30),
    **{f"{BATCH} robots, {name}": (name, BATCH, n) for name, n in zip(FIDELITIES, (4, 3, 1, 1), strict=True)},
}
"""Strokes that are timed in two checkouts: fidelity, robots, and how many after a first one."""
Clock = Callable[[Path, str], float]
"""Processor time in a checkout [s], with the code in a folder."""


def training(checkout: Path, cache: str) -> float:
    """Processor time of a training of 4,096 strokes with its comparison in a checkout [s]."""
    with tempfile.TemporaryDirectory() as folder:
        before = os.times()
        run_in(checkout, TRAINING.format(Path(folder, "run")).split(), cache)
        after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def first_stroke(checkout: Path, cache: str) -> float:
    """Processor time of the first stroke ever in a checkout, with import and compilation [s]."""
    swim = SWIM.format("s.Scene(s.Seastar(nodes_per_limb=10), numerics=s.Numerics())")
    with tempfile.TemporaryDirectory() as empty:
        return process_seconds("pass", f"import seastar_gym as s; {swim}", empty, checkout=checkout)


def repeated(before: str, timed: str, repeats: int) -> Clock:
    """Clock of code, the least of some repeats after a first time. before: What it needs."""
    setup = f"import seastar_gym as s; {before}; {timed}"
    return lambda checkout, cache: process_seconds(setup, timed, cache, repeats, checkout)


def things() -> dict[str, tuple[int, Clock]]:
    """What is timed in two checkouts: how often they take turns, and its clock."""
    found: dict[str, tuple[int, Clock]] = {
        "first stroke ever": (1, first_stroke),
        "import": (MANY, lambda checkout, cache: process_seconds("pass", "import seastar_gym", cache, 1, checkout)),
    }
    for name, (fidelity, n_robots, repeats) in SWIMS.items():
        swim = repeated(SWIM_OF.format(f"s.Scene.preset('{fidelity}')", n_robots), "swim(commands)", repeats)
        found[name] = MANY if repeats > 10 else ROUNDS, swim
    for id, what in ENVIRONMENTS.items():
        step = repeated(STEP_OF.format(id), "env.step(env.action_space.sample())", 200)
        found[f"one environment, {what}"] = MANY, step
    return found | {"training of 4,096 strokes": (ROUNDS, training)}


def history(beside: Path) -> dict[str, list[float]]:
    """Least processor times in another checkout and in this one [s], by what is timed."""
    found = {}
    with tempfile.TemporaryDirectory() as other, tempfile.TemporaryDirectory() as own:
        for name, (rounds, clock) in things().items():
            turns = [(clock(beside, other), clock(ROOT, own)) for _ in range(rounds)]
            found[name] = [rounded(min(times)) for times in zip(*turns, strict=True)]
            print(f"{name}: {found[name][0]:,.3g} and {found[name][1]:,.3g} s", flush=True)
    return found


PARTS: dict[str, Callable[[float], Iterator[Row]]] = {"throughput": throughput, "start": cold_start}


@dataclass(frozen=True)
class Options:
    """Speed of the simulator on this machine."""

    beside: Path | None = None
    """Another checkout, beside which eleven things are timed, instead of the numbers of the page."""
    parts: tuple[str, ...] = tuple(PARTS)
    """Which numbers of the page are measured."""
    seconds: float = 1.0
    """For which a number of the throughput is measured, about."""

    def __post_init__(self) -> None:
        require_known("part", self.parts, PARTS)
        if self.beside is not None and not (self.beside / "train.py").is_file():
            raise ValueError(f"{self.beside} is no checkout of the project: it has no train.py.")


def run(options: Options, results: Results) -> None:
    """Time what is asked for, and add a row."""
    found: dict[str, Any] = {name: value for name, value in results.about.items() if name != "command"}
    found["commit"] = commit_of(ROOT)
    if options.beside is not None:
        found["beside"], found["seconds"] = commit_of(options.beside), history(options.beside.resolve())
    else:
        found["figures"] = dict(row for part in options.parts for row in PARTS[part](options.seconds))
    results.read()
    results.update(results.about)
    results.row(["runs"])[time.strftime("%Y-%m-%d %H:%M")] = found
    results.save()


def figures(results: Mapping[str, Any]) -> str:
    """Table in Markdown of throughput and start in the last run."""
    last = ([{}] + [run["figures"] for run in results["runs"].values() if "figures" in run])[-1]
    rows = [(what, f"{mid:,.4g}", unit, f"{low:,.3g} to {high:,.3g}") for what, (unit, mid, low, high) in last.items()]
    return markdown(["what", "median", "unit", "middle half"], rows, (0, 2))


def draw(results: Mapping[str, Any], path: Path) -> None:
    """Draw every thing as a bar: its time in the last row of the history over that in the other checkout."""
    paired = [(date, one) for date, one in results["runs"].items() if "beside" in one]
    if not paired:
        return
    date, last = paired[-1]
    ratios = {name: here / there for name, (there, here) in last["seconds"].items()}
    figure, axes = subplots(1, 1, figsize=(7.2, 3.8))
    bars = axes.barh(list(ratios), list(ratios.values()), height=0.6)
    axes.bar_label(bars, fmt="%.2f", label_type="center", color="white", fontsize="small")
    axes.axvline(1.0, color=INK, lw=1.0)
    axes.grid(False, axis="y")
    axes.invert_yaxis()
    title = f"processor time of commit {last['commit']} over that of {last['beside']}"
    axes.set(xlabel=f"ratio, {date.split()[0]}", title=title)
    save_figure(figure, path)


STUDY = Study(
    "benchmark", run, Options, "speed/speed_history.json", pictures={"speed_history.png": draw},
    tables={"speed figures": figures},
)  # fmt: skip
