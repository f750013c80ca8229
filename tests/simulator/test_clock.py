"""Time is counted without drift, and no time step straddles a corner of the pulse."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse
from seastar_gym.envs.robots import first_after
from seastar_gym.simulator.drive import interval_times, step_times
from seastar_gym.simulator.simulator import completed, pausing

CHAPTER = (0.0, 0.1, 1.0)
durations = st.floats(1e-3, 10.0)


@pytest.mark.parametrize("intervals, ulps", [([0.1], 0.0), ([0.1 + 0.2], 0.0), ([0.3, 0.7, 0.1], 2.0)])
def test_rounding_of_time_does_not_accumulate_over_intervals_equal_or_not(intervals, ulps):
    simulator = Simulator(Scene(Seastar(1, 2), None, SmaPulse(0.0), Numerics("implicit-euler", 1.0)))
    for duration in intervals * 1000:
        simulator.advance(duration)
    exact = 1000 * intervals[0] if len(intervals) == 1 else float(1000 * sum(map(Fraction, intervals)))
    assert abs(simulator.time[0] - exact) <= ulps * np.spacing(exact)
    assert abs(sum(intervals * 1000) - exact) > 10.0 * np.spacing(exact)


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


def test_steps_of_an_interval_are_those_of_the_whole_and_one_of_its_ends_cuts_a_step_in_two():
    whole = step_times(CHAPTER, 0.03)
    np.testing.assert_array_equal(interval_times(CHAPTER, 0.03, 0.0, 1.0), whole)
    pieces = [interval_times(CHAPTER, 0.03, begin, 0.1) for begin in np.arange(10) / 10]
    seen = np.unique(np.round(np.concatenate(pieces), 12))
    assert set(np.round(whole, 12)) <= set(seen) and len(seen) <= len(whole) + 9
    on_grid = [*interval_times(CHAPTER, 0.01, 0.0, 0.1 + 0.2), *interval_times(CHAPTER, 0.01, 0.1 + 0.2, 0.7)[1:]]
    np.testing.assert_array_equal(on_grid, step_times(CHAPTER, 0.01))
    for begin, duration in ((0.0, 0.25), (0.07, 0.4), (0.0, 3.0), (0.99, 0.4)):
        times = interval_times(CHAPTER, 0.03, begin, duration)
        assert times[0] == begin and times[-1] == pytest.approx(begin + duration)
        assert (np.diff(times) > 0.0).all() and np.diff(times).max() <= 0.03 + 1e-12
        assert all(corner in times for corner in (0.1, 1.0) if begin < corner < begin + duration)


# Intervals that pause are seen at every pause, return what they return, and are closed whatever happens.


def interval(closed):
    """Pauses at 1, 2 and 3; notes that it was closed."""
    try:
        yield from (1.0, 2.0, 3.0)
    finally:
        closed.append(True)
    return "report"


def test_an_interval_is_seen_at_every_pause_and_closed_by_its_end_with_its_pauses_and_by_what_goes_wrong():
    seen, closed = [], []
    assert completed(interval(closed), seen.append) == "report" and seen == [1.0, 2.0, 3.0] and closed == [True]
    assert list(pausing(interval([]), lambda time: 10.0 * time if time != 2.0 else None)) == [10.0, 30.0]
    pauses = pausing(interval(closed), float)
    next(pauses)
    pauses.close()
    for run in (completed, lambda *given: list(pausing(*given))):
        with pytest.raises(ZeroDivisionError):
            run(interval(closed), lambda time: 1 / 0)
    assert closed == [True] * 4


@pytest.mark.parametrize(
    "ends, expected", [([], []), ([1.5, 3.0], [2.0, 3.0]), ([0.5, 0.6, 1.0], [1.0]), ([2.0 + 1e-10], [2.0])]
)
def test_the_first_time_after_each_end_is_yielded(ends, expected):
    assert list(pausing(interval([]), first_after(ends))) == expected
