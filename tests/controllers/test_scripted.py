"""The scripted gaits do what the chapter says, in every action mode, alone and in batches."""

import hashlib
from typing import Any

import numpy as np
import pytest

from seastar_gym import HeadingTargets, Numerics, Scene, Simulator
from seastar_gym.controllers.scripted import GAITS, RandomPolicy, scripted, to_actions
from seastar_gym.controllers.turning import TurnThenSwim
from seastar_gym.envs.commands import action_space, command_table, to_commands
from seastar_gym.envs.layout import HEADINGS, Layout
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import transform_commands
from seastar_gym.evaluation.swim import swim
from seastar_gym.gaits import pentagon_gait, straight_gait, turning_wave

OBSERVATION = np.zeros(186, np.float32)
SECOND_ORDER = Scene(numerics=Numerics(scheme="sdirk2", step=10e-3))


def steps_of(commands, scene=SECOND_ORDER):
    """Hub positions [m] at rest and after every stroke, shape (n_strokes + 1, 2)."""
    simulator = Simulator(scene, threads=1)
    simulator.reset()
    hub = [simulator.hub_position()[0]]
    for command in commands:
        simulator.stroke(command[None])
        hub.append(simulator.hub_position()[0])
    return np.array(hub)


def strokes_of(policy, n_strokes, observation=OBSERVATION):
    """Actions of a number of strokes from the start."""
    actions, state = [], None
    for _ in range(n_strokes):
        action, state = policy.predict(observation, state)
        actions.append(action)
    return np.array(actions)


# The chapter's swims


def test_the_chapter_s_gaits_trace_a_regular_pentagon_that_closes_and_a_straight_line():
    sides = pentagon_gait().reshape(5, 50, 5)
    heated = [set((1 + np.flatnonzero(side[0])).tolist()) for side in sides]
    assert heated == [{2, 5}, {1, 3}, {2, 4}, {3, 5}, {1, 4}]  # (13.15)
    corners = steps_of(pentagon_gait())[::50]
    sides = np.diff(corners, axis=0)
    lengths = np.hypot(*sides.T)
    turns = np.degrees(np.diff(np.unwrap(np.arctan2(sides[:, 1], sides[:, 0]))))
    assert lengths.mean() == pytest.approx(0.1439, abs=2e-4)
    np.testing.assert_allclose(lengths, lengths.mean(), rtol=5e-4)
    np.testing.assert_allclose(turns, 72.0, atol=0.05)
    assert np.hypot(*corners[-1]) < 0.2e-3
    hub = steps_of(np.repeat(straight_gait(), 3, axis=0))
    assert np.all(np.diff(hub[:, 0]) > 3e-3)
    assert np.all(np.abs(hub[:, 1]) < 1e-10)


# Policies


SECONDS = (0.1, 0.2, 0.5)
PAIRS = ("pentagon", "straight", "rest", "4+,1-", "1-,4+", "{1-, 4+}")
NAMES = {
    **{f"{name}, every {s} s": {"name": name, "decision_period": s} for name in GAITS for s in SECONDS
       if (name, s) != ("wave", 0.5)},
    **{f"{name} in strokes": {"name": name} for name in PAIRS},
    **{f"{name} of {n} limbs": {"name": name, "n_limbs": n} for name, n in (("rest", 3), ("straight", 6))},
}  # fmt: skip
"""Arguments of gaits."""


def test_gaits_are_as_kept(golden):
    """First commands, a digest of all, and action modes; every other mode that has them means the same commands."""
    lines = []
    for title, given in NAMES.items():
        policy, n_limbs = scripted(**given), given.get("n_limbs", 5)
        n = len(policy._gait)
        commands = to_commands(policy.actions, n_limbs, strokes_of(policy, n + 3), n + 3)
        np.testing.assert_array_equal(commands[n:], commands[:n][np.arange(3) % n])  # it begins anew
        for mode in ("limbs", "joint", "pairs") if given["name"] in PAIRS else ():
            chosen = strokes_of(scripted(**given, actions=mode), n)
            assert all(action in action_space(mode, n_limbs) for action in chosen)
            np.testing.assert_array_equal(to_commands(mode, n_limbs, chosen, n), commands[:n])
        digest = hashlib.sha256((np.round(commands, 6) + 0.0).tobytes()).hexdigest()[:16]
        lines.append(f"{title}, {policy.actions}, {n} decisions, {digest}:")
        starts = [0, *(1 + np.flatnonzero((commands[1:n] != commands[: n - 1]).any(axis=1)))]
        lines += [f"  from {k}: {' '.join(f'{share:+.4g}' for share in commands[k])}" for k in starts[:10]]
    golden("gaits.txt", "\n".join(lines))


def test_random_actions_reach_every_choice_and_are_shares_in_continuous():
    for actions, n_choices in (("limbs", 3), ("joint", 243), ("pairs", 21)):
        found, state = scripted("random", actions).predict(np.zeros((1000, 186), np.float32))
        assert len(np.unique(found)) > 0.95 * n_choices and state is None
    rng, policy = np.random.default_rng(3), RandomPolicy(np.random.default_rng(3), "continuous", 4)
    for shape in ((3, 4), (4,)):
        action, _ = policy.predict(np.zeros((*shape[:-1], 7), np.float32))
        np.testing.assert_array_equal(action, rng.uniform(-1.0, 1.0, shape).astype(np.float32))
        assert action.dtype == np.float32
    shares = to_actions([[0.5, -0.25]], "continuous", 2)
    assert shares.dtype == np.float32 and shares.tolist() == [[0.5, -0.25]]


# An agent that turns to the asked heading by a gait, and swims once it has it.


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


def test_it_turns_by_the_gait_to_the_side_of_the_heading_and_then_swims():
    """Turning begins above nine tenths of the tolerance and ends below four; the swimmer sees nothing of headings."""
    assert commands_of(agent(), [-1.0] * 4) == [*CLOCKWISE.tolist(), CLOCKWISE[0].tolist()]
    mirrored = transform_commands(CLOCKWISE, 9)
    assert commands_of(agent(), [1.0] * 4) == [*mirrored.tolist(), mirrored[0].tolist()]
    assert mirrored[0].tolist() == [-1, 0, 0, 0, 1]  # limb 1 stays, and 2 becomes 5
    for side in (-1.0, 1.0):
        swimmer, lefts = Swimmer(), [0.179, 0.181, 0.1, 0.081, 0.079, 0.1, 0.179, 0.2]
        found = commands_of(agent(swimmer), [side * left for left in lefts])
        turns = [command != SWIMS.tolist() for command in found]
        assert turns == [False, True, True, True, False, False, False, True]
        assert found[1] == found[7]  # the gait begins anew
        np.testing.assert_array_equal(swimmer.shown[0], np.delete(seen(side * 0.179), AT.headings))
        assert len(swimmer.shown) == 4


@pytest.mark.parametrize("asked", [0.5, -0.5])
def test_a_robot_turns_to_the_side_that_is_asked_for_and_then_swims(asked):
    scene, headings = make_scene(None, "fast", 0.2), HeadingTargets(asked)
    policy = TurnThenSwim(turning_wave(0.2), scripted("rest", "pairs"), "pairs", scene, headings, 0.2)
    env = SeastarSwimEnv([[0.3, 0.0]], "joint", "fast", decision_period=0.2, headings=headings)
    done = swim("turn", policy, env, max_strokes=40)
    heated = done.limbs_heated > 0
    last = int(np.flatnonzero(heated)[-1])
    assert heated[:last].all() and 10 < last < 30 and not heated[last + 1 :].any()
    assert env._robots.facts()["heading"][0] == pytest.approx(asked, abs=headings.tolerance)
