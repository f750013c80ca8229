"""Memory of past observations: in the same limbs throughout, and for one episode."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from refusals import assert_refused
from seastar_gym.envs.headings import HeadingTargets
from seastar_gym.envs.symmetry import VectorFrameStack, VectorSymmetryReduction
from seastar_gym.envs.tasks.envs import SeastarTaskVectorEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv


def batch(task, n=6, **arguments):
    return SeastarTaskVectorEnv(n, 400, task, fidelity="fast", threads=1, **arguments)


@pytest.mark.parametrize(
    "task, period",
    [("miswired", 1.0), ("station", 0.5), ("prey", 1.0), ("fail-blind", 1.0), ("obst-trap", 0.5), ("sim-to-real", 0.2)],
)
def test_memory_shows_the_reduced_observation_and_the_past_in_the_same_limbs(task, period):
    def new():
        return batch(task, actions="joint", decision_period=period)

    memory, reduced = VectorFrameStack(new(), 2), VectorSymmetryReduction(new())
    (shown, _), (ours, _) = memory.reset(seed=1), reduced.reset(seed=1)
    assert shown.shape == memory.observation_space.shape
    rng, size, past = np.random.default_rng(0), ours.shape[1], [memory._latest, memory._latest]
    for _ in range(4):
        np.testing.assert_array_equal(shown[:, :size], ours)
        past, actions = [memory._latest, past[0]], rng.integers(0, 243, 6)
        shown, ours = memory.step(actions)[0], reduced.step(actions)[0]
        seen = memory.frame_stack
        for before, told in zip(past, np.moveaxis(shown[:, size:].reshape(6, 2, -1), 1, 0), strict=True):
            carried = seen.symmetry.carry(before, memory._elements)
            np.testing.assert_array_equal(told, carried[:, seen.features])


def test_memory_ends_with_the_episode_and_the_last_observation_still_has_it():
    inner = SeastarTaskVectorEnv(2, 2, "prey", fidelity="fast", threads=1, autoreset_mode=AutoresetMode.SAME_STEP)
    memory = VectorFrameStack(inner, 3)
    memory.reset(seed=0)
    memory.step(np.array([3, 4]))
    shown, _, _, truncated, info = memory.step(np.array([5, 6]))
    assert truncated.all() and info["final_obs"][0].shape == shown[0].shape
    now = shown[:, :186][:, memory.frame_stack.features]
    np.testing.assert_array_equal(shown[:, 186:].reshape(2, 3, -1), np.repeat(now[:, None], 3, axis=1))
    last = info["final_obs"][1]
    assert not np.array_equal(last[186:].reshape(3, -1)[0], last[:186][memory.frame_stack.features])


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_no_memory_goes_from_one_episode_into_the_next(mode):
    """Robots whose episodes end at different times: the past of a new one is its first observation."""
    memory = VectorFrameStack(batch("prey", 3, autoreset_mode=mode), 2)
    memory.unwrapped.max_episode_steps = 3
    memory.reset(seed=0)
    seen, size = memory.frame_stack, memory.frame_stack.layout.size
    began, ended = 0, np.zeros(3, bool)
    for step in range(9):
        shown, _, terminated, truncated, _ = memory.step(np.full(3, step % 21))
        over = terminated | truncated
        begun = over if mode == AutoresetMode.SAME_STEP else ended
        for robot in np.flatnonzero(begun):
            now, past = shown[robot, :size][seen.features], shown[robot, size:].reshape(2, -1)
            np.testing.assert_array_equal(past, np.stack([now, now]))
            began += 1
        ended = over
    assert began >= 3


def test_a_reset_of_some_robots_leaves_the_others_memory():
    memory = VectorFrameStack(batch("prey", 2, autoreset_mode=AutoresetMode.DISABLED), 2)
    memory.reset(seed=0)
    for action in (3, 4, 5):
        shown = memory.step(np.array([action, action]))[0]
    again, _ = memory.reset(seed=1, options={"reset_mask": np.array([True, False])})
    np.testing.assert_array_equal(again[1], shown[1])
    now = again[0, : memory.frame_stack.layout.size][memory.frame_stack.features]
    np.testing.assert_array_equal(again[0, memory.frame_stack.layout.size :].reshape(2, -1), np.stack([now, now]))


def test_masks_are_those_of_the_robots_that_are_shown():
    """Wires that are still hot may not be heated again; robots with their limbs renamed have their masks renamed."""

    def new():
        return SeastarSwimVectorEnv(4, 50, fidelity="fast", actions="pairs", decision_period=0.2, threads=1)

    memory, reduced = VectorFrameStack(new(), 1), VectorSymmetryReduction(new())
    (_, info), (_, others) = memory.reset(seed=0), reduced.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(5):
        actions = rng.integers(0, 21, 4)
        info, others = memory.step(actions)[-1], reduced.step(actions)[-1]
        np.testing.assert_array_equal(memory.action_masks(), reduced.action_masks())
        assert ("action_mask" in info) == ("action_mask" in others)


def test_what_cannot_be_remembered_is_refused():
    with assert_refused("past must be"):
        VectorFrameStack(batch("prey"), 0)
    with assert_refused("Asked headings have no place"):
        VectorFrameStack(SeastarSwimVectorEnv(1, 50, fidelity="fast", headings=HeadingTargets(), threads=1), 2)
