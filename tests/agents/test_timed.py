"""Agents that decide several times a second: gaits, evaluation, planner, training and policies."""

import numpy as np
import pytest

from later import Later
from refusals import assert_refused
from seastar_gym import Simulator
from seastar_gym.controllers.open_loop import scripted
from seastar_gym.envs.options import make_scene
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.gaits import lagged_gait, straight_gait, thrifty_gait, timed, turning_wave

ppo = Later("agents.ppo")


def speed_and_turn(gait, decision_period, seconds=6, scene=None):
    """Speed [m/s] and rate of turning [deg/s] over the last seconds, by fidelity "fast"."""
    simulator = Simulator(scene or make_scene(None, "fast", 0.5), 1, 1)
    for second in range(2 * seconds):
        if second == seconds:
            hub, heading = simulator.hub_position(), simulator.heading()
        for command in gait:
            simulator.advance(decision_period, command[None])
    turn = np.degrees(simulator.heading() - heading)[0] / seconds
    return np.linalg.norm(simulator.hub_position() - hub) / seconds, turn


# Gaits


def test_lagged_pairs_swim_farther_thrifty_ones_with_less_heat_and_the_wave_turns_on_the_spot():
    """7.4 and 7.6 mm/s at "balanced" (lag 0.6 s, and 0.5 s with 0.6 of the heat) against 3.3 mm/s of one pair."""
    together, _ = speed_and_turn(timed(straight_gait(), 0.5), 0.5)
    lagged, turn = speed_and_turn(lagged_gait(0.1), 0.1)
    thrifty, _ = speed_and_turn(thrifty_gait(0.5), 0.5)
    assert lagged > 2.0 * together and thrifty > 2.0 * together
    assert abs(turn) < 1e-3
    on_the_spot, turn = speed_and_turn(turning_wave(0.2), 0.2)
    assert turn < -9.0 and on_the_spot < 2e-3


@pytest.mark.parametrize("gait", ["lagged-pentagon", "pentagon"])
def test_gaits_in_time_round_the_pentagon(gait):
    (done,) = evaluate({"script": scripted(gait, decision_period=0.5)}, decision_period=0.5, fidelity="fast")
    assert done.finished and done.time[-1] == pytest.approx(0.5 * done.strokes)
    assert done.time[-1] < (120 if gait == "lagged-pentagon" else 260)
    assert done.heating_time.sum() == pytest.approx(0.1 * done.limbs_heated.sum())
    assert done.joules_per_metre == pytest.approx(7.6 * done.seconds_heated / done.hub_path_length)


# Training


def test_discount_and_time_limit_are_those_of_seconds():
    strokes, half = ppo.Hyperparameters(), ppo.Hyperparameters(decision_period=0.5)
    assert strokes.discount_per_decision == 0.8 and strokes.max_episode_steps == 400
    assert half.discount_per_decision == pytest.approx(0.8**0.5) and half.max_episode_steps == 800
    assert ppo.Hyperparameters(decision_period=1.0).discount_per_decision == 0.8
    small = ppo.Hyperparameters(decision_period=0.5, num_envs=4, rollout=4, batch_size=16, max_episode_time=5.0)
    env = ppo.make_training_env(small, "random", random_heading=True, fidelity="fast", threads=1)
    assert env.get_attr("max_episode_steps")[0] == 10
    assert ppo.make_model(env, small, seed=0).gamma == pytest.approx(0.8**0.5)
    for wrong in ({"actions": "continuous"}, {"batch_size": 7}, {"hidden": ()}, {"hidden": (2**20,) * 3}):
        with assert_refused(next(iter(wrong))):
            ppo.Hyperparameters(**wrong)
