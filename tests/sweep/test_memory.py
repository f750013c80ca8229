"""Memory of a sweep does not grow with the number of its batches, neither while planned nor while they are done."""

import resource
import tracemalloc
from pathlib import Path

import pytest

pytest.importorskip("pyarrow")

from seastar_gym.executors.processes import Processes
from seastar_gym.scene import Scene
from seastar_gym.sweep.axes import Range
from seastar_gym.sweep.designs import Sweep
from seastar_gym.sweep.run import run

AXES = (
    Range("robot.limb_length", 0.05, 0.15), Range("robot.density", 500.0, 2000.0),
    Range("actuator.peak_angle", 0.1, 0.6),
)  # fmt: skip
ONE_ROBOT = {"settling": 0, "measured": 1, "robots": 1}
MEGABYTE = 1e6


def grid(n_batches):
    """Grid of three axes, of n_batches batches at least and of one robot each."""
    axes = tuple(axis.spaced(round(n_batches ** (1 / 3)) + 1) for axis in AXES)
    return Sweep(Scene.preset("fast"), axes, **ONE_ROBOT)


def latin(n_batches):
    return Sweep(Scene.preset("fast"), AXES, samples=n_batches, **ONE_ROBOT)


def one_axis(n_batches):
    return Sweep(Scene.preset("fast"), (AXES[0].spaced(n_batches),), **ONE_ROBOT)


def planned(plan, n_batches, named):
    """Most memory that a plan of so many batches holds [MB], while the first of them are named."""
    tracemalloc.start()
    try:
        for _, batch in zip(range(named), plan(n_batches).batches(), strict=False):
            assert batch.name
        return tracemalloc.get_traced_memory()[1] / MEGABYTE
    finally:
        tracemalloc.stop()


def resident():
    """Memory of this process now [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / MEGABYTE


def nothing(batch):
    """A part without a simulation."""
    return batch.name.encode()


def test_planning_a_grid_holds_the_same_for_any_number_of_cells():
    few, many = planned(grid, 1_000, 500), planned(grid, 1_000_000, 2_000)
    assert grid(1_000_000).n_batches >= 1_000_000
    assert many < few + 1.0 < 10.0


@pytest.mark.parametrize("plan", [grid, latin, one_axis])
def test_planning_holds_less_than_a_kilobyte_for_ten_cells(plan):
    assert planned(plan, 100_000, 200) < 10.0 + 100_000 / 10 / 1000


@pytest.mark.slow
def test_a_sweep_of_a_hundred_thousand_cells_does_not_grow(tmp_path):
    sweep, found = grid(100_000), []

    def watch(tally):
        if tally.done >= (len(found) + 1) * sweep.n_batches // 10:
            found.append(resident())

    run(sweep.batches(), tmp_path, Processes(2), watch, nothing)
    assert len(found) == 10 and found[-1] < found[0] + 20.0
