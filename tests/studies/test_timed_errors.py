"""Errors of timed commands: sequences are as said, errors fall with nodes, and the table is the whole study's."""

import json

import numpy as np
import pytest

from seastar_gym.scene.fidelity import TIMED_PRESETS, timed_promise
from seastar_gym.scene.numerics import Numerics
from studies.accuracy.timed import PERIODS, QUICK, SAMPLES, SLOWEST, Plan, errors, path_lengths, sequences, summary

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
    for each in found.values():
        assert 0.0 < each["typical_error"] <= each["space_error"] + each["time_error"]
        assert 0.0 < each["typical_gait_error"] <= each["gait_error"]


def test_random_and_repeated_commands_are_bounded_apart():
    space, time = np.array([0.01, 0.03, 0.02, 0.5, 0.4, 0.1]), np.array([0.02, 0.01, 0.01, 0.1, 0.3, 0.1])
    found = summary(space, time, 3)
    assert found == pytest.approx(
        {"space_error": 0.03, "time_error": 0.02, "gait_error": 0.8, "typical_error": 0.03, "typical_gait_error": 0.6}
    )


def test_a_path_that_goes_nowhere_counts_as_a_slow_one():
    hub = np.zeros((10, 2, 2))
    hub[:, 1, 0] = 0.02 * np.arange(1, 11)
    np.testing.assert_allclose(path_lengths(hub, 0.1), [10 * SLOWEST * 0.1, 0.2])


def test_the_table_is_that_of_the_whole_study():
    stored = json.loads(TIMED_PRESETS.read_text())
    assert stored["measured_over"]["random"] == stored["measured_over"]["a repeated second"] == SAMPLES
    assert set(stored["presets"]) == set(Plan().presets)
    assert all(set(rows) == {f"{period:g}" for period in PERIODS} for rows in stored["presets"].values())


@pytest.mark.parametrize("period", PERIODS)
def test_dearer_presets_err_less(period):
    rows = [timed_promise(name, period) for name in ("fast", "balanced", "accurate", "reference")]
    for column in ("path_error", "gait_error", "typical_error", "typical_gait_error"):
        found = [getattr(row, column) for row in rows]
        assert found == sorted(found, reverse=True), column
