"""Errors of timed commands: sequences are as said, errors fall with nodes, and the table is the whole study's."""

import json

import numpy as np
import pytest

from seastar_gym.scene.fidelity import TIMED_PRESETS, timed_promise
from seastar_gym.scene.numerics import Numerics
from studies.accuracy.timed import PERIODS, QUICK, SAMPLES, Plan, errors, sequences, table

TINY = QUICK._replace(samples=2, nodes=13, short=Numerics("implicit-midpoint", 2e-3, 1e-8))


def test_half_of_the_sequences_repeat_a_second():
    commands = sequences(0.2, TINY, np.random.default_rng(0))
    assert commands.shape == (10, 4, 5)
    repeats = (commands[:5] == commands[5:]).all(axis=(0, 2))
    np.testing.assert_array_equal(repeats, [False, False, True, True])
    whole = np.isin(commands, (-1.0, 0.0, 1.0)).all(axis=(0, 2))
    np.testing.assert_array_equal(whole, [True, False, True, False])
    assert np.abs(commands).max() <= 1.0


def test_more_nodes_err_less_in_space():
    ticks = []
    found = errors(0.5, TINY, lambda: ticks.append(1))
    assert len(ticks) == 3 and 0.0 < found["balanced"]["space_error"] < found["fast"]["space_error"] < 0.2
    assert all(0.0 < each["time_error"] < 0.2 for each in found.values())


def test_the_table_is_that_of_the_whole_study():
    stored = json.loads(TIMED_PRESETS.read_text())
    assert stored["measured_over"]["random"] == stored["measured_over"]["a repeated second"] == SAMPLES
    assert set(stored["presets"]) == set(Plan().presets)
    for name, rows in stored["presets"].items():
        assert set(rows) == {f"{period:g}" for period in PERIODS}
        for period in PERIODS:
            known = timed_promise(name, period)
            cell = f"{float(f'{100 * known.path_error:.2g}'):g}"
            assert f" {cell} |" in next(line for line in table(stored).splitlines() if f"`{name}`" in line)


@pytest.mark.parametrize("period", PERIODS)
def test_dearer_presets_err_less(period):
    paths = [timed_promise(name, period).path_error for name in ("fast", "balanced", "accurate", "reference")]
    assert paths == sorted(paths, reverse=True)
