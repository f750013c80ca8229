"""The thermal actuator: its heat, its hysteresis, and what a batch of robots remembers of it."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from seastar_gym import Numerics, Scene, Simulator, SmaPulse, ThermalSma
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from studies.scenes import thermal

SCENE = Scene(actuator=ThermalSma(), numerics=Numerics("implicit-midpoint", 0.01))
SLOW = ThermalSma(heating_time=5.0, cooling_time=20.0)
"""Heats and cools all the way."""


def history(actuator, command, state=None, n=2001):
    """Times, temperatures of the + wire and its shares of austenite during a stroke."""
    t = np.linspace(0.0, actuator.period, n)
    state = actuator.rest if state is None else state
    states = np.array([actuator.respond(t[: k + 1], np.full((), command), state)[1] for k in range(n)])
    return t, states[:, 0], states[:, 2]


@pytest.mark.parametrize("command", [1.0, 0.4, 0.0, -1.0])
def test_temperature_solves_the_heat_equation(command):
    actuator = ThermalSma()
    heated = max(command, 0.0) * actuator.heating_time

    def slope(t, T):
        power = actuator.steady_rise if t < heated else 0.0
        return (power - (T - actuator.water_temperature)) / actuator.time_constant

    start = np.array([35.0, 20.0, 0.25, 0.0, 0.0, 0.0])
    t, found, _ = history(actuator, command, start, n=201)
    ends = [0.0, *([heated] if heated else []), 1.0]
    expected, T = [35.0], 35.0
    for begin, end in pairwise(ends):
        inside = t[(t > begin) & (t <= end)]
        solution = solve_ivp(slope, (begin, end - 1e-12), [T], t_eval=inside - 1e-12, rtol=1e-10, atol=1e-10)
        expected += solution.y[0].tolist()
        T = expected[-1]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_temperature_is_the_exact_exponential():
    t, T, _ = history(SLOW, 1.0)
    hot, tau = 20.0 + 220.0, 0.42
    heating = t <= 5.0
    np.testing.assert_allclose(T[heating], hot - 220.0 * np.exp(-t[heating] / tau), rtol=1e-13)
    cooling = 20.0 + (T[heating][-1] - 20.0) * np.exp(-(t[~heating] - 5.0) / tau)
    np.testing.assert_allclose(T[~heating], cooling, rtol=1e-13)


def test_the_hysteresis_loop_closes_and_is_passed_round_once():
    t, T, austenite = history(SLOW, 1.0)
    assert austenite[0] == 0.0 and austenite.max() == 1.0 and austenite[-1] == 0.0
    heating = t <= 5.0
    up = np.interp(T, [23.5, 70.5], [0.0, 1.0])
    down = np.interp(T, [21.5, 56.0], [0.0, 1.0])
    np.testing.assert_allclose(austenite[heating], up[heating], atol=1e-12)
    np.testing.assert_allclose(austenite[~heating], down[~heating], atol=1e-12)


def test_a_small_loop_within_the_large_one_closes_and_stays_inside():
    actuator, state = ThermalSma(), ThermalSma().rest
    t = np.linspace(0.0, 1.0, 101)
    for _ in range(30):
        before = state
        _, state = actuator.respond(t, np.full((), 0.3), before)
    np.testing.assert_allclose(state, before, atol=1e-10)  # heat of strokes past is forgotten
    _, T, austenite = history(actuator, 0.3, state, n=201)
    assert 0.0 < np.ptp(austenite) < 0.5
    assert (austenite >= np.interp(T, [23.5, 70.5], [0.0, 1.0]) - 1e-12).all()
    assert (austenite <= np.interp(T, [21.5, 56.0], [0.0, 1.0]) + 1e-12).all()


def test_between_the_lines_the_share_of_austenite_stands_still():
    _, T, austenite = history(ThermalSma(), 0.0, np.array([45.0, 20.0, 0.5, 0.0, 0.0, 0.0]))
    still = austenite == 0.5
    assert still.any() and not still.all()
    assert T[still].min() == pytest.approx(21.5 + 0.5 * (56.0 - 21.5), abs=0.05)


def test_a_full_command_comes_near_the_pulse_and_the_defaults_are_as_near_as_a_fit():
    for turned in thermal.misfit(ThermalSma()):
        assert np.sqrt(np.mean(turned**2)) < 0.07 and np.abs(turned).max() < 0.17
    assert np.sum(thermal.misfit(ThermalSma()) ** 2) < 1.01 * np.sum(thermal.misfit(thermal.fit()) ** 2)
    assert "default: tau = 0.420 s" in thermal.describe("default", ThermalSma())
    assert ThermalSma().delta_psi([[0.0, 0.1]]).shape == (1, 2)


def test_the_study_draws_its_picture(tmp_path):
    thermal.draw(ThermalSma(), tmp_path / "thermal.png")
    assert (tmp_path / "thermal.png").stat().st_size > 10_000


def test_the_other_wire_turns_the_other_way_while_the_first_is_still_warm():
    actuator, t = ThermalSma(), np.array([0.0, 0.1])
    _, state = actuator.respond(np.array([0.0, 0.1, 1.0]), np.ones(()), actuator.rest)
    turned, after = actuator.respond(t, np.full((), -1.0), state)
    assert turned[0] == pytest.approx(actuator.peak_angle * state[2]) and state[2] > 0.05
    assert turned[1] == pytest.approx(actuator.peak_angle * (after[2] - after[3])) and turned[1] < -0.3


def test_robots_swim_and_cool_down_and_are_cold_after_a_reset():
    simulator = Simulator(SCENE, 2)
    for _ in range(2):
        report = simulator.stroke([[0, 1, 0, 0, -1], [0, 0.5, 0, 0, 0]])
        assert not report.status.any()
    state = simulator.get_state()
    assert state.actuators.shape == (2, 5, 6)
    assert state.actuators[0, 1, 0] > 25.0 and state.actuators[0, 4, 1] > 25.0 and state.actuators[0, 1, 1] == 20.0
    assert state.actuators[0, 1, 0] > state.actuators[1, 1, 0] > 20.0  # half the pulse, less heat
    assert simulator.hub_position()[0, 0] > 5e-3
    simulator.stroke(np.zeros((2, 5)))
    simulator.reset(np.array([True, False]))
    np.testing.assert_array_equal(simulator.actuators[0], np.tile(ThermalSma().rest, (5, 1)))
    assert simulator.actuators[1, 1, 0] > 20.0


def test_it_swims_about_as_far_as_the_pulse():
    hubs = []
    for actuator in (ThermalSma(), SmaPulse()):
        simulator = Simulator(Scene(actuator=actuator, numerics=SCENE.numerics))
        for _ in range(5):
            simulator.stroke([[0, 1, 0, 0, -1]])
        hubs.append(simulator.hub_position()[0, 0])
    assert hubs[0] == pytest.approx(hubs[1], rel=0.2)


def test_temperatures_are_observed():
    env = SeastarSwimEnv(scene=SCENE)
    first, _ = env.reset(seed=0)
    assert first.size == 186 + 20 == env.observation_space.shape[0]
    observation, *_ = env.step([1, 0, 0, 0, 0])
    seen = observation[-24:-4].reshape(5, 4)
    assert 0.0 < seen[0, 0] < 1.0 and 0.0 < seen[0, 2] < 1.0 and not seen[1:].any()


# --- a largest temperature -------------------------------------------------------------------------------------------

LIMIT = 75.0
SAFE = ThermalSma(heating_time=0.1, cooling_time=0.1, largest_temperature=LIMIT)


def test_a_wire_that_is_heated_for_ever_stays_below_the_largest_temperature():
    state, t, hottest = SAFE.rest, np.linspace(0.0, 0.05, 51), 0.0
    for _ in range(100):
        for begin in (0.0, 0.05):
            temperature = [SAFE.respond(begin + t[: k + 1], np.ones(()), state)[1][0] for k in range(1, len(t))]
            hottest = max(hottest, *temperature)
            _, state = SAFE.respond(begin + t, np.ones(()), state)
    assert LIMIT - 0.5 < hottest <= LIMIT + 1e-9
    free = ThermalSma(heating_time=0.1, cooling_time=0.1).rest
    for _ in range(100):
        _, free = ThermalSma(heating_time=0.1, cooling_time=0.1).respond(t, np.ones(()), free)
    assert free[0] > 200.0


def test_heating_ends_exactly_where_the_limit_is_reached():
    hot, start = 240.0, 60.0
    time = 0.42 * np.log((hot - start) / (hot - LIMIT))  # of (hot - T) falling to (hot - LIMIT)
    state = np.array([start, 20.0, 0.5, 0.0, 0.0, 0.0])
    assert SAFE.seconds_heated(np.array([0.0, 0.2]), np.ones(()), state) == pytest.approx(time, rel=1e-12)
    _, at_limit = SAFE.respond(np.array([0.0, time]), np.ones(()), state)
    assert at_limit[0] == pytest.approx(LIMIT, rel=1e-14) and at_limit[4] == 0.0
    np.testing.assert_array_equal(SAFE.refractory_wires(np.stack([state, at_limit])), [[False, False], [True, False]])
    _, after = SAFE.respond(np.array([0.0, time + 0.03]), np.ones(()), state)
    assert after[0] == pytest.approx(20.0 + (LIMIT - 20.0) * np.exp(-0.03 / 0.42), rel=1e-12)


def test_a_limit_that_is_never_reached_changes_no_bit():
    t, commands = np.linspace(0.0, 1.0, 51), np.array([1.0, 0.3, -1.0, 0.0])
    for limit in (100.0, 240.0, 1000.0):
        one, other = ThermalSma(), ThermalSma(largest_temperature=limit)
        rest = np.tile(one.rest, (4, 1))
        for seen, wanted in zip(other.respond(t, commands, rest), one.respond(t, commands, rest), strict=True):
            np.testing.assert_array_equal(seen, wanted)


@pytest.mark.parametrize(
    "change",
    [
        {"water_temperature": 22.0}, {"austenite_start": 80.0}, {"martensite_start": 80.0}, {"martensite_finish": 24.0},
        {"time_constant": 0.9e-3}, {"largest_temperature": 20.0},
    ],
)  # fmt: skip
def test_wires_that_cannot_be_are_refused(change):
    with pytest.raises(ValueError, match=r"\.$"):
        ThermalSma(**change)
