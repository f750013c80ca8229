"""The clock counts intervals, keeps the time of those that failed, and can be put back."""

from fractions import Fraction

import numpy as np

from seastar_gym.simulator.clock import Clock

FAILED = np.array([False, True, False])
NONE = np.zeros(3, dtype=bool)
PERIOD = 0.1


def after(n_strokes: int) -> Clock:
    clock = Clock(3)
    for _ in range(n_strokes):
        clock.begin(PERIOD)
        clock.end(NONE, np.full(3, PERIOD))
    return clock


def test_time_is_a_multiple_of_the_period_without_accumulated_rounding():
    np.testing.assert_array_equal(after(1000).time, 1000 * PERIOD)
    assert sum([PERIOD] * 1000) != 1000 * PERIOD


def test_rounding_does_not_accumulate_over_intervals_of_changing_length():
    clock, durations = Clock(3), [0.3, 0.7, 0.1]
    for k in range(3000):
        clock.begin(durations[k % 3])
        clock.end(NONE, np.full(3, durations[k % 3]))
    exact = float(1000 * sum(map(Fraction, durations)))
    assert np.abs(clock.time - exact).max() <= 2.0 * np.spacing(exact)
    assert abs(sum(durations * 1000) - exact) > 10.0 * np.spacing(exact)


def test_time_within_a_stroke_is_what_has_been_covered():
    clock = after(2)
    clock.begin(PERIOD)
    clock.advance_to(np.array([0.01, 0.02, 0.03]))
    np.testing.assert_array_equal(clock.time, 2 * PERIOD + np.array([0.01, 0.02, 0.03]))
    clock.end(NONE, np.full(3, PERIOD))
    np.testing.assert_array_equal(clock.time, 3 * PERIOD)


def test_a_failed_stroke_counts_by_the_time_that_it_covered():
    clock = Clock(3)
    clock.begin(PERIOD)
    clock.end(FAILED, np.array([PERIOD, 0.03, PERIOD]))
    np.testing.assert_array_equal(clock.time, [PERIOD, 0.03, PERIOD])
    clock.begin(PERIOD)
    np.testing.assert_array_equal(clock.time, [PERIOD, 0.03, PERIOD])
    clock.end(FAILED, np.array([PERIOD, 0.0, PERIOD]))
    np.testing.assert_array_equal(clock.time, [2 * PERIOD, 0.03, 2 * PERIOD])


def test_time_is_set_for_the_chosen_robots_only():
    clock = after(3)
    clock.set(FAILED, 7.0)
    np.testing.assert_array_equal(clock.time, [3 * PERIOD, 7.0, 3 * PERIOD])
    clock.begin(PERIOD)
    clock.end(NONE, np.full(3, PERIOD))
    np.testing.assert_array_equal(clock.time, [4 * PERIOD, 7.0 + PERIOD, 4 * PERIOD])


def test_a_copy_keeps_its_time_and_puts_the_clock_back():
    clock = after(3)
    before = clock.copy()
    clock.begin(PERIOD)
    clock.advance_to(np.full(3, 0.05))
    np.testing.assert_array_equal(before.time, 3 * PERIOD)
    clock.restore(before)
    np.testing.assert_array_equal(clock.time, before.time)
    clock.advance_to(np.full(3, 0.05))
    np.testing.assert_array_equal(before.time, 3 * PERIOD)
