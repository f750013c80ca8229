"""Episodes that tests compare: all that an environment gives, and batches beside the same environments one by one."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from seastar_gym import SolverStatus, SymmetryReduction, VectorSymmetryReduction

SHORT = [[0.004, 0.0], [0.009, 0.0]]
"""Path that some strokes swim, with a radius of 8.5 mm even by chance."""


def swum(env, n: int = 5, **reset) -> list:
    """Observations, rewards, ends and infos of random actions."""
    observation, info = env.reset(**{"seed": 3, **reset})
    return [observation, *info.values(), *goes_on(env, n)]


def goes_on(env, n: int) -> list:
    """What follows in an episode, and in the next where it ends."""
    history = []
    env.action_space.seed(4)
    for _ in range(n):
        observation, *others, info = env.step(env.action_space.sample())
        history += [observation, *others, *info.values()]
        if others[1] or others[2]:
            observation, info = env.reset()
            history += [observation, *info.values()]
    return history


def assert_same(ours, theirs) -> None:
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(one, other)


def break_robot(env, status: SolverStatus = SolverStatus.NOT_CONVERGED, robot: int = 0) -> None:
    """Put all nodes of a robot into one point, where no angle is defined, or write a coordinate that is no number."""
    if status == SolverStatus.NOT_FINITE:
        env.simulator.q[0, 7, robot] = np.nan
        return
    state = env.simulator.get_state()
    state.positions[robot] = 0.02
    env.simulator.set_state(state)


def both(
    id: str, num_envs: int = 3, mode: AutoresetMode = AutoresetMode.NEXT_STEP, reduced=False, threads=None, **options
) -> tuple:
    """The native batch of an id, and Gymnasium's own of single environments; `reduced`: both behind the symmetry."""
    batch = gym.make_vec(id, num_envs, "vector_entry_point", autoreset_mode=mode, threads=threads, **options)
    more = {"wrappers": [SymmetryReduction]} if reduced else {}
    singles = gym.make_vec(id, num_envs, "sync", vector_kwargs={"autoreset_mode": mode}, **more, **options)
    return VectorSymmetryReduction(batch) if reduced else batch, singles


def assert_same_infos(found: dict, expected: dict, rounded: tuple[str, ...] = ()) -> None:
    """Equal values and types wherever the sub-environments' infos have a value, but for the rounding of some."""
    for key in [key for key in expected if key.startswith("_")]:
        name, mask = key.removeprefix("_"), expected[key]
        np.testing.assert_array_equal(found[key], mask, err_msg=name)
        if name == "final_obs":
            for one, other in zip(found[name][mask], expected[name][mask], strict=True):
                np.testing.assert_array_equal(one, other)
        elif name == "final_info":
            assert_same_infos(found[name], expected[name], rounded)
        else:
            assert found[name].dtype == expected[name].dtype, name
            tolerance = 1e-14 if name in rounded else 0.0
            np.testing.assert_allclose(found[name][mask], expected[name][mask], tolerance, 0.0, err_msg=name)


def assert_same_steps(found: tuple, expected: tuple, rounded: tuple[str, ...] = ()) -> None:
    for one, other in zip(found[:-1], expected[:-1], strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    assert_same_infos(found[-1], expected[-1], rounded)


def swim_together(batch, singles, n: int, broken: SolverStatus | None = None, rounded=()) -> list[tuple]:
    """Assert that a batch gives all that its environments give one by one, for random actions; returns its steps.

    broken: How robot 1 fails in the last step but two. rounded: Entries of info that are equal but for rounding.
    """
    over, steps = np.zeros(batch.num_envs, bool), []
    begun = [env.reset(seed=1) for env in (batch, singles)]
    assert_same_steps(*begun)
    singles.action_space.seed(0)
    for k in range(n):
        actions = singles.action_space.sample()
        if batch.metadata["autoreset_mode"] is AutoresetMode.DISABLED and over.any():
            with pytest.raises(gym.error.ResetNeeded, match="reset_mask"):
                batch.step(actions)
            assert_same_steps(*(env.reset(options={"reset_mask": over.copy()}) for env in (batch, singles)))
        if broken is not None and k == n - 3:
            break_robot(batch.unwrapped, broken, 1), break_robot(singles.envs[1].unwrapped, broken)
        steps.append(batch.step(actions))
        assert_same_steps(steps[-1], singles.step(actions), rounded)
        over = steps[-1][2] | steps[-1][3]
        assert_same_shapes(steps[-1][-1], begun[0][1])
        np.testing.assert_array_equal(batch.action_masks(), singles.call("action_masks"))
        if batch.render_mode is not None:
            assert_same(batch.render(), singles.render())
    return steps


def assert_same_shapes(info: dict, first: dict) -> None:
    """An info has the names, types and shapes of the first one, and so have those that it keeps of ended episodes."""
    names = [name for name in info if "final" not in name]
    assert names == list(first)
    for name in names:
        assert (info[name].dtype, info[name].shape) == (first[name].dtype, first[name].shape), name
    if "final_info" in info:
        assert_same_shapes(info["final_info"], first)
