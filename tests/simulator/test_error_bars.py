"""Error bars: a twin tells how far the hub may be from the truth; that it changes no bit stands in test_bits.py."""

from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Scene, Simulator
from seastar_gym.accuracy.certificate import resolved
from seastar_gym.accuracy.commands import STROKES, draw_batch
from seastar_gym.accuracy.measure import SHORT, swim
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.simulator import watches as error_bars

FAST = Scene.preset("fast")
N_ROBOTS = N_LANES + 3
COMMANDS = np.random.default_rng(0).integers(-1, 2, (4, N_ROBOTS, 5)).astype(float)


def swimmers(scene: Scene = FAST, n_strokes: int = 1) -> Simulator:
    """Robots with error bars after some strokes."""
    simulator = Simulator(scene, N_ROBOTS, 1, error_bars=True)
    for commands in COMMANDS[:n_strokes]:
        simulator.stroke(commands)
    return simulator


@pytest.mark.parametrize("fidelity", ["fast", "balanced"])
def test_the_estimate_covers_the_true_error_is_not_vacuous_and_never_falls(fidelity):
    scene, commands = Scene.preset(fidelity), draw_batch(2, 5, seed=77).joined
    exact = swim(resolved(scene, 37, replace(SHORT, step=0.5e-3)), commands).hub
    simulator, ratios, estimates = Simulator(scene, commands.shape[1], 1, error_bars=True), [], []
    for k in range(STROKES):
        estimates.append(simulator.stroke(commands[k]).error_estimate)
        ratios.append(estimates[-1] / np.linalg.norm(simulator.hub_position() - exact[k], axis=1))
    assert np.mean(np.array(ratios) >= 1.0) >= 0.95
    assert np.median(ratios) <= 5.0
    assert (np.diff(estimates, axis=0) >= 0.0).all()


def test_chapters_discretisation_has_error_bars_by_a_factor_of_its_own():
    scene = Scene.preset("chapter")
    simulator = Simulator(scene, 1, error_bars=True)
    simulator.stroke(COMMANDS[:1, 0])
    assert 1e-5 < simulator.error_estimate[0] < 1e-2
    assert error_bars.factor(scene) == error_bars.FACTOR_OF_CHAPTER


# What is done to robots is done to their twins


def test_robots_that_are_reset_begin_anew_and_the_others_go_on():
    simulator, other = swimmers(n_strokes=2), swimmers(n_strokes=2)
    mask = np.arange(N_ROBOTS) % 2 == 0
    simulator.reset(mask, heading=0.3)
    assert not simulator.error_estimate[mask].any()
    np.testing.assert_array_equal(simulator.error_estimate[~mask], other.error_estimate[~mask])
    fresh = Simulator(FAST, N_ROBOTS, 1, error_bars=True)
    fresh.reset(heading=0.3)
    for swimming in (simulator, other, fresh):
        swimming.stroke(COMMANDS[2])
    wanted = np.where(mask, fresh.error_estimate, other.error_estimate)
    np.testing.assert_array_equal(simulator.error_estimate, wanted)


def test_strengths_and_numbers_of_each_robot_hold_for_the_twin():
    moduli, strengths = np.linspace(5e5, 2e6, N_ROBOTS), (1.0, 0.5, 0.0, 0.8, 1.0)
    own = replace(FAST, robot=replace(FAST.robot, youngs_modulus=moduli))
    other = swimmers(replace(own, limb_strengths=strengths))
    simulator = Simulator(FAST, N_ROBOTS, 1, error_bars=True)
    simulator.set_scene(own)
    simulator.set_limb_strengths(strengths)
    np.testing.assert_array_equal(simulator.stroke(COMMANDS[0]).error_estimate, other.error_estimate)


def test_a_state_from_elsewhere_has_no_estimate_until_the_reset():
    simulator = swimmers(n_strokes=2)
    simulator.set_state(simulator.get_state())
    assert np.isnan(simulator.error_estimate).all()
    assert np.isnan(simulator.stroke(COMMANDS[2]).error_estimate).all()
    mask = np.arange(N_ROBOTS) == 1
    simulator.reset(mask)
    assert simulator.error_estimate[1] == 0.0
    estimate = simulator.stroke(COMMANDS[0]).error_estimate
    assert estimate[1] == swimmers().error_estimate[1] and np.isnan(estimate[~mask]).all()


@pytest.mark.parametrize("whose", ["robot", "twin"])
def test_a_robot_that_fails_or_whose_twin_fails_has_no_estimate_until_its_reset(whose):
    simulator = swimmers(n_strokes=1)
    ill = simulator if whose == "robot" else simulator._watches["error_estimate"].twin
    ill.v[0, 0, 2] = np.nan
    for commands in COMMANDS[1:3]:
        report = simulator.stroke(commands)
        assert np.isnan(report.error_estimate).tolist() == ill.failed.tolist()
        assert ill.failed.sum() == 1 and (report.status > 0).sum() == simulator.failed.sum() == (whose == "robot")
    simulator.reset(np.isnan(simulator.error_estimate))
    assert np.isfinite(simulator.stroke(COMMANDS[3]).error_estimate).all()
