"""Time in seconds: intervals of any length, what goes on in them, what they cost, and what is refused."""

import contextlib
import pickle
from dataclasses import replace

import numpy as np
import pytest

from own_actuators import Remembering, Triangle
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
from seastar_gym.simulator.report import report_of_pieces
from seastar_gym.simulator.schedule import interval_times, step_times
from strokes import assert_same, assert_same_bits, finished, ternary

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


# --- pauses ---------------------------------------------------------------------------------------------------------


def test_an_interval_pauses_at_the_ends_of_the_steps_in_which_times_lie_and_no_bit_changes():
    ours, whole = (Simulator(scene_with(SmaWires()), 2) for _ in range(2))
    commands = np.repeat(LEFT_RIGHT, 2, axis=0)
    paused, report = finished(ours.advance_pausing(0.2, commands, [0.0123, 0.05, 0.012, 0.3]))
    assert paused == pytest.approx([0.015, 0.05, 0.2])
    np.testing.assert_array_equal(report, whole.advance(0.2, commands))
    assert ours.positions.tobytes() == whole.positions.tobytes()
    paused, _ = finished(ours.advance_pausing(0.2, commands, []))
    assert paused == pytest.approx([0.2])


def test_the_report_of_pieces_counts_what_the_whole_does():
    pieces = Simulator(scene_with(SmaWires()), 2)
    commands = np.repeat(LEFT_RIGHT, 2, axis=0)
    reports = [pieces.advance(0.06, commands), pieces.advance(0.3), pieces.advance(0.14)]
    found, whole = report_of_pieces(reports), Simulator(scene_with(SmaWires()), 2).advance(0.5, commands)
    for name in ("status", "steps", "heating_time", "energy", "covered"):
        np.testing.assert_allclose(getattr(found, name), getattr(whole, name), rtol=1e-12, err_msg=name)
    np.testing.assert_allclose(found.smallest_opening_angle, whole.smallest_opening_angle, rtol=1e-4)
    failed = reports[1]._replace(status=np.array([0, 2]))
    assert report_of_pieces([reports[0], failed, reports[2]]).status.tolist() == [0, 2]


# --- strokes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["implicit-euler", "implicit-midpoint", "sdirk2", "sdirk3"])
def test_wires_from_rest_with_the_period_of_the_pulse_swim_as_it_does_to_the_bit(scheme):
    scene = Scene(Seastar(nodes_per_limb=6), numerics=Numerics(scheme, 0.01))
    pulse, wires = (Simulator(replace(scene, actuator=actuator), 3) for actuator in (SmaPulse(), SmaWires()))
    for commands in ternary(4, 3):
        reports = pulse.stroke(commands), wires.stroke(commands)
        assert pulse.positions.tobytes() == wires.positions.tobytes()
        assert pulse.velocities.tobytes() == wires.velocities.tobytes()
        for one, other in zip(*reports, strict=True):
            np.testing.assert_array_equal(one, other)
    assert not wires.actuators.any()


@pytest.mark.parametrize("actuator", ALL.values(), ids=ALL)
def test_a_stroke_is_the_interval_of_one_period(actuator):
    strokes, intervals = (Simulator(scene_with(actuator), 2) for _ in range(2))
    for commands in ternary(2, 2):
        strokes.stroke(commands)
        for _ in intervals.advance_in_parts(actuator.period, commands, 3):
            pass
        assert_same(intervals, strokes)


# --- pieces ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cuts", [(0.3,), (0.05, 0.1), (0.0371, 0.1213, 0.1214, 0.77)], ids=str)
@pytest.mark.parametrize("actuator", ALL.values(), ids=ALL)
def test_an_interval_in_pieces_is_the_whole(actuator, cuts):
    whole, pieces = (Simulator(scene_with(actuator, TIGHT), 1) for _ in range(2))
    for commands in (LEFT_RIGHT, HALF):
        report = whole.advance(1.0, commands)
        lengths = np.diff([0.0, *cuts, 1.0])
        parts = [pieces.advance(lengths[0], commands), *(pieces.advance(length) for length in lengths[1:])]
        for name in ("heating_time", "energy", "covered"):
            expected = getattr(report, name)
            np.testing.assert_allclose(sum(getattr(part, name) for part in parts), expected, rtol=1e-12, err_msg=name)
        np.testing.assert_allclose(pieces.actuators, whole.actuators, atol=1e-10)
        np.testing.assert_allclose(pieces.time, whole.time, rtol=1e-15)
    off = np.abs(pieces.hub_position() - whole.hub_position()).max()
    on_grid = all(abs(cut / 0.01 - round(cut / 0.01)) < 1e-9 for cut in cuts)
    assert off < (1e-9 if on_grid else 1e-5), off


def parted(scene: Scene, cut: float) -> tuple[float, float]:
    """Distance of hubs over a limb's length, and of velocities over the largest, after a stroke in two pieces."""
    whole, pieces = Simulator(scene), Simulator(scene)
    whole.advance(1.0, [[1.0, -0.5, 0.3, 0.0, -1.0]])
    pieces.advance(cut, [[1.0, -0.5, 0.3, 0.0, -1.0]])
    pieces.advance(1.0 - cut)
    hub = np.abs(pieces.hub_position() - whole.hub_position()).max() / 0.1
    return hub, np.abs(pieces.velocities - whole.velocities).max() / np.abs(whole.velocities).max()


LINEARISED = {
    "a body": Scene(Seastar(nodes_per_limb=6, body=Body(radius=0.02, mass=0.01, centre_of_mass=(0.01, 0.005)))),
    "flow along limbs": Scene(Seastar(), Water(tangential_drag_coefficient=0.2, added_mass_coefficient=0.5)),
}


@pytest.mark.parametrize("scene", LINEARISED.values(), ids=LINEARISED)
def test_what_is_linearised_at_a_first_guess_leaves_pieces_by_1e_5_limb_lengths(scene):
    """Though they end where time steps do."""
    tight = replace(scene, numerics=Numerics("implicit-midpoint", 0.003, newton_tolerance=1e-10))
    for cut in (0.1 + 10 * 0.003, 0.1 + 100 * 0.003):
        assert 1e-9 < parted(tight, cut)[0] < 1e-5


def test_a_cut_within_a_step_moves_ringing_limbs_by_some_per_cent_of_their_speed_and_the_hub_hardly():
    off = np.array([parted(FAST, 0.1 + (steps + share) * 0.005) for steps in (6, 60) for share in (0.15, 0.5, 0.85)])
    assert off[:, 0].max() < 1e-5
    assert 0.01 < off[:, 1].max() < 0.05


def test_random_cuts_of_many_commands_are_the_scheme_s_accuracy_away():
    rng, actuator = np.random.default_rng(1), SmaWires()
    ends = {}
    for step in (0.01, 0.005):
        scene = scene_with(actuator, replace(TIGHT, numerics=replace(TIGHT.numerics, step=step)))
        whole, pieces = Simulator(scene, 4), Simulator(scene, 4)
        draws = np.random.default_rng(2)
        for _ in range(8):
            commands, duration = draws.uniform(-1.0, 1.0, (4, 5)), float(draws.uniform(0.05, 0.4))
            whole.advance(duration, commands)
            cut = duration * rng.uniform(0.1, 0.9)
            pieces.advance(cut, commands)
            pieces.advance(duration - cut)
        ends[step] = np.abs(pieces.hub_position() - whole.hub_position()).max()
    assert ends[0.005] < 2e-5


def test_steps_of_pieces_are_those_of_the_whole():
    corners = (0.0, 0.1, 1.0)
    whole = step_times(corners, 0.03)
    np.testing.assert_array_equal(interval_times(corners, 0.03, 0.0, 1.0), whole)
    pieces = [interval_times(corners, 0.03, begin, 0.1) for begin in np.arange(10) / 10]
    seen = np.unique(np.round(np.concatenate(pieces), 12))
    assert set(np.round(whole, 12)) <= set(seen) and len(seen) <= len(whole) + 9
    on_grid = [*interval_times(corners, 0.01, 0.0, 0.1 + 0.2), *interval_times(corners, 0.01, 0.1 + 0.2, 0.7)[1:]]
    np.testing.assert_array_equal(on_grid, step_times(corners, 0.01))


def test_no_step_straddles_the_end_of_a_full_pulse():
    for begin, duration in ((0.0, 0.25), (0.07, 0.4), (0.0, 3.0), (0.99, 0.4)):
        times = interval_times((0.0, 0.1, 1.0), 0.03, begin, duration)
        assert times[0] == begin and times[-1] == pytest.approx(begin + duration)
        assert (np.diff(times) > 0.0).all() and np.diff(times).max() <= 0.03 + 1e-12
        assert all(corner in times for corner in (0.1, 1.0) if begin < corner < begin + duration)


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


SILENT = {"plain": Triangle(), "memory": Remembering(), "limited": Limited(Triangle(), 0.2)}


@pytest.mark.parametrize("actuator", SILENT.values(), ids=SILENT)
def test_an_actuator_that_says_nothing_of_heat_has_unknown_energy_and_no_deaf_wires(actuator):
    simulator = Simulator(scene_with(actuator))
    report = simulator.stroke(LEFT_RIGHT)
    assert np.isnan(report.energy).all() and np.isnan(report.heating_time).all() and not report.status.any()
    simulator.advance(0.2, LEFT_RIGHT)
    simulator.advance(0.4)
    assert not simulator.refractory_wires().any()


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


@pytest.mark.parametrize("actuator", ALL.values(), ids=ALL)
def test_a_state_in_the_middle_of_a_pulse_continues_to_the_same_bits(actuator):
    first, second = (Simulator(scene_with(actuator), 2) for _ in range(2))
    commands = np.vstack([LEFT_RIGHT, HALF])
    first.advance(0.07, commands)
    second.set_state(first.get_state())
    third = pickle.loads(pickle.dumps(first))
    for duration in (0.05, 0.9, 0.5):
        reports = [simulator.advance(duration) for simulator in (first, second, third)]
        for other, report in ((second, reports[1]), (third, reports[2])):
            assert_same(other, first)
            np.testing.assert_array_equal(report.energy, reports[0].energy)


def test_states_of_earlier_lengths_are_at_rest():
    simulator, fresh = Simulator(FAST), Simulator(FAST)
    simulator.advance(0.3, LEFT_RIGHT)
    for length in (3, 4, 5):
        simulator.set_state(fresh.get_state()[:length])
        assert_same(simulator, fresh)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"phase": np.array([0.3, 0.4])}, "one time for all robots"),
        ({"phase": np.array([0.3, -0.1])}, "at least 0"),
        ({"phase": np.full(2, 1.0)}, "less than 1 s"),
        ({"phase": np.zeros(3)}, "State.phase must have shape (2,)"),
        ({"commands": np.full((2, 5), 1.5)}, "State.commands must be numbers in [-1, 1]"),
        ({"commands": np.full((2, 5), np.nan)}, "State.commands must be finite"),
    ],
)
def test_states_that_cannot_be_are_refused(change, words):
    simulator, other = (Simulator(FAST, 2) for _ in range(2))
    for each in (simulator, other):
        each.advance(0.3, ternary(1, 2)[0])
    with assert_refused(words):
        simulator.set_state(simulator.get_state()._replace(**change))
    assert_same(simulator, other)


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


@pytest.mark.parametrize("actuator", ALL.values(), ids=ALL)
@pytest.mark.parametrize("how", ["closed", "failed"])
def test_an_interval_that_is_not_completed_is_undone(monkeypatch, actuator, how):
    simulator, other = (Simulator(scene_with(actuator), 2) for _ in range(2))
    for each in (simulator, other):
        each.advance(0.07, ternary(1, 2)[0])
    commands = None if actuator in (ALL["pulse"], CURVE) else ternary(1, 2, 1)[0]
    if how == "closed":
        with contextlib.closing(simulator.advance_in_parts(0.2, commands, 3)) as parts:
            assert next(parts) > 0.0
            assert next(parts) > 0.1
    else:
        with monkeypatch.context() as patch:
            patch.setattr(Simulator, "_end_interval", lambda self: 1 / 0)
            with pytest.raises(ZeroDivisionError):
                simulator.advance(0.2, commands)
    assert_same(simulator, other)
    for each in (simulator, other):
        each.advance(0.3, commands)
    assert_same(simulator, other)


def test_the_twin_of_error_bars_advances_likewise():
    barred, plain = Simulator(FAST, error_bars=True), Simulator(FAST)
    for simulator in (barred, plain):
        simulator.advance(0.3, LEFT_RIGHT)
        report = simulator.advance(0.9)
        simulator.stroke(-LEFT_RIGHT)
    assert_same_bits(barred.get_state(), plain.get_state())
    np.testing.assert_array_equal(barred.elastic_energy(), plain.elastic_energy())
    assert 1e-6 < barred.error_estimate[0] < 5e-3 and np.isnan(report.error_estimate).all()


# --- time and refusals -----------------------------------------------------------------------------------------------


def test_the_clock_counts_intervals_and_strokes_without_drift():
    numerics, pulse = Numerics("implicit-euler", 0.1), SmaPulse(cooling_time=0.2)
    in_time, in_strokes = (Simulator(Scene(Seastar(nodes_per_limb=3), Water(), pulse, numerics)) for _ in range(2))
    for _ in range(1000):
        in_time.advance(0.1)
        in_strokes.stroke(np.zeros((1, 5)))
    assert in_time.time[0] == 1000 * 0.1 != sum([0.1] * 1000)
    assert in_strokes.time[0] == 1000 * (0.1 + 0.2)


@pytest.mark.parametrize(
    "duration, words",
    [(0.0, "positive"), (-1.0, "positive"), (np.nan, "positive"), (np.inf, "positive"), ("1", "positive"),
     (True, "positive"), (1e-12, "from 5e-09 to"), (1e12, "from 5e-09 to")],
)  # fmt: skip
def test_durations_that_cannot_be_are_refused_and_change_nothing(duration, words):
    simulator, other = Simulator(FAST), Simulator(FAST)
    with assert_refused("duration", words):
        simulator.advance(duration, LEFT_RIGHT)
    with assert_refused("duration", words):
        next(simulator.advance_in_parts(duration, LEFT_RIGHT, 2))
    assert_same(simulator, other)


JUMPING = {"pulse": SmaPulse(), "curve": CURVE, "limited": Limited(SmaPulse(), largest_angle=0.4)}


@pytest.mark.parametrize("actuator", JUMPING.values(), ids=JUMPING)
def test_commands_that_would_make_limbs_jump_are_refused_and_change_nothing(actuator):
    simulator, other = (Simulator(scene_with(actuator)) for _ in range(2))
    for each in (simulator, other):
        each.advance(0.25, LEFT_RIGHT)
    for commands in (LEFT_RIGHT, np.zeros((1, 5))):
        with assert_refused("limbs would jump", "limb 2 of robot 0", "in 0.75 s"):
            simulator.advance(0.1, commands)
        with assert_refused("limbs would jump"):
            simulator.stroke(commands)
    assert_same(simulator, other)
    simulator.advance(0.75)
    simulator.stroke(LEFT_RIGHT)


@pytest.mark.parametrize("actuator", MEMORY.values(), ids=MEMORY)
def test_actuators_with_memory_take_commands_at_any_time(actuator):
    simulator = Simulator(scene_with(actuator), 2)
    for commands in ternary(6, 2):
        assert not simulator.advance(0.13, commands).status.any()
    assert np.isfinite(simulator.positions).all()


# --- swimming --------------------------------------------------------------------------------------------------------


def test_two_pairs_one_after_the_other_swim_much_faster_than_together():
    """The lagged gait: {2+, 5-}, and {3+, 4-} 0.65 s later, each once per second from rest."""
    simulator = Simulator(replace(Scene.preset("chapter"), actuator=SmaWires()))
    pairs = [[[0.0, 1.0, 0.0, 0.0, -1.0]], [[0.0, 0.0, 1.0, -1.0, 0.0]]]
    hubs = [simulator.hub_position()]
    for _ in range(8):
        reports = simulator.advance(0.65, pairs[0]), simulator.advance(0.35, pairs[1])
        hubs.append(simulator.hub_position())
    speed = np.linalg.norm(hubs[-1] - hubs[-4]) / 3.0
    assert speed == pytest.approx(8.3e-3, abs=0.1e-3)
    assert sum(report.heating_time[0] for report in reports) == pytest.approx(0.4)  # four pulses each second
