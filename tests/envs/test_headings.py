"""Headings at waypoints: asked, met, seen, rewarded, carried by symmetry, drawn and refused."""

import math

import numpy as np
import pytest

from seastar_gym import HeadingTargets, RewardWeights
from seastar_gym.envs.layout import HEADINGS, Layout
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.stations import body_heading
from seastar_gym.gaits import turning_wave

AT = Layout(5, 2, HEADINGS)
CORNERS = [[0.05, 0.0], [0.05, 0.05], [0.0, 0.0]]


def turning(asked, **arguments):
    """Environment whose only waypoint is already near, so that the heading alone is left; decisions of 0.2 s."""
    return SeastarSwimEnv(
        [[0.005, 0.0]], "continuous", "fast", waypoint_radius=0.05, decision_period=0.2,
        headings=HeadingTargets(asked, 0.1), **arguments,
    )  # fmt: skip


def wave(env, n):
    """Infos of decisions of the turning wave, clockwise, until the episode ends."""
    infos, commands = [], turning_wave(0.2)
    for k in range(n):
        *_, over, _, info = env.step(commands[k % len(commands)].astype(np.float32))
        infos.append(info)
        if over:
            break
    return infos


def test_a_waypoint_is_reached_only_with_its_heading():
    env = turning(-0.4)
    _, info = env.reset(seed=0)
    assert info["distance"] < 0.05 and info["waypoint_index"] == 0
    infos = wave(env, 60)
    assert infos[-1]["is_success"] and abs(infos[-1]["heading_error"]) <= 0.1 and len(infos) > 5
    assert not any(info["is_success"] for info in infos[:-1])
    assert all(info["distance"] < 0.05 and abs(info["heading_error"]) > 0.1 for info in infos[:-1])


def test_a_heading_that_is_met_is_no_obstacle_and_is_that_of_the_body_frame():
    env = turning((0.05,))
    env.reset(seed=0)
    assert env.step(np.zeros(5, np.float32))[2]
    env = turning("random")
    env.reset(seed=0)
    heading = wave(env, 7)[-1]["heading"]
    assert heading == pytest.approx(body_heading(env.simulator.positions, env.scene.robot)[0], abs=1e-12)
    assert heading < -0.1


def test_turns_are_seen_and_on_the_last_leg_the_next_is_the_current_one():
    seen = turning(1.0).reset(seed=0)[0][AT.headings]
    np.testing.assert_array_equal(seen[:2], seen[2:])
    env = SeastarSwimEnv(CORNERS, "pairs", "fast", decision_period=0.5, headings=HeadingTargets((0.3, -3.0, 2.0)))
    observation, info = env.reset(seed=0)
    expected = [math.cos(0.3), math.sin(0.3), math.cos(-3.0), math.sin(-3.0)]
    np.testing.assert_allclose(observation[AT.headings], expected, atol=1e-6)
    plain = SeastarSwimEnv(CORNERS, "pairs", "fast", decision_period=0.5)
    np.testing.assert_array_equal(np.delete(observation, AT.headings), plain.reset(seed=0)[0])
    observation, *_, info = env.step(7)
    seen = np.arctan2(observation[AT.headings][1], observation[AT.headings][0])
    assert seen == pytest.approx(info["heading_error"], abs=1e-6) == pytest.approx(0.3 - info["heading"], abs=1e-6)
    np.testing.assert_array_equal(np.delete(observation, AT.headings), plain.step(7)[0])


def test_the_reward_is_the_decrease_of_what_is_left_to_turn():
    asked = {"headings": HeadingTargets((0.3, -3.0, 2.0)), "reward": RewardWeights(heading=3.0)}
    env = SeastarSwimEnv(CORNERS, "pairs", "fast", decision_period=0.5, **asked)
    _, info = env.reset(seed=0)
    assert info["reward_heading"] == 0.0
    left = [0.3 + (2.0 * math.pi - 3.3) + (2.0 * math.pi - 5.0)]
    env.action_space.seed(1)
    for _ in range(5):
        *_, info = env.step(env.action_space.sample())
        left.append(abs(info["heading_error"]) + left[0] - 0.3)
        assert info["reward_heading"] == pytest.approx(3.0 * (left[-2] - left[-1]), abs=1e-9)
    assert len({round(one, 6) for one in left}) > 3


def test_a_reached_waypoint_leaves_the_turns_after_it():
    """Passing on costs or earns no more than the tolerance."""
    path, headings = [[0.001, 0.0], [0.3, 0.0]], HeadingTargets((0.1, 1.1), 0.2)
    env = SeastarSwimEnv(path, "pairs", "fast", decision_period=0.5, headings=headings)
    env.reset(seed=0)
    info = env.step(0)[4]
    assert info["waypoint_index"] == 1 and info["heading_error"] == pytest.approx(1.1)
    assert info["reward_heading"] == pytest.approx(8.0 * (0.1 + 1.0 - 1.1), abs=1e-9)


def test_headings_are_along_the_legs_or_drawn():
    env = SeastarSwimEnv(CORNERS, fidelity="fast", headings=HeadingTargets())
    env.reset(seed=0)
    np.testing.assert_allclose(env.task.headings_of(env._robots, 0), [0.0, np.pi / 2, -0.75 * np.pi])
    env = SeastarSwimEnv(CORNERS, fidelity="fast", headings=HeadingTargets("random"))
    drawn = [env.reset(seed=seed) and env.task.headings_of(env._robots, 0) for seed in (5, None, 5)]
    np.testing.assert_array_equal(drawn[0], drawn[2])
    plain = SeastarSwimEnv()
    assert len(np.unique([*drawn[0], *drawn[1]])) == 6 and plain.task.headings_of(plain._robots, 0) is None
