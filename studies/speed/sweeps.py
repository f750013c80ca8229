"""Speed of sweeps on this machine: strokes per second over the number of processes, and the overhead of a cell.

The overhead is what a cell costs besides its simulation: making, naming, sending and writing it. It is measured with
cells that simulate nothing. From both follows what a cluster of such machines would do: it is as fast as its workers
together until one process cannot give and write more cells a second.
"""

import json
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from seastar_gym.command import run_command
from seastar_gym.executors import Executor
from seastar_gym.executors.here import Here
from seastar_gym.executors.processes import Processes
from seastar_gym.extras import require_extra
from seastar_gym.scene import Scene
from seastar_gym.sweep.axes import Range
from seastar_gym.sweep.cells import Cell
from seastar_gym.sweep.designs import Sweep
from seastar_gym.sweep.parts import part_of
from seastar_gym.sweep.run import run
from studies.parser import study_parser
from studies.speed.timing import machine

require_extra("Sweeps", "sweep", "pyarrow")

LENGTHS = Range("robot.limb_length", 0.05, 0.15)


def nothing(cell: Cell) -> bytes:
    """A part without a simulation."""
    return cell.name.encode()


def sweep_of(n_cells: int, robots: int, measured: int) -> Sweep:
    """Sweep of so many cells of so many robots, of as many strokes."""
    axes = (LENGTHS.spaced(n_cells * robots),)
    return Sweep(Scene.preset("fast"), axes, settling=0, measured=measured, robots=robots)


def seconds_per_cell(
    sweep: Sweep, executor: Executor, work: Callable[[Cell], bytes] = part_of, warm: int = 2
) -> tuple[float, float]:
    """Time per cell [s] once the workers have started, and until then [s]. warm: Cells until then."""
    ends: list[float] = []
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        run(sweep.cells(), folder, executor, lambda tally: ends.append(time.perf_counter()), work)
    return (ends[-1] - ends[warm - 1]) / (len(ends) - warm), ends[warm - 1] - begin


def measure(n_cells: int, robots: int, strokes: int, workers: tuple[int, ...]) -> dict[str, Any]:
    """All figures. n_cells, robots, strokes: Of the sweep that is simulated."""
    empty = sweep_of(20 * n_cells, 64, 1)
    found: dict[str, Any] = {
        "machine": machine(),
        "overhead of a cell in this process [ms]": 1e3 * seconds_per_cell(empty, Here(), nothing)[0],
        "overhead of a cell on one process [ms]": 1e3 * seconds_per_cell(empty, Processes(1), nothing)[0],
    }
    if find_spec("ray") is not None:
        from seastar_gym.executors.on_ray import RayTasks

        found["overhead of a cell on Ray [ms]"] = 1e3 * seconds_per_cell(empty, RayTasks(workers=1), nothing)[0]
    for n in workers:
        sweep = sweep_of(n_cells * n, robots, strokes)
        seconds, start = seconds_per_cell(sweep, Processes(n), warm=n)
        found[f"strokes per second, {n} processes"] = robots * strokes / seconds
        found[f"start of {n} processes [s]"] = start
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


def reckon(found: dict[str, Any], workers: int, ray: bool) -> dict[str, object]:
    """Figures of a cluster, from the measured ones."""
    overhead = 1e-3 * found["overhead of a cell on Ray [ms]" if ray else "overhead of a cell on one process [ms]"]
    rate = found[f"strokes per second, {workers} processes"]
    return {name: cluster(rate, workers, overhead, strokes) for name, strokes in CELLS.items()}


def main() -> None:
    """Command line: measure and print."""
    parser = study_parser("studies.speed.sweeps", __doc__)
    parser.add_argument("--out", type=Path, help="JSON file for the figures")
    parser.add_argument("--quick", action="store_true", help="fewer cells")
    options = parser.parse_args()
    found = measure(4 if options.quick else 20, 64 if options.quick else 512, 10, (1, 2))
    found[f"reckoned: {NODES} such nodes"] = reckon(found, 2, "overhead of a cell on Ray [ms]" in found)
    text = json.dumps(found, indent=1)
    print(text)
    if options.out is not None:
        options.out.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    run_command(main)
