"""The limb with measured curves: its heat, its delay, its presets, and what it makes of the chapter's commands."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from refusals import assert_refused
from seastar_gym import AlongLimb, Numerics, Scene, Seastar, Simulator, SmaLimb
from seastar_gym.scene.actuators.actuator import check_actuator
from seastar_gym.scene.actuators.sma_limb import MEASURED
from studies.measurements.model import curvature

LIMB = SmaLimb()
END = LIMB.delay + LIMB.heating_time


def periodic(limb: SmaLimb, n: int = 60) -> np.ndarray:
    """State of a limb after n strokes of command 1."""
    state = limb.rest
    for _ in range(n):
        _, state = limb.respond(np.array([0.0, limb.period]), np.ones(()), state)
    return state


def test_a_limb_of_some_length_bends_by_the_measured_change_of_curvature():
    limb = SmaLimb.preset(20, limb_length=0.03)
    assert limb.peak_angle == pytest.approx(MEASURED[20].curvature_change * 0.03, rel=1e-15)
    scene = Scene(Seastar(along=AlongLimb()), actuator=SmaLimb.preset(20, limb_length=np.array([0.01, 0.03])))
    assert scene.n_robots == 2


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


def test_a_full_pulse_lifts_a_cold_wire_by_the_rise():
    heated = LIMB.temperatures(np.array([0.0, END]), np.ones(()), LIMB.rest)
    assert heated[-1].tolist() == pytest.approx([LIMB.rise, 0.0], rel=1e-12)


@pytest.mark.parametrize("liquid_metal", MEASURED)
@pytest.mark.parametrize("frequency", [0.4, 1.1, 2.3])
def test_repeated_commands_tend_to_the_closed_form_of_the_periodic_state(liquid_metal, frequency):
    limb = SmaLimb.preset(liquid_metal, period=1.0 / frequency)
    t = np.linspace(0.0, limb.period, 50)
    numbers = {"width" if n == "heating_time" else n: x for n, x in MEASURED[liquid_metal]._asdict().items()}
    found = limb.curvature(limb.temperatures(t, np.ones(()), periodic(limb))[:, 0])
    np.testing.assert_allclose(found, curvature(numbers, frequency, t), rtol=1e-9)


def test_a_new_command_waits_no_longer():
    state = LIMB.rest
    for _ in range(10):  # intervals shorter than the delay
        _, state = LIMB.respond(np.array([0.0, 0.01]), np.ones(()), state)
    assert state[0] > LIMB.rise and state[2] == 0.0 and state[4] == pytest.approx(LIMB.heating_time - 0.01)
    commands = np.array([1.0, -0.3, 0.0])
    heated = LIMB.seconds_heated(np.array([0.0, 0.9]), commands, np.broadcast_to(LIMB.rest, (3, 6)))
    np.testing.assert_allclose(heated, np.abs(commands) * LIMB.heating_time, atol=1e-15)


@pytest.mark.parametrize("liquid_metal", MEASURED)
def test_presets_nearly_reach_their_peak_in_every_stroke_and_can_be_written(liquid_metal):
    limb = SmaLimb.preset(liquid_metal)
    check_actuator(limb)
    scene = Scene(actuator=limb)
    assert Scene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene
    turned, _ = limb.respond(np.array([0.0, limb.delay + limb.heating_time]), np.ones(()), periodic(limb))
    assert 0.7 * limb.peak_angle < turned[-1] <= limb.peak_angle
    assert limb.share(np.zeros(2)).tolist() == [0.0, 0.0] and limb.curvature(np.zeros(())) == limb.rest_curvature


@pytest.mark.parametrize("duration", [0.015, 0.25])
def test_a_robot_swims_with_intervals_of_any_length_and_forgets_on_reset(duration):
    simulator = Simulator(Scene(actuator=LIMB, numerics=Numerics("implicit-midpoint", 0.01)), 2)
    for _ in range(4):
        assert not simulator.advance(duration, np.array([[0, 1, 0, 0, -1], [0, 0.5, 0, 0, 0]])).status.any()
    assert simulator.actuators[0, 1, 0] >= simulator.actuators[1, 1, 0] > 0.0 == simulator.actuators[0, 0, 0]
    simulator.reset()
    assert not simulator.actuators.any()


@pytest.mark.parametrize(
    "change",
    [{"heating_time": 1e3}, {"time_constant": 1e9}],
)  # fmt: skip
def test_limbs_that_cannot_be_are_refused(change):
    with assert_refused("heating_time"):
        replace(LIMB, **change)


def test_a_material_that_was_not_measured_is_refused():
    with assert_refused("0, 10, 20, 30, 40, 50 % of liquid metal"):
        SmaLimb.preset(15)
