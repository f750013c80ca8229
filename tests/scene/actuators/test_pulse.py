"""The pulse is the ramp of Fig. 13.5b."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import oracle
from seastar_gym import SmaPulse
from seastar_gym.scene.actuators.pulse import pulse

CHAPTER = (0.0, 0.1, 1.0)
durations = st.floats(1e-3, 10.0)


def test_pulse_rises_while_heated_and_falls_while_cooling():
    times = np.array([0.0, 0.025, 0.05, 0.1, 0.55, 0.775, 1.0])
    np.testing.assert_allclose(pulse(times, 0.1, 0.9), [0.0, 0.25, 0.5, 1.0, 0.5, 0.25, 0.0], rtol=0.0, atol=1e-15)


def test_pulse_is_exact_at_its_corners_and_that_of_the_oracle_between_them():
    actuator = SmaPulse()
    assert actuator.corners == CHAPTER and actuator.period == 1.0
    assert actuator.delta_psi(CHAPTER).tolist() == [0.0, np.pi / 5, 0.0]
    times = np.linspace(0.0, 0.999, 1000)
    np.testing.assert_allclose(actuator.delta_psi(times), [oracle.pulse(t) for t in times], rtol=0.0, atol=1e-15)


@given(durations, durations, st.lists(st.floats(-20.0, 40.0), min_size=1, max_size=20))
def test_pulse_stays_between_zero_and_one_whatever_the_time(heating_time, cooling_time, times):
    share = pulse(times, heating_time, cooling_time)
    assert share.shape == (len(times),)
    assert np.all((share >= 0.0) & (share <= 1.0))


def test_pulse_takes_numbers_and_arrays_of_any_shape():
    assert SmaPulse().delta_psi(0.05) == pytest.approx(np.pi / 10)
    assert SmaPulse().delta_psi(np.zeros((2, 3))).shape == (2, 3)
