"""Time in seconds: intervals of any length, what goes on in them, what they cost, and what is refused."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from refusals import assert_refused
from seastar_gym import (
    Body,
    Limited,
    MeasuredCurve,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaLimb,
    SmaPulse,
    SmaWires,
    ThermalSma,
    Water,
)
from seastar_gym.simulator.drive import step_times
from seastar_gym.simulator.wires import contracted
from strokes import assert_same, finished, ternary

FAST = Scene.preset("fast")
TIGHT = replace(FAST, numerics=Numerics("implicit-midpoint", 0.01, newton_tolerance=1e-11))
CURVE = MeasuredCurve((0.0, 0.13, 0.4, 1.0), (0.0, 0.5, -0.2, 0.0))
MEMORY = {
    "wires": SmaWires(),
    "refractory": SmaWires(refractory=True, cooling_time=0.3),
    "thermal": ThermalSma(),
    "hot": ThermalSma(0.6, 0.1, 0.1, largest_temperature=60.0),
    "limited": Limited(SmaPulse(), largest_rate=2.0),
    "measured limb": SmaLimb(heating_time=0.1, delay=0.02),
}
ALL = {"pulse": SmaPulse(), "curve": CURVE, **MEMORY}
LEFT_RIGHT = np.array([[0.0, 1.0, 0.0, 0.0, -1.0]])
HALF = np.array([[0.3, 0.5, 0.0, -0.7, -1.0]])


def scene_with(actuator, scene: Scene = FAST) -> Scene:
    return replace(scene, actuator=actuator)


@given(st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from([0.0, 0.07]))
def test_wires_are_compiled_to_the_bits_of_their_methods(seed, refractory, begin):
    """For any wires, commands that are new or not, and states of two robots."""
    rng = np.random.default_rng(seed)
    heating_time, cooling_time = rng.choice([0.1, 0.05, *rng.uniform(1e-3, 1.0, 2)], 2)
    peaks = rng.uniform(0.0, 1.0, 2) if rng.random() < 0.5 else 0.6
    wires = SmaWires(peaks, heating_time, cooling_time, refractory=refractory)
    times = begin + np.append(0.0, np.cumsum(rng.choice([0.005, 0.01, 0.0137], rng.integers(0, 50))))
    commands = rng.choice([0.0, -0.0, 1.0, -1.0, *rng.uniform(-1.0, 1.0, 2)], (2, 5))
    contractions = rng.choice([0.0, 1.0, 1e-10, *rng.uniform(0.0, 1.0, 2)], (2, 5, 2))
    state = np.concatenate([contractions, rng.choice([0.0, 0.1, rng.uniform(0.0, 0.3)], (2, 5, 2))], axis=-1)
    expected = *wires.respond(times, commands, state), wires.seconds_heated(times, commands, state)
    for got, wanted in zip(contracted(wires, times, commands, state), expected, strict=True):
        assert got.tobytes() == wanted.tobytes()


# --- pieces: that pauses, states and copies change no bit stands in test_bits.py --------------------------------------


def test_an_interval_pauses_at_the_ends_of_the_steps_in_which_times_lie():
    simulator = Simulator(scene_with(SmaWires()))
    for pauses, expected in (([0.0123, 0.05, 0.012, 0.3], [0.015, 0.05, 0.2]), ([], [0.2])):
        before = simulator.time[0]
        paused, _ = finished(simulator.advance_pausing(0.2, LEFT_RIGHT, pauses), lambda time: (time, simulator.time[0]))
        np.testing.assert_allclose(paused, np.array(expected)[:, None] + [0.0, before], rtol=1e-12)
    tiny = Numerics("implicit-midpoint", 1e-29)
    simulator = Simulator(Scene(Seastar(nodes_per_limb=10), actuator=SmaPulse(0.1, 1e-28, 9e-28), numerics=tiny))
    paused, _ = finished(simulator.stroke_in_parts(np.zeros((1, 5)), 10))
    np.testing.assert_allclose(paused, 1e-28 * np.arange(1, 11), rtol=1e-9, atol=0.0)


TO_THE_BODY = Seastar(nodes_per_limb=6, body=Body(radius=0.02, mass=0.01, centre_of_mass=(0.01, 0.005)))
LINEARISED = {
    "a body": replace(TIGHT, robot=TO_THE_BODY),
    "flow along limbs": replace(TIGHT, fluid=Water(tangential_drag_coefficient=0.2, added_mass_coefficient=0.5)),
}
"""Scenes of which something is linearised at the first guess of a step."""
PIECED = {name: scene_with(each, TIGHT) for name, each in ALL.items()} | LINEARISED


@pytest.mark.parametrize("cuts", [(0.3,), (0.05, 0.1), (0.0371, 0.1213, 0.1214, 0.77)], ids=str)
@pytest.mark.parametrize("name", PIECED)
def test_an_interval_in_pieces_is_the_whole(name, cuts):
    whole, pieces = (Simulator(PIECED[name], 1) for _ in range(2))
    for commands in (LEFT_RIGHT, HALF):
        report = whole.advance(1.0, commands)
        lengths = np.diff([0.0, *cuts, 1.0])
        parts = [pieces.advance(lengths[0], commands), *(pieces.advance(length) for length in lengths[1:])]
        for each in ("heating_time", "energy", "covered"):
            expected = getattr(report, each)
            np.testing.assert_allclose(sum(getattr(part, each) for part in parts), expected, rtol=1e-12, err_msg=each)
        np.testing.assert_allclose(pieces.actuators, whole.actuators, atol=1e-10)
        np.testing.assert_allclose(pieces.time, whole.time, rtol=1e-15)
    off = np.abs(pieces.hub_position() - whole.hub_position()).max()
    exact = name not in LINEARISED and all(abs(cut / 0.01 - round(cut / 0.01)) < 1e-9 for cut in cuts)
    assert off < (1e-9 if exact else 1e-5), off


@pytest.mark.parametrize("actuator", [SmaPulse(), CURVE], ids=["pulse", "curve"])
def test_after_its_period_an_actuator_without_memory_is_at_rest(actuator):
    long, short = (Simulator(scene_with(actuator, TIGHT)) for _ in range(2))
    long.advance(2.5, LEFT_RIGHT)
    short.stroke(LEFT_RIGHT)
    short.advance(1.5)
    np.testing.assert_allclose(long.positions, short.positions, atol=1e-9)
    state = short.get_state()
    assert not state.commands.any() and not state.phase.any()
    short.stroke(LEFT_RIGHT)


# --- heat ------------------------------------------------------------------------------------------------------------


def test_heating_time_and_energy_are_those_of_a_hand_calculation():
    commands = np.array([[1.0, -0.5, 0.0, 0.25, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0]])
    for actuator in (SmaPulse(heating_power=2.0), SmaWires(heating_power=2.0), ThermalSma(heating_power=2.0)):
        report = Simulator(scene_with(actuator), 2).stroke(commands)
        np.testing.assert_allclose(report.heating_time, [0.175, 0.0])
        np.testing.assert_allclose(report.energy, [0.35, 0.0])
    simulator = Simulator(scene_with(SmaWires(heating_power=2.0)), 2)
    found = [simulator.advance(0.05, commands).heating_time[0], simulator.advance(0.03, commands).heating_time[0]]
    np.testing.assert_allclose(found, [0.05 + 0.05 + 0.025, 0.03 + 0.03 + 0.025])
    np.testing.assert_allclose(simulator.advance(1.0).heating_time[0], 0.07 + 0.02)


def test_wires_that_cannot_be_heated_now_are_told():
    refractory, hot = (Simulator(scene_with(MEMORY[name])) for name in ("refractory", "hot"))
    refractory.advance(0.2, LEFT_RIGHT)
    expected = np.zeros((1, 5, 2), bool)
    expected[0, [1, 4]] = True
    np.testing.assert_array_equal(refractory.refractory_wires(), expected)
    assert refractory.advance(0.1, np.ones((1, 5))).heating_time[0] == pytest.approx(0.3)
    refractory.advance(0.4)
    assert not refractory.refractory_wires().any()
    hot.advance(0.42 * np.log(220.0 / 180.0), LEFT_RIGHT)  # from 20 to 60 deg C
    np.testing.assert_array_equal(np.argwhere(hot.refractory_wires()[0]), [[1, 0], [4, 1]])
    pulse = Simulator(FAST)
    assert not pulse.refractory_wires().any()
    pulse.advance(0.3, LEFT_RIGHT)
    assert pulse.refractory_wires().all()


# --- states ----------------------------------------------------------------------------------------------------------


def test_robots_at_rest_may_join_others_in_the_middle_of_a_stroke():
    simulator = Simulator(FAST, 2)
    simulator.advance(0.3, ternary(1, 2)[0])
    simulator.reset(np.array([True, False]))
    simulator.advance(0.2)
    rest = Simulator(FAST).get_state()
    np.testing.assert_allclose(simulator.positions[0], rest.positions[0], atol=1e-12)
    assert simulator.hub_velocity()[1].any()
    state = simulator.get_state()
    assert (state.phase == 0.5).all() and not state.commands[0].any()
    simulator.set_state(state._replace(phase=np.array([0.0, 0.5])))
    assert (simulator.get_state().phase == 0.5).all()


JUMPING = {"pulse": SmaPulse(), "curve": CURVE, "stopped": Limited(SmaPulse(), largest_angle=0.4)}


@pytest.mark.parametrize("name", {**JUMPING, **MEMORY})
def test_commands_that_would_make_limbs_jump_are_refused_and_others_taken_at_any_time(name):
    simulator, other = (Simulator(scene_with({**JUMPING, **MEMORY}[name])) for _ in range(2))
    for each in (simulator, other):
        each.advance(0.25, LEFT_RIGHT)
    if name in JUMPING:
        for commands in (LEFT_RIGHT, np.zeros((1, 5))):
            with assert_refused("limbs would jump", "limb 2 of robot 0", "in 0.75 s"):
                simulator.advance(0.1, commands)
            with assert_refused("limbs would jump"):
                simulator.stroke(commands)
        assert_same(simulator, other)
        simulator.advance(0.75)
    for commands in ternary(6, 1):
        assert not simulator.advance(1.0 if name in JUMPING else 0.13, commands).status.any()


# Time is counted without drift, and no time step straddles a corner of the pulse


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
