"""Two wires per limb: their linear heating and cooling, and what they remember."""

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Limited, SmaPulse, SmaWires, ThermalSma
from seastar_gym.scene.actuators.actuator import check_actuator

WIRES = SmaWires()
PEAK = WIRES.peak_angle
SMALL = 1e-12


def march(wires: SmaWires, given: list[tuple[float, float]], until: float, dt: float = 1e-4) -> np.ndarray:
    """Contractions (x_+, x_-) at the end, by tiny steps. given: Times [s] and commands, whole multiples of dt."""
    x, left, due = np.zeros(2), np.zeros(2), {round(t / dt): c for t, c in given}
    for k in range(round(until / dt)):
        c = due.get(k, 0.0)
        if c:
            left[0 if c > 0.0 else 1] = abs(c) * wires.heating_time
        heated = left > 0.5 * dt
        x = np.clip(x + dt * np.where(heated, 1.0 / wires.heating_time, -1.0 / wires.cooling_time), 0.0, 1.0)
        left = left - dt
    return x


@pytest.mark.parametrize("heating, cooling", [(0.1, 0.9), (1 / 7, 6 / 7), (0.3, 0.1)])
def test_a_full_command_from_rest_is_the_pulse_to_the_bit(heating, cooling):
    wires, pulse = SmaWires(0.6, heating, cooling), SmaPulse(0.6, heating, cooling)
    t = np.linspace(0.0, 1.1 * pulse.period, 1001)
    assert wires.period == pulse.period and wires.corners == pulse.corners
    np.testing.assert_array_equal(wires.delta_psi(t), pulse.delta_psi(t))
    turned, after = wires.respond(t, np.array([1.0, 0.0, -1.0]), np.zeros((3, 4)))
    np.testing.assert_array_equal(turned, np.multiply.outer(pulse.delta_psi(t), [1.0, 0.0, -1.0]))
    assert not after.any()


@pytest.mark.parametrize("seed", range(4))
def test_wires_heat_and_cool_as_a_march_of_tiny_steps(seed):
    rng = np.random.default_rng(seed)
    gaps, commands = rng.integers(2, 30, 12) / 100.0, rng.integers(-10, 11, 12) / 10.0
    state, t, given_at = np.zeros(4), 0.0, []
    for gap, c in zip(gaps, commands, strict=True):
        given_at.append((t, c))
        _, state = WIRES.respond(np.array([0.0, gap]), np.full((), c), state)
        t += gap
    np.testing.assert_allclose(state[:2], march(WIRES, given_at, t), atol=1e-9)


def test_a_warm_wire_is_heated_on_and_stays_contracted_when_it_is_full():
    t = np.array([0.0, 0.05, 0.1, 0.55])
    turned, after = WIRES.respond(t, np.full((), 1.0), np.array([0.5, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(turned / PEAK, [0.5, 1.0, 1.0, 0.5])
    np.testing.assert_allclose(after, [0.5, 0.0, 0.0, 0.0])


def test_the_other_wire_goes_on_with_its_pulse():
    _, state = WIRES.respond(np.array([0.0, 0.04]), np.full((), 1.0), np.zeros(4))
    np.testing.assert_allclose(state, [0.4, 0.0, 0.06, 0.0])
    turned, state = WIRES.respond(np.array([0.0, 0.05, 0.06, 0.15]), np.full((), -0.5), state)
    np.testing.assert_allclose(turned / PEAK, [0.4, 0.9 - 0.5, 1.0 - (0.5 - 1 / 90), 0.9 - (0.5 - 10 / 90)])
    np.testing.assert_allclose(state, [0.9, 0.5 - 10 / 90, 0.0, 0.0], atol=SMALL)


def test_no_command_leaves_a_pulse_alone_and_a_new_one_replaces_it():
    _, state = WIRES.respond(np.array([0.0, 0.04]), np.full((), 1.0), np.zeros(4))
    for c, left in ((0.0, 0.06), (0.2, 0.02), (1.0, 0.1)):
        assert WIRES.seconds_heated(np.array([0.0, 1.0]), np.full((), c), state) == pytest.approx(left)


def test_a_deaf_limb_ignores_commands_until_both_wires_are_cold():
    refractory, commands = SmaWires(refractory=True), np.array([-1.0, -1.0, -1.0])
    states = np.array([[0.2, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1e-3], [1e-17, 0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(refractory.refractory_wires(states), [[True, True], [True, True], [False, False]])
    assert not WIRES.refractory_wires(states).any()
    np.testing.assert_allclose(refractory.seconds_heated(np.array([0.0, 1.0]), commands, states), [0.0, 1e-3, 0.1])
    turned, _ = refractory.respond(np.array([0.0, 0.009]), commands, states)
    np.testing.assert_allclose(turned[1] / PEAK, [0.2 - 0.01, -0.01 + 0.008 / 0.9, -0.09], atol=SMALL)


def test_heating_is_counted_in_seconds():
    t = np.array([0.02, 0.05, 0.5])
    commands, none = np.array([1.0, -0.5, 0.0]), np.zeros((3, 0))
    np.testing.assert_allclose(SmaPulse().seconds_heated(t, commands, none), [0.08, 0.04, 0.0])
    np.testing.assert_allclose(WIRES.seconds_heated(t - 0.02, commands, np.zeros((3, 4))), [0.1, 0.05, 0.0])
    np.testing.assert_allclose(Limited(SmaPulse(), 0.1).seconds_heated(t, commands, none), [0.08, 0.04, 0.0])
    assert Limited(SmaPulse(heating_power=3.0)).heating_power == 3.0


def test_all_wires_have_the_same_power_that_of_the_wire_in_the_docstring():
    heat_capacity = 6450.0 * 460.0 * np.pi / 4.0 * 0.25e-3**2 * 0.1
    thermal = ThermalSma()
    power = heat_capacity * thermal.steady_rise / thermal.time_constant
    assert power == pytest.approx(thermal.heating_power, rel=0.01)
    assert SmaPulse().heating_power == WIRES.heating_power == thermal.heating_power


@pytest.mark.parametrize("period", [0.05, 0.5, 1.0, 2.0])
def test_corners_are_those_of_the_wire_whatever_the_period(period):
    wires = SmaWires(period=period)
    assert set(wires.corners) == {0.0, 0.1, 1.0, period} and wires.period == period
    check_actuator(wires)
    assert SmaWires(heating_time=0.1, cooling_time=0.2, period=0.3).corners == (0.0, 0.1, 0.3)


@pytest.mark.parametrize(
    "change",
    [{"refractory": 1}, {"period": None, "heating_time": 1e308, "cooling_time": 1e308}],
)  # fmt: skip
def test_wires_that_cannot_be_are_refused(change):
    with assert_refused(next(iter(change))):
        SmaWires(**change)
