"""An agent that turns to the asked heading by a gait, and swims once it has it."""

from typing import Any

import numpy as np
import pytest

from seastar_gym import HeadingTargets, Scene
from seastar_gym.controllers.turning import TurnThenSwim
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.layout import HEADINGS, Layout
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import transform_commands
from seastar_gym.evaluation.swim import swim
from seastar_gym.gaits import turning_wave

AT = Layout.of(Scene(), entries=HEADINGS)
CLOCKWISE = np.array([[1, -1, 0, 0, 0], [0, 0, 1, -1, 0], [0, 0, 0, 0, 1]], float)
SWIMS = np.array([0, 1, 0, 0, -1], float)


class Swimmer:
    """Policy of pairs that swims straight, and keeps what it was shown."""

    def __init__(self) -> None:
        self.shown: list[Any] = []

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert deterministic
        self.shown.append(observation)
        return np.int64((command_table("pairs", 5) == SWIMS).all(axis=1).argmax()), None


def seen(left: float) -> np.ndarray:
    """Observation of a robot that has to turn by so much [rad]."""
    numbers = np.random.default_rng(0).normal(size=AT.size).astype(np.float32)
    numbers[AT.headings] = np.cos(left), np.sin(left), 1.0, 0.0
    return numbers


def agent(swimmer: Swimmer | None = None) -> TurnThenSwim:
    return TurnThenSwim(CLOCKWISE, swimmer or Swimmer(), "pairs", Scene(), HeadingTargets(tolerance=0.2), 0.5)


def commands_of(policy: TurnThenSwim, lefts: list[float]) -> list[list[float]]:
    """Commands of decisions, one after the other, with so much left to turn [rad]."""
    state, found = None, []
    for left in lefts:
        action, state = policy.predict(seen(left), state)
        found.append(command_table("joint", 5)[action].tolist())
    return found


def test_it_turns_by_the_gait_to_the_side_where_the_heading_lies():
    assert commands_of(agent(), [-1.0] * 4) == [*CLOCKWISE.tolist(), CLOCKWISE[0].tolist()]
    mirrored = transform_commands(CLOCKWISE, 9)
    assert commands_of(agent(), [1.0] * 4) == [*mirrored.tolist(), mirrored[0].tolist()]
    assert mirrored[0].tolist() == [-1, 0, 0, 0, 1]  # limb 1 stays, and 2 becomes 5


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_turning_begins_above_nine_tenths_of_the_tolerance_and_ends_below_four_tenths(side):
    lefts = [0.179, 0.181, 0.1, 0.081, 0.079, 0.1, 0.179, 0.2]
    found = commands_of(agent(), [side * left for left in lefts])
    assert [command != SWIMS.tolist() for command in found] == [False, True, True, True, False, False, False, True]
    assert found[1] == found[7]  # the gait begins anew


def test_the_swimmer_sees_nothing_of_headings():
    swimmer = Swimmer()
    commands_of(agent(swimmer), [0.1, 1.0])
    (shown,) = swimmer.shown
    np.testing.assert_array_equal(shown, np.delete(seen(0.1), AT.headings))


class Resting:
    """Swimmer that rests; it sees observations without headings."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert observation.shape == (196,)
        return 0, None


@pytest.mark.parametrize("asked", [0.5, -0.5])
def test_a_robot_turns_to_the_side_that_is_asked_for_and_then_swims(asked):
    scene, headings = make_scene(None, "fast", 0.2), HeadingTargets(asked)
    policy = TurnThenSwim(turning_wave(0.2), Resting(), "pairs", scene, headings, 0.2)
    env = SeastarSwimEnv([[0.3, 0.0]], "joint", "fast", decision_period=0.2, headings=headings)
    done = swim("turn", policy, env, max_strokes=40)
    heated = done.limbs_heated > 0
    last = int(np.flatnonzero(heated)[-1])
    assert heated[:last].all() and 10 < last < 30 and not heated[last + 1 :].any()
    assert env._task.facts()["heading"][0] == pytest.approx(asked, abs=headings.tolerance)
