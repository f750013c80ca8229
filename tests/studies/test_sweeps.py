"""The study of the speed of sweeps."""

from importlib.util import find_spec

import pytest

if find_spec("pyarrow") is None:
    pytest.skip("the extra sweep is not installed", allow_module_level=True)

from seastar_gym.executors.here import Here
from studies.speed.sweeps import cluster, disk_wait, overhead, reckon, seconds_per_cell, sweep_of


def test_overhead_and_simulation_are_processor_times_of_a_cell():
    sweep = sweep_of(5, 2, 1)
    assert sweep.n_batches == 5
    empty, swum = overhead(sweep, Here()), seconds_per_cell(sweep, Here())
    assert 0.0 < empty < 0.1 and swum > 0.0
    assert disk_wait(b"part", 3) < 10.0


def test_a_cluster_is_reckoned_with_what_ray_costs_where_that_was_measured():
    found = {
        "overhead of a cell on processes [ms]": 0.5, "overhead of a cell on Ray [ms]": 1.5,
        "wait for the disk per cell [ms]": 0.5, "strokes per second, processes: 2": 10_000.0,
    }  # fmt: skip
    single = reckon(found, 2)["a cell of 1 design and 10 strokes"]
    assert single == cluster(10_000.0, 2, 2e-3, 10)
    del found["overhead of a cell on Ray [ms]"]
    assert reckon(found, 2)["a cell of 1 design and 10 strokes"] == cluster(10_000.0, 2, 1e-3, 10)


def test_a_cluster_is_as_fast_as_its_workers_until_one_process_cannot_give_more():
    large = cluster(rate=10_000.0, workers=2, overhead=1e-3, strokes=10_000)
    assert large["strokes per second"] == 64 * 10_000.0 and large["nodes kept busy"] == 64.0
    assert large["time of a cell [s]"] == 2.0
    small = cluster(rate=10_000.0, workers=2, overhead=1e-3, strokes=10)
    assert small["strokes per second"] == 10_000.0 and small["nodes kept busy"] == 1.0
    enough = cluster(10_000.0, 2, 1e-3, round(small["strokes of a cell that keeps all nodes busy"]))
    assert enough["nodes kept busy"] == 64.0
