"""The scripted gaits do what the chapter says, in every action mode, alone and in batches."""

import hashlib

import numpy as np
import pytest

from seastar_gym import Numerics, Scene, Simulator
from seastar_gym.controllers.open_loop import GAITS, RandomPolicy, scripted, to_actions
from seastar_gym.envs.commands import action_space, to_commands
from seastar_gym.gaits import pentagon_gait, straight_gait

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
