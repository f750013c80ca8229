"""The study of the speed of sweeps."""

from importlib.util import find_spec

import pytest

if find_spec("pyarrow") is None:
    pytest.skip("the extra sweep is not installed", allow_module_level=True)

from seastar_gym.sweep.executors.here import Here
from studies.speed.sweeps import nothing, seconds_per_cell, sweep_of


def test_time_is_counted_per_cell_after_the_start():
    sweep = sweep_of(5, 2, 1)
    assert sweep.n_cells == 5
    per_cell, start = seconds_per_cell(sweep, Here(), nothing)
    assert per_cell > 0.0 and start > 0.0
