"""No time step straddles a corner of the pulse."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import oracle
from hubs import TEN
from seastar_gym import Numerics, Scene, Simulator
from seastar_gym.simulator.schedule import step_times

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
