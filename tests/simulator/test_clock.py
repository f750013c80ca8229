"""The clock counts intervals, keeps the time of those that failed, and can be put back."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import oracle
from hubs import TEN
from seastar_gym import Numerics, Scene, Simulator
from seastar_gym.simulator.clock import Clock
from seastar_gym.simulator.schedule import step_times

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


def test_what_a_clock_shows_can_be_kept_and_puts_it_back():
    clock = after(3)
    before = dict(vars(clock))
    for _ in range(2):
        clock.begin(2 * PERIOD)
        clock.advance_to(np.full(3, 0.05))
        clock.end(FAILED, np.full(3, 0.07))
        clock.set(FAILED, 5.0)
        assert (clock.time != 3 * PERIOD).all()
        vars(clock).update(before)
        np.testing.assert_array_equal(clock.time, 3 * PERIOD)


# No time step straddles a corner of the pulse.


CHAPTER = (0.0, 0.1, 1.0)
durations = st.floats(1e-3, 10.0)


@pytest.mark.parametrize("step, n_heating, n_cooling", [(0.01, 10, 90), (0.003, 34, 300), (0.02, 5, 45), (0.25, 1, 4)])
def test_a_stroke_takes_as_few_steps_as_its_corners_allow(step, n_heating, n_cooling):
    times = step_times(CHAPTER, step)
    assert len(times) == n_heating + n_cooling + 1
    assert np.searchsorted(times, 0.1) == n_heating


@pytest.mark.parametrize("step", [1.0 / 3.0, 0.1, 0.05, 0.03, 0.003, 0.001, 0.0007, 1e-4])
def test_steps_are_those_of_the_oracle(step):
    starts, lengths = np.array(oracle.stroke_steps(step)).T
    times = step_times(CHAPTER, step)
    np.testing.assert_allclose(times[:-1], starts, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(np.diff(times), lengths, rtol=0.0, atol=1e-13)


@given(durations, durations, st.floats(1e-3, 20.0))
def test_steps_end_on_every_corner_are_equal_and_only_the_last_before_a_corner_is_shorter(heating, cooling, step):
    corners = (0.0, heating, heating + cooling)
    assume((heating + cooling) / step < 1e4)
    times = step_times(corners, step)
    lengths = np.diff(times)
    assert set(corners) <= set(times.tolist())
    assert np.all(lengths > 0.0)
    assert np.all(lengths <= step * (1.0 + 1e-8))
    before_corner = np.isin(times[1:], corners)
    np.testing.assert_allclose(lengths[~before_corner], step, rtol=1e-9, atol=1e-14)
    assert before_corner.sum() == 2


@given(st.integers(1, 1000), st.integers(1, 1000), st.floats(1e-4, 0.1))
def test_a_step_that_divides_the_ramps_up_to_rounding_leaves_no_sliver(n_heating, n_cooling, step):
    heating, cooling = n_heating * step, n_cooling * step
    times = step_times((0.0, heating, heating + cooling), step)
    assert len(times) == n_heating + n_cooling + 1
    np.testing.assert_allclose(np.diff(times), step, rtol=1e-8)


@pytest.mark.parametrize("scheme", ["implicit-euler", "sdirk2", "sdirk3", "implicit-midpoint"])
def test_a_step_longer_than_the_ramps_still_sees_both_corners(scheme):
    """The robot ends where it ends with steps of exactly the ramps' lengths."""
    ends = []
    for step in (0.9, 5.0):
        simulator = Simulator(Scene(TEN, numerics=Numerics(scheme, step)))
        report = simulator.stroke([[0.0, 0.5, 0.0, 0.0, -0.5]])
        assert report.covered[0] == pytest.approx(1.0)
        ends.append(simulator.positions)
    np.testing.assert_array_equal(*ends)
