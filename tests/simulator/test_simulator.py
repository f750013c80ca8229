"""Robots begin at rest, are reset, read and copied; a stroke says what it cost, and failure is a value."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from hubs import TEN, robot_with
from seastar_gym import Body, Limb, Numerics, Scene, Seastar, Simulator, SmaPulse, SolverStatus, State
from seastar_gym.envs.stations import heading_of
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.scene.number import side_by_side
from seastar_gym.simulator.report import MEASURED_IF_ASKED
from strokes import assert_same_bits, finished

SCHEMES = ["implicit-euler", "sdirk2", "implicit-midpoint"]
STRAIGHT = np.array([[0.0, 1.0, 0.0, 0.0, -1.0]])


def scene_of(scheme="implicit-midpoint", step=0.01, **numerics) -> Scene:
    return Scene(TEN, numerics=Numerics(scheme, step, **numerics))


def random_commands(n_robots: int, n_strokes: int = 3, seed: int = 0) -> np.ndarray:
    """Commands of the chapter, -1, 0 and 1, and others in between; shape (n_strokes, n_robots, 5)."""
    rng = np.random.default_rng(seed)
    whole = rng.integers(-1, 2, (n_strokes, n_robots, 5)).astype(float)
    return np.where(rng.random(whole.shape) < 0.5, whole, rng.uniform(-1.0, 1.0, whole.shape))


def set_motion(simulator: Simulator, size: float, robots: slice | int = slice(None)) -> None:
    """Keep positions and time, and give robots random velocities of this size [m/s], others none."""
    state = simulator.get_state()
    velocities = np.zeros_like(state.velocities)
    velocities[robots] = size * np.random.default_rng(0).standard_normal(velocities[robots].shape)
    simulator.set_state(state._replace(velocities=velocities))


# Robots at rest


@pytest.mark.parametrize("scheme", SCHEMES)
def test_robots_begin_at_rest_with_the_hub_at_the_origin_and_stay_there_if_they_are_left_alone(scheme):
    simulator = Simulator(scene_of(scheme), n_robots=3)
    np.testing.assert_array_equal(simulator.positions, np.tile(TEN.nodes(), (3, 1, 1)))
    for zero in (simulator.velocities, simulator.time, simulator.hub_position(), simulator.hub_velocity()):
        assert not zero.any()
    assert simulator.time.shape == simulator.elastic_energy().shape == simulator.kinetic_energy().shape == (3,)
    for _ in range(3):
        simulator.stroke(np.zeros((3, 5)))
    np.testing.assert_allclose(simulator.positions, np.tile(TEN.nodes(), (3, 1, 1)), rtol=0.0, atol=1e-13)
    assert simulator.elastic_energy().max() < 1e-25


def test_held_nodes_stay_where_they_are_to_the_last_bit():
    held = [0, 1, 2]
    simulator = Simulator(Scene(TEN, held_nodes=(0, 1, 2), numerics=Numerics("implicit-midpoint", 0.01)), 2)
    state = simulator.get_state()
    simulator.set_state(state._replace(positions=state.positions + 0.03, velocities=state.velocities + 0.01))
    start = simulator.positions
    for command in random_commands(2):
        simulator.stroke(command)
    np.testing.assert_array_equal(simulator.positions[:, held], start[:, held])
    assert not simulator.velocities[:, held].any()
    assert np.abs(simulator.positions - start).max() > 1e-3


def test_reset_puts_the_chosen_robots_at_rest_and_touches_no_other():
    simulator, commands = Simulator(scene_of(), n_robots=11), random_commands(11)
    simulator.stroke(commands[0])
    before, mask = simulator.get_state(), np.arange(11) % 3 == 0
    simulator.reset(mask)
    after = simulator.get_state()
    assert_same_bits(after.of_robots(~mask), before.of_robots(~mask))
    np.testing.assert_array_equal(after.positions[mask], np.tile(TEN.nodes(), (mask.sum(), 1, 1)))
    assert not after.velocities[mask].any() and not after.time[mask].any()
    simulator.stroke(commands[1])
    np.testing.assert_array_equal(simulator.time, np.where(mask, 1.0, 2.0))


CURVED = Seastar(4, 5, limbs=(Limb(natural_curvature=(0.0, 6.0, -3.0)), Limb(), Limb(), Limb()))
"""Three robots whose first limbs are bent differently at rest."""


@pytest.mark.parametrize("robot", [CURVED, replace(CURVED, body=Body.rectangle(0.06, 0.03))], ids=["hub", "body"])
@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [2, 1, 0], [1], [2]], ids=str)
def test_a_heading_is_that_of_a_robots_own_shape_at_rest_whatever_the_company(robot, order):
    headings = 0.5 * np.array(order) - 0.3
    simulator = Simulator(side_by_side([Scene(robot).of_robot(k) for k in order]), len(order))
    simulator.reset(heading=headings)
    simulator.set_state(State(*simulator.get_state()[:3]))  # without orientation: that of the rest shape that fits best
    for read in (Simulator.heading, heading_of, Simulator.orientation):
        np.testing.assert_allclose(read(simulator), headings, rtol=0.0, atol=1e-14)
    assert simulator.elastic_energy().max() < 1e-20 and not (simulator.spin() > 0.0).any()
    for k, heading in enumerate(headings):
        alone = Simulator(Scene(robot).of_robot(order[k]))
        alone.reset(heading=heading)
        assert [alone.heading()[0], heading_of(alone)[0]] == [simulator.heading()[k], heading_of(simulator)[k]]


def test_a_simulator_that_is_copied_within_a_stroke_knows_its_actuation_and_its_time():
    simulator = Simulator(scene_of())
    parts = simulator.stroke_in_parts(STRAIGHT, 2)
    assert next(parts) == 0.5
    copy = pickle.loads(pickle.dumps(simulator))
    assert copy.elastic_energy() == simulator.elastic_energy()
    with pytest.raises(ValueError, match="limbs would jump"):
        copy.stroke(STRAIGHT)
    copy.advance(0.25)
    assert copy.time[0] == pytest.approx(0.75)
    finished(parts)


# Work and outcome


@pytest.mark.parametrize(
    "hub, peak", [("rigid", 0.5), ("rigid", 0.9), ("opening", np.pi / 5), ("turning", 0.5), ("opening", 0.9)]
)
def test_smallest_opening_angle_is_that_of_the_limbs_during_the_stroke(hub, peak):
    scene = Scene(robot_with(hub), actuator=SmaPulse(peak), numerics=Numerics("implicit-euler", 0.01))
    simulator = Simulator(scene)

    def opening(time):
        roots = simulator.positions[0, 1::9] - simulator.positions[0, 0]
        after = np.roll(roots, -1, axis=0)
        cross, dot = roots[:, 0] * after[:, 1] - roots[:, 1] * after[:, 0], np.sum(roots * after, axis=1)
        return np.arctan2(cross, dot).min()

    smallest, report = finished(simulator.stroke_in_parts([[1.0, -1.0, 0.0, 0.3, 0.0]], 100), opening)
    assert report.smallest_opening_angle[0] == pytest.approx(min(smallest), abs=1e-4)
    assert (report.smallest_opening_angle[0] < 0.0) == (peak == 0.9)


def test_a_step_that_does_not_converge_is_two_steps_of_half_its_length():
    """Steps of 10 ms need more than two iterations, and their halves do not."""
    h, ends, halvings = 0.01, {}, {}
    for step, max_iterations in ((h, 2), (h / 2, 60), (h, 60)):
        numerics = Numerics("implicit-euler", step, newton_tolerance=1e-4, max_iterations=max_iterations)
        simulator = Simulator(Scene(TEN, actuator=SmaPulse(0.1, h, h), numerics=numerics))
        set_motion(simulator, 0.01)
        report = simulator.stroke(STRAIGHT)
        halvings[step, max_iterations], ends[step, max_iterations] = report.halvings[0], simulator.positions
        assert report.covered[0] == pytest.approx(2 * h, rel=1e-12)
    assert halvings == {(h, 2): 2, (h / 2, 60): 0, (h, 60): 0}
    np.testing.assert_allclose(ends[h, 2], ends[h / 2, 60], rtol=0.0, atol=1e-4 * 0.1)
    assert np.abs(ends[h, 60] - ends[h / 2, 60]).max() > 10 * 1e-4 * 0.1


# Failure is a value; that it is nobody else's stands in test_bits.py


def test_a_robot_that_cannot_be_solved_fails_with_a_status_and_a_finite_state_until_it_is_cured():
    """One of three has all its nodes in one point: no angle, no direction, no way on."""
    fresh, simulator, commands = Simulator(scene_of(), 3), Simulator(scene_of(), 3), random_commands(3)
    at_rest, broken = fresh.get_state(), fresh.get_state()
    broken.positions[1] = 0.25
    fresh.stroke(commands[0])
    for cure in (lambda: simulator.reset(simulator.failed), lambda: simulator.set_state(at_rest)):
        simulator.set_state(broken)
        for k, command in enumerate(commands, start=1):
            report = simulator.stroke(command)
            assert report.status.tolist() == [0, SolverStatus.NOT_CONVERGED, 0] and report.covered[1] == 0.0
            assert simulator.failed.tolist() == [False, True, False]
            np.testing.assert_array_equal(simulator.positions[1], 0.25)
            assert simulator.time.tolist() == [k, 0.0, k]
            for name, field in report._asdict().items():
                assert name in MEASURED_IF_ASKED or np.isfinite(field).all()
        cure()
        assert not simulator.failed.any()
        simulator.stroke(commands[0])
        np.testing.assert_array_equal(simulator.positions[1], fresh.positions[1])


@pytest.mark.parametrize("row", [0, 91], ids=["hub", "tip"])
@pytest.mark.parametrize("where", ["q", "v"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_none_ends_its_robots_stroke_which_lies_where_its_hub_was_and_waits_for_a_reset(
    row, where, value
):
    n_robots, ill = N_LANES + 2, 1
    simulator, commands = Simulator(scene_of(step=0.02), n_robots), random_commands(n_robots)
    simulator.stroke(commands[0])
    hub = simulator.hub_position()[ill]
    getattr(simulator, where)[0, row, ill] = value
    for command in commands[1:]:
        report = simulator.stroke(command)
        assert (report.status == np.where(np.arange(n_robots) == ill, SolverStatus.NOT_FINITE, 0)).all()
        np.testing.assert_array_equal(simulator.failed, report.status > 0)
        np.testing.assert_array_equal(simulator.positions[ill], TEN.nodes() + hub)
        assert not simulator.velocities[ill].any()
        assert all(np.isfinite(found).all() or name in MEASURED_IF_ASKED for name, found in report._asdict().items())
    simulator.reset(simulator.failed)
    assert not simulator.stroke(commands[0]).status.any()
    assert all(status.sentence.endswith(".") and "\n" not in status.sentence for status in SolverStatus)


def test_what_is_read_is_a_copy():
    simulator = Simulator(scene_of(), n_robots=2)
    simulator.stroke(random_commands(2)[0])
    before = simulator.get_state()
    for array in (
        simulator.positions, simulator.velocities, simulator.time, simulator.hub_position(), simulator.hub_velocity(),
        *(part for part in simulator.get_state() if part is not None), simulator.elastic_energy(),
    ):  # fmt: skip
        array[:] = 7.0
    assert_same_bits(simulator.get_state(), before)


@pytest.mark.parametrize("parts", [None, 4])
@pytest.mark.parametrize("speed", [1e14, 1e30, 1e160, 1e300])
def test_a_robot_that_fails_within_a_stroke_is_finite_and_its_time_that_of_its_state_which_stands_still(speed, parts):
    """Velocities so large that rounding ends the stroke, some tenths of a second after its beginning or at once."""
    simulator, commands = Simulator(scene_of(max_iterations=2), 2), np.repeat(STRAIGHT, 2, axis=0)
    set_motion(simulator, speed, robots=1)
    times = []
    for _ in range(2):
        report = (
            simulator.stroke(commands) if parts is None else finished(simulator.stroke_in_parts(commands, parts))[1]
        )
        assert report.status.tolist() == [0, 1]
        assert np.isfinite(simulator.positions).all() and np.isfinite(simulator.velocities).all()
        times.append((simulator.time[1], report.covered[1]))
    assert (times[0][1] > 0.0) == (speed == 1e14) and times[1][1] == 0.0
    assert times[0][0] == pytest.approx(times[0][1]) and times[1][0] == times[0][0]
