"""Two wires per limb: their linear heating and cooling, and what they remember."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from seastar_gym import AlongLimb, Scene, Seastar, SmaLimb, SmaWires, ThermalSma
from seastar_gym.scene.actuators.base import check_actuator
from seastar_gym.scene.actuators.sma_limb import MEASURED
from studies.fit import curvature

WIRES = SmaWires()
PEAK = WIRES.peak_angle
SMALL = 1e-12


def march(wires: SmaWires, given: list[tuple[float, float]], dt: float = 1e-4):
    """By tiny steps, for every time [s], a whole multiple of dt, that a command is given for: contractions (x_+, x_-)
    half-way and at the end, seconds of heating that are left, and seconds of heating in it."""
    x, left = np.zeros(2), np.zeros(2)
    for gap, c in given:
        if c:
            left[0 if c > 0.0 else 1] = abs(c) * wires.heating_time
        marched, n, seconds = [x], round(gap / dt), 0.0
        for _ in range(n):
            heated = left > 0.5 * dt
            x = np.clip(x + dt * np.where(heated, 1.0 / wires.heating_time, -1.0 / wires.cooling_time), 0.0, 1.0)
            left, seconds = np.maximum(left - dt, 0.0), seconds + dt * heated.sum()
            marched.append(x)
        yield marched[n // 2], x, left, seconds


@pytest.mark.parametrize("seed", range(4))
def test_wires_heat_and_cool_as_a_march_of_tiny_steps(seed):
    """A warm wire is heated on, the other one goes on with its pulse, and any command but 0 replaces one before."""
    rng, state = np.random.default_rng(seed), np.zeros(4)
    given = list(zip(2 * rng.integers(1, 15, 12) / 100.0, rng.integers(-10, 11, 12) / 10.0, strict=True))
    given += [(0.04, 1.0), (0.04, 0.0), (0.06, -0.5), (0.02, 1.0), (0.2, 1.0)]
    for (gap, c), (middle, end, left, seconds) in zip(given, march(WIRES, given), strict=True):
        assert WIRES.seconds_heated(np.array([0.0, gap]), np.full((), c), state) == pytest.approx(seconds, abs=1e-9)
        turned, state = WIRES.respond(np.array([0.0, gap / 2, gap]), np.full((), c), state)
        np.testing.assert_allclose(state, [*end, *left], atol=1e-9)
        np.testing.assert_allclose(turned[1:] / PEAK, [middle[0] - middle[1], end[0] - end[1]], atol=1e-9)


def test_a_deaf_limb_ignores_commands_until_both_wires_are_cold():
    refractory, commands = SmaWires(refractory=True), np.array([-1.0, -1.0, -1.0])
    states = np.array([[0.2, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1e-3], [1e-17, 0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(refractory.refractory_wires(states), [[True, True], [True, True], [False, False]])
    assert not WIRES.refractory_wires(states).any()
    np.testing.assert_allclose(refractory.seconds_heated(np.array([0.0, 1.0]), commands, states), [0.0, 1e-3, 0.1])
    turned, _ = refractory.respond(np.array([0.0, 0.009]), commands, states)
    np.testing.assert_allclose(turned[1] / PEAK, [0.2 - 0.01, -0.01 + 0.008 / 0.9, -0.09], atol=SMALL)


# The thermal actuator: its heat, its hysteresis, and what a batch of robots remembers of it.


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


def test_the_hysteresis_loop_closes_and_is_passed_round_once():
    t, T, austenite = history(SLOW, 1.0)
    assert austenite[0] == 0.0 and austenite.max() == 1.0 and austenite[-1] == 0.0
    heating = t <= 5.0
    up = np.interp(T, [23.5, 70.5], [0.0, 1.0])
    down = np.interp(T, [21.5, 56.0], [0.0, 1.0])
    np.testing.assert_allclose(austenite[heating], up[heating], atol=1e-12)
    np.testing.assert_allclose(austenite[~heating], down[~heating], atol=1e-12)


def test_a_small_loop_within_the_large_one_closes_and_stays_inside_where_nothing_changes_between_the_lines():
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
    _, T, austenite = history(actuator, 0.0, np.array([45.0, 20.0, 0.5, 0.0, 0.0, 0.0]))
    still = austenite == 0.5  # between the lines
    assert still.any() and not still.all()
    assert T[still].min() == pytest.approx(21.5 + 0.5 * (56.0 - 21.5), abs=0.05)


# --- a largest temperature -------------------------------------------------------------------------------------------

LIMIT = 75.0
SAFE = ThermalSma(heating_time=0.1, cooling_time=0.1, largest_temperature=LIMIT)


def test_a_wire_that_is_heated_for_ever_stays_below_the_largest_temperature():
    t, free = np.linspace(0.0, 0.1, 101), replace(SAFE, largest_temperature=ThermalSma().largest_temperature)
    hottest = []
    for actuator in (SAFE, free):
        state = actuator.rest
        for _ in range(100):
            before, (_, state) = state, actuator.respond(t, np.ones(()), state)
        hottest.append(max(actuator.respond(t[: k + 1], np.ones(()), before)[1][0] for k in range(1, len(t))))
    assert LIMIT - 0.5 < hottest[0] <= LIMIT + 1e-9 and hottest[1] > 200.0


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


# The limb with measured curves: its heat, its delay, its presets, and what it makes of the chapter's commands.


LIMB = SmaLimb()


def periodic(limb: SmaLimb, n: int = 60) -> np.ndarray:
    """State of a limb after n strokes of command 1."""
    state = limb.rest
    for _ in range(n):
        _, state = limb.respond(np.array([0.0, limb.period]), np.ones(()), state)
    return state


@pytest.mark.parametrize("command", [1.0, 0.4, -0.7])
def test_temperature_solves_the_heat_equation_after_the_delay(command):
    wire, ends = (0 if command > 0 else 1), LIMB.delay + abs(command) * LIMB.heating_time
    steady = LIMB.rise / (1.0 - np.exp(-LIMB.heating_time / LIMB.time_constant))
    t, start = np.linspace(0.0, 1.0, 201), np.array([2.0, 2.0, 0.0, 0.0, 0.0, 0.0])

    def slope(now, theta):
        return (steady * (LIMB.delay < now < ends) - theta) / LIMB.time_constant

    solution = solve_ivp(slope, (0.0, 1.0), [2.0], t_eval=t, max_step=1e-4, rtol=1e-8)
    found = LIMB.temperatures(t, np.full((), command), start)
    np.testing.assert_allclose(found[:, wire], solution.y[0], atol=0.01)
    np.testing.assert_allclose(found[:, 1 - wire], 2.0 * np.exp(-t / LIMB.time_constant), rtol=1e-13)


@pytest.mark.parametrize("liquid_metal", MEASURED)
@pytest.mark.parametrize("frequency", [0.4, 1.1, 2.3])
def test_repeated_commands_tend_to_the_closed_form_of_the_periodic_state(liquid_metal, frequency):
    limb = SmaLimb.preset(liquid_metal, period=1.0 / frequency)
    t = np.linspace(0.0, limb.period, 50)
    found = limb.curvature(limb.temperatures(t, np.ones(()), periodic(limb))[:, 0])
    np.testing.assert_allclose(found, curvature(MEASURED[liquid_metal], frequency, t), rtol=1e-9)


def test_a_new_command_waits_no_longer():
    state = LIMB.rest
    for _ in range(10):  # intervals shorter than the delay
        _, state = LIMB.respond(np.array([0.0, 0.01]), np.ones(()), state)
    assert state[0] > LIMB.rise and state[2] == 0.0 and state[4] == pytest.approx(LIMB.heating_time - 0.01)
    commands = np.array([1.0, -0.3, 0.0])
    heated = LIMB.seconds_heated(np.array([0.0, 0.9]), commands, np.broadcast_to(LIMB.rest, (3, 6)))
    np.testing.assert_allclose(heated, np.abs(commands) * LIMB.heating_time, atol=1e-15)


@pytest.mark.parametrize("liquid_metal", MEASURED)
def test_presets_bend_by_what_was_measured_and_nearly_reach_their_peak_in_every_stroke(liquid_metal):
    limb = SmaLimb.preset(liquid_metal)
    check_actuator(limb)
    turned, _ = limb.respond(np.array([0.0, limb.delay + limb.heating_time]), np.ones(()), periodic(limb))
    assert 0.7 * limb.peak_angle < turned[-1] <= limb.peak_angle
    assert limb.share(np.zeros(2)).tolist() == [0.0, 0.0] and limb.curvature(np.zeros(())) == limb.rest_curvature
    change = MEASURED[liquid_metal].curvature_change
    assert SmaLimb.preset(liquid_metal, limb_length=0.03).peak_angle == pytest.approx(change * 0.03, rel=1e-15)
    each = SmaLimb.preset(liquid_metal, limb_length=np.array([0.01, 0.03]))
    assert Scene(Seastar(along=AlongLimb()), actuator=each).n_robots == 2
