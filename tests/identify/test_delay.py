"""Logs whose clocks differ, commands at any time and orientations are fitted, too."""

from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Body, Numerics, Scene, Seastar, SmaWires
from seastar_gym.identify import Measurement, identify, synthetic, trajectory, with_parameters
from seastar_gym.identify.measurement import ORIENTATION, pointer
from seastar_gym.identify.trajectories import at_rest
from seastar_gym.simulator import Simulator

SCENE = Scene(Seastar(nodes_per_limb=4), numerics=Numerics("implicit-midpoint", 0.02, newton_tolerance=1e-6))
ROUND = replace(SCENE, robot=Seastar(nodes_per_limb=4, body=Body(radius=0.02)))
TRUTH = {"actuator.peak_angle": 0.5, "fluid.drag_coefficient": 1.2}
LATE = 0.073
COMMANDS = np.array([[0.0, 1.0, 0.0, 0.0, -1.0], [1.0, 0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0, -1.0]])


def late(seed: int, delay: float = LATE) -> Measurement:
    """Pictures at 30 Hz, by a clock that is ahead, with 1 mm of noise."""
    return synthetic(SCENE, TRUTH, n_strokes=3, rate=30.0, seed=seed, delay=delay)


@pytest.mark.parametrize("seed, delay, largest", [(0, LATE, 0.5), (0, -0.05, 0.5), (1, 1.37, 2.0)])
def test_a_delay_is_found_with_the_parameters(seed, delay, largest):
    """Pictures are 33 ms apart, and the interval of the delay is a third of that wide, whichever clock is ahead."""
    estimate = identify(SCENE, list(TRUTH), late(seed, delay), largest_delay=largest)
    found = estimate.delay
    assert found.lower < delay < found.upper < found.lower + 0.01
    assert estimate.root_mean_square == pytest.approx(1e-3, rel=0.05) and not estimate.untold
    assert ((estimate.lower < list(TRUTH.values())) & (list(TRUTH.values()) < estimate.upper)).all()
    assert estimate.names == tuple(TRUTH) and estimate.correlation.shape == (3, 3)
    assert f"delay = {found.value:.4f} s   [{found.lower:.4f}, {found.upper:.4f}]" in estimate.report()


def test_a_delay_that_nothing_shows_cannot_be_told():
    still = late(0)
    rest = np.broadcast_to(at_rest(SCENE, still.nodes), still.positions.shape)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(rest.shape)
    still = replace(still, positions=rest + noise, commands=0.0 * still.commands)
    untold = identify(SCENE, ["actuator.peak_angle"], still, largest_delay=0.1).untold
    assert {name for group in untold for name in group} == {"actuator.peak_angle", "the delay"}


def test_strokes_at_their_own_times_are_those_without_times():
    time = np.linspace(0.0, 3.0, 31)
    plain = trajectory(time, (0, 3), COMMANDS, SCENE)
    np.testing.assert_allclose(trajectory(time, (0, 3), COMMANDS, SCENE, np.arange(3.0)), plain, atol=1e-12)
    timed = trajectory(time + 5.0, (0, 3), COMMANDS, SCENE, np.arange(3.0) + 5.0)
    np.testing.assert_allclose(timed, plain, atol=1e-9)


def test_between_strokes_and_before_and_after_them_the_robot_coasts():
    times = np.array([1.0, 2.5])
    found = trajectory(np.array([0.0, 1.0, 2.5, 4.0]), (0,), COMMANDS[:2], SCENE, times)[:, 0]
    simulator = Simulator(SCENE)
    simulator.stroke(COMMANDS[:1])
    simulator.advance(0.5)
    before = simulator.hub_position()[0]
    simulator.stroke(COMMANDS[1:2])
    simulator.advance(0.5)
    np.testing.assert_array_equal(found[:2], 0.0)
    np.testing.assert_allclose(found[2:], [before, simulator.hub_position()[0]], atol=1e-7)
    seen_before_the_last = trajectory(np.array([0.0, 2.5]), (0,), COMMANDS[:2], SCENE, np.array([1.0, 4.0]))
    np.testing.assert_allclose(seen_before_the_last[1, 0], before, atol=1e-7)


def test_commands_come_at_any_time_where_actuators_remember():
    scene = replace(SCENE, actuator=SmaWires())
    when = np.array([0.0, 0.213, 0.5])
    found = trajectory(np.array([0.5, 0.9]), (0,), COMMANDS, scene, when)[:, 0]
    simulator = Simulator(scene)
    for duration, command in zip((0.213, 0.287, 0.4), COMMANDS, strict=True):
        simulator.advance(duration, command[None])
    assert np.linalg.norm(found[0]) > 1e-4
    np.testing.assert_allclose(found[1], simulator.hub_position()[0], atol=1e-5)


def test_an_orientation_is_simulated_and_fitted():
    """The place and the orientation of a tag on the body tell two numbers, and so does its orientation alone."""
    time = np.arange(90) / 30.0
    turning = np.array([[1.0, 0.0, 1.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0, 0.0]])
    built = with_parameters(ROUND, list(TRUTH), list(TRUTH.values()))
    exact = trajectory(time, (0, ORIENTATION), turning, built)
    simulator = Simulator(built)
    simulator.stroke(turning[:1])
    np.testing.assert_allclose(exact[30, 1], pointer(simulator.orientation()[0]), atol=1e-9)
    assert abs(simulator.orientation()[0]) > 0.01
    seen = exact + np.random.default_rng(0).normal(0.0, 3e-4, exact.shape)
    for nodes, positions in (((0, ORIENTATION), seen), ((ORIENTATION,), seen[:, 1:])):
        found = identify(ROUND, list(TRUTH), Measurement(time, positions, nodes, turning))
        assert ((found.lower < list(TRUTH.values())) & (list(TRUTH.values()) < found.upper)).all()
        assert found.upper[0] < 1.2 * found.lower[0] and not found.untold


def test_an_orientation_turns_between_time_steps_by_the_spin():
    simulator, unlike = Simulator(ROUND), np.array([[1.0, 0.0, 1.0, 0.0, 0.0]])
    simulator.advance(0.5, unlike)
    around = 0.5 + np.array([-1e-5, 1e-5])
    before, after = trajectory(around, (ORIENTATION,), unlike, ROUND)[:, 0]
    angle = np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])
    assert abs(simulator.spin()[0]) > 1e-3
    assert angle / 2e-5 == pytest.approx(simulator.spin()[0], rel=1e-3)


def test_measurements_are_read_as_they_were_written(tmp_path, golden):
    """Times of a clock that counts since 1970 keep their microseconds."""
    files = tmp_path / "path.csv", tmp_path / "commands.csv"
    time = np.array([0.0, 0.033333, 0.066667])
    place, theta = np.arange(6.0).reshape(3, 2) / 3.0, np.array([0.1, np.nan, -3.0])
    place[2] = np.nan  # not seen
    poses = np.stack([place, pointer(theta)], axis=1)
    since_1970 = Measurement(1.7e9 + time, poses, (0, ORIENTATION), COMMANDS, 1.7e9 + np.array([0.0, 1.25, 2.5]))
    plain = Measurement(time, place[:, None], (9,), COMMANDS)
    for name, measurement in {"since_1970": since_1970, "plain": plain}.items():
        measurement.to_csv(*files)
        golden(f"{name}.csv", "".join(file.read_text() for file in files))
        found = Measurement.from_csv(*files)
        np.testing.assert_allclose(found.time - measurement.time, 0.0, atol=1e-6)
        np.testing.assert_allclose(found.positions, measurement.positions, rtol=1e-6)
        np.testing.assert_array_equal(found.commands, measurement.commands)
        np.testing.assert_array_equal(found.command_times, measurement.command_times)
        assert found.nodes == measurement.nodes
