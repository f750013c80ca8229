"""Memory of a sweep over the number of its cells: what planning holds, and how it grows while cells are done.

Cells are of one robot each. Without --simulate they are planned, named, sent to processes and written as always, and
nothing is simulated in between.
"""

import json
import resource
import tempfile
import tracemalloc
from pathlib import Path

from seastar_gym.command import run_command
from seastar_gym.executors import Executor, Work
from seastar_gym.executors.processes import Processes
from seastar_gym.extras import require_extra
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_count
from seastar_gym.sweep.axes import Range
from seastar_gym.sweep.cells import Cell
from seastar_gym.sweep.designs import Sweep
from seastar_gym.sweep.parts import part_of
from seastar_gym.sweep.run import Tally, run
from studies.parser import study_parser
from studies.provenance import provenance
from studies.speed.sweeps import nothing

require_extra("Sweeps", "sweep", "pyarrow")

MEGABYTE = 1e6
AXES = (
    Range("robot.limb_length", 0.05, 0.15), Range("robot.density", 500.0, 2000.0),
    Range("actuator.peak_angle", 0.1, 0.6),
)  # fmt: skip


def grid(n_cells: int) -> Sweep:
    """Grid of three axes, of n_cells cells at least and of one robot each."""
    side = 1
    while side ** len(AXES) < n_cells:
        side += 1
    axes = tuple(axis.spaced(max(2, side)) for axis in AXES)
    return Sweep(Scene.preset("fast"), axes, settling=0, measured=1, robots=1)


def latin(n_cells: int) -> Sweep:
    """Latin hypercube of so many cells."""
    return Sweep(Scene.preset("fast"), AXES, settling=0, measured=1, samples=n_cells, robots=1)


def one_axis(n_cells: int) -> Sweep:
    """Grid of one axis of so many values, which are a tuple."""
    return Sweep(Scene.preset("fast"), (AXES[0].spaced(n_cells),), settling=0, measured=1, robots=1)


PLANS = {"grid of three axes": grid, "Latin hypercube of three ranges": latin, "grid of one axis": one_axis}


def planned(plan: str, n_cells: int, named: int) -> float:
    """Most memory that a plan of so many cells holds [MB], while the first of them are named."""
    tracemalloc.start()
    try:
        for _, cell in zip(range(named), PLANS[plan](n_cells).cells(), strict=False):
            assert cell.name
        return tracemalloc.get_traced_memory()[1] / MEGABYTE
    finally:
        tracemalloc.stop()


def resident() -> float:
    """Memory of this process now [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / MEGABYTE


def growth(n_cells: int, executor: Executor, folder: Path, work: Work[Cell] = nothing) -> list[tuple[int, float]]:
    """Cells done and memory of this process [MB], ten times on the way through a sweep."""
    sweep, found = grid(n_cells), list[tuple[int, float]]()

    def watch(tally: Tally) -> None:
        if tally.done >= (len(found) + 1) * sweep.n_cells // 10:
            found.append((tally.done, round(resident(), 1)))

    run(sweep.cells(), folder, executor, watch, work)
    return found


def main() -> None:
    """Command line: measure and print."""
    parser = study_parser("studies.speed.sweep_memory", __doc__)
    parser.add_argument("--cells", type=int, default=1_000_000, help="cells of the sweep (default: %(default)s)")
    parser.add_argument("--simulate", action="store_true", help="simulate a stroke of each")
    parser.add_argument("--plan-only", action="store_true", help="run no cells")
    parser.add_argument("--out", type=Path, help="JSON file for the figures")
    options = parser.parse_args()
    require_count("--cells", options.cells, 10, 100_000_000)
    found: dict[str, object] = {**provenance("python -m studies.speed.sweep_memory"), "cells": options.cells}
    found["planning holds [MB]"] = {
        plan: round(planned(plan, options.cells, min(options.cells, 10_000)), 1) for plan in PLANS
    }
    if not options.plan_only:
        with tempfile.TemporaryDirectory() as folder:
            found["cells done, resident [MB]"] = growth(
                options.cells, Processes(), Path(folder), part_of if options.simulate else nothing
            )
    text = json.dumps(found, indent=1)
    print(text)
    if options.out is not None:
        options.out.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    run_command(main)
