"""Speed of sweeps on this machine: strokes per second over the number of processes, and the overhead of a cell.

The overhead is what a cell costs the process that gives the cells: making, naming, sending and writing it. It is
measured with cells that simulate nothing, on each executor. From both follows what a cluster of such machines would do:
it is as fast as its workers together until that one process cannot give and write more cells a second.

Times are processor times, and so those of a machine without other work; only the wait for the disk is by the clock.
"""

import json
import statistics
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from seastar_gym.executors import Executor
from seastar_gym.executors.here import Here
from seastar_gym.executors.processes import Processes
from seastar_gym.extras import require_extra
from seastar_gym.scene import Scene
from seastar_gym.sweep.axes import Range
from seastar_gym.sweep.batches import Batch
from seastar_gym.sweep.designs import Sweep
from seastar_gym.sweep.result_files import ResultFiles, result_file_of
from seastar_gym.sweep.run import run
from studies.frame import Results, Study
from studies.pages import markdown

require_extra("Sweeps", "sweep", "pyarrow")

LENGTHS = Range("robot.limb_length", 0.05, 0.15)
WARM = 2


def nothing(cell: Batch) -> bytes:
    """A part without a simulation."""
    return cell.name.encode()


def sweep_of(n_batches: int, robots: int, measured: int) -> Sweep:
    """Sweep of so many cells of so many robots, of as many strokes."""
    axes = (LENGTHS.spaced(n_batches * robots),)
    return Sweep(Scene.preset("fast"), axes, settling=0, measured=measured, robots=robots)


def timed(cell: Batch) -> bytes:
    """The processor time that a cell takes [s], as text."""
    begin = time.process_time()
    result_file_of(cell)
    return str(time.process_time() - begin).encode()


def overhead(sweep: Sweep, executor: Executor) -> float:
    """Processor time of this process for a cell that simulates nothing [s]; the first WARM do not count."""
    ends: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        run(sweep.batches(), folder, executor, lambda tally: ends.append(time.process_time()), nothing)
    return (ends[-1] - ends[WARM - 1]) / (len(ends) - WARM)


def seconds_per_cell(sweep: Sweep, executor: Executor) -> float:
    """Processor time of a worker for a cell [s], the median: first cells of workers, which load the code, are few."""
    with tempfile.TemporaryDirectory() as folder:
        run(sweep.batches(), folder, executor, work=timed)
        parts = ResultFiles(folder)
        return statistics.median(float(parts.file(name).read_text()) for name in parts.names())


def disk_wait(part: bytes, n: int = 50) -> float:
    """Time for which a process waits for the disk when it writes a part [s], the median of n."""
    waits: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(n):
            clock, work = time.perf_counter(), time.process_time()
            ResultFiles(folder).write(f"{k:040x}", part)
            waits.append(time.perf_counter() - clock - (time.process_time() - work))
    return statistics.median(waits)


def measure(n_batches: int, robots: int, strokes: int, workers: tuple[int, ...]) -> dict[str, Any]:
    """All figures. n_batches, robots, strokes: Of the sweep that is simulated, by each worker."""
    empty = sweep_of(20 * n_batches, 64, 1)
    executors: dict[str, Callable[[], Executor]] = {"in this process": Here, "on processes": lambda: Processes(1)}
    if find_spec("ray") is not None:
        from seastar_gym.executors.on_ray import RayTasks

        executors["on Ray"] = lambda: RayTasks(workers=1)
    found: dict[str, Any] = {
        f"overhead of a cell {name} [ms]": 1e3 * overhead(empty, make()) for name, make in executors.items()
    }
    found["wait for the disk per cell [ms]"] = 1e3 * disk_wait(result_file_of(next(sweep_of(1, robots, 1).batches())))
    for n in workers:
        seconds = seconds_per_cell(sweep_of(n_batches * n, robots, strokes), Processes(n))
        found[f"strokes per second, processes: {n}"] = n * robots * strokes / seconds
    return found


NODES = 64
"""Nodes of the cluster that is reckoned with, each as this machine is."""
CELLS = {"a cell of 1 design and 10 strokes": 10, "of 256 designs and 10 strokes": 2560, "of 427 and 8": 3416}
"""Strokes of cells: a single robot, the command's default, and the study of designs."""


def cluster(rate: float, workers: int, overhead: float, strokes: int) -> dict[str, float]:
    """What NODES nodes would do.

    rate: Strokes per second of a node. workers: Of a node. overhead: Time that the process that gives the cells needs
    for one [s]. strokes: Of a cell.
    """
    together, given = NODES * rate, strokes / overhead
    return {
        "strokes per second of all workers": together,
        "strokes per second that one process can give": given,
        "strokes per second": min(together, given),
        "nodes kept busy": min(float(NODES), given / rate),
        "time of a cell [s]": strokes / (rate / workers),
        "strokes of a cell that keeps all nodes busy": together * overhead,
    }


def reckon(found: dict[str, Any], workers: int) -> dict[str, object]:
    """Figures of a cluster, from the measured ones. Its cells are given on Ray where that was measured."""
    name = "overhead of a cell on Ray [ms]"
    own = found[name if name in found else "overhead of a cell on processes [ms]"]
    seconds = 1e-3 * (own + found["wait for the disk per cell [ms]"])
    rate = found[f"strokes per second, processes: {workers}"]
    return {name: cluster(rate, workers, seconds, strokes) for name, strokes in CELLS.items()}


def table(found: dict[str, Any]) -> str:
    """Table in Markdown of what NODES nodes would do with cells of several sizes."""
    rows = []
    for name, row in found[f"reckoned: {NODES} such nodes"].items():
        limit = "the workers" if row["nodes kept busy"] >= NODES else "the process that hands out batches"
        rows.append([
            name.removeprefix("a cell "), f"{row['time of a cell [s]']:.2g}", f"{row['nodes kept busy']:.2g}",
            f"{round(row['strokes per second'], -2):,.0f}", limit,
        ])  # fmt: skip
    return markdown(["batch", "its time [s]", "nodes busy", "strokes per second", "limit"], rows, (0, 4))


def run_cells(results: Results) -> None:
    """Measure, and reckon a cluster."""
    results.update(measure(10, 256, 10, (1, 2)))
    results[f"reckoned: {NODES} such nodes"] = reckon(results, 2)
    print(json.dumps(results, indent=1))


STUDY = Study("speed.sweeps", run_cells, file="speed/sweeps.json", out=Path("runs/sweeps"), tables={"sweeps": table})
