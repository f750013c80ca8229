"""Errors of timed commands: sequences are as said, errors fall with nodes, and the table is the whole study's."""

import numpy as np
import pytest

from seastar_gym import Scene
from seastar_gym.accuracy import timed_certificate
from seastar_gym.accuracy.chapter import FOLDER, file_of
from seastar_gym.accuracy.measure import path_lengths
from seastar_gym.scene.numerics import PRESETS, Numerics
from studies.accuracy.page import PERIODS
from studies.accuracy.timed import SAMPLES, SLOWEST, Plan, errors, sequences, setting

TINY = Plan(2, 2, 13, Numerics("implicit-midpoint", 2e-3, 1e-8), ("fast", "balanced"))


def test_half_of_the_sequences_repeat_a_second():
    commands = sequences(0.2, TINY, np.random.default_rng(0))
    assert commands.shape == (10, 4, 5)
    repeats = (commands[:5] == commands[5:]).all(axis=(0, 2))
    np.testing.assert_array_equal(repeats, [False, False, True, True])
    whole = np.isin(commands, (-1.0, 0.0, 1.0)).all(axis=(0, 2))
    np.testing.assert_array_equal(whole, [True, False, True, False])
    assert np.abs(commands).max() <= 1.0


def test_more_nodes_err_less_in_space():
    shares = []
    found = errors(0.5, TINY, shares.append)
    assert shares[-1] == pytest.approx(1.0)
    assert 0.0 < found["balanced"].space_error < found["fast"].space_error < 0.2
    for name, each in found.items():
        assert each.resolution == PRESETS[name] and 0.0 < each.time_error < 0.2
        assert each.errors["random"] == each.space_error + each.time_error
        assert all(0.0 < each.typical[kind] <= error for kind, error in each.errors.items())


def test_random_and_repeated_commands_are_bounded_apart():
    space, time = np.array([0.01, 0.03, 0.02, 0.5, 0.4, 0.1]), np.array([0.02, 0.01, 0.01, 0.1, 0.3, 0.1])
    found = setting(PRESETS["fast"], space, time)
    assert (found.space_error, found.time_error) == (0.03, 0.02)
    assert found.errors == {"random": 0.05, "repeated": 0.8} and found.typical == {"random": 0.03, "repeated": 0.6}


def test_a_path_that_goes_nowhere_counts_as_a_slow_one():
    hub = np.zeros((10, 2, 2))
    hub[:, 1, 0] = 0.02 * np.arange(1, 11)
    np.testing.assert_allclose(path_lengths(Scene(), hub, 10 * SLOWEST), [10 * SLOWEST * 0.1, 0.2])


@pytest.mark.parametrize("period", PERIODS)
def test_the_certificate_is_that_of_the_whole_study(period):
    stored = timed_certificate(period)
    assert stored.decision_period == period and stored.samples == SAMPLES
    assert stored.measured_over["random"] == stored.measured_over["a repeated second"] == SAMPLES
    assert [each.resolution for each in stored.settings] == [PRESETS[name] for name in Plan().presets]


def test_the_times_between_decisions_that_ship_are_those_of_the_study():
    assert {*FOLDER.glob("wires_*")} == {*map(file_of, PERIODS)}


@pytest.mark.parametrize("period", PERIODS)
def test_dearer_presets_err_less(period):
    for kind in ("random", "repeated"):
        for column in ("errors", "typical"):
            found = [getattr(each, column)[kind] for each in timed_certificate(period).settings[:4]]
            assert found == sorted(found, reverse=True), (column, kind)
