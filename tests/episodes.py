"""Episodes that tests compare: all that an environment gives, and batches beside the same environments one by one."""

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

from seastar_gym import SolverStatus


def swum(env, n: int = 5, **reset) -> list:
    """Observations, rewards, ends and infos of random actions."""
    observation, info = env.reset(**{"seed": 3, **reset})
    env.action_space.seed(4)
    history = [observation, *info.values()]
    for _ in range(n):
        observation, *others, info = env.step(env.action_space.sample())
        history += [observation, *others, *info.values()]
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


def both(id: str, num_envs: int = 3, autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP, **arguments) -> tuple:
    """The native batch of an id, and Gymnasium's own of single environments."""
    arguments = {"fidelity": "fast"} | arguments
    batch = gym.make_vec(id, num_envs, "vector_entry_point", autoreset_mode=autoreset_mode, **arguments)
    return batch, gym.make_vec(id, num_envs, "sync", vector_kwargs={"autoreset_mode": autoreset_mode}, **arguments)


def assert_same_infos(found: dict, expected: dict) -> None:
    """Equal values and types wherever the sub-environments' infos have a value."""
    for key in [key for key in expected if key.startswith("_")]:
        name, mask = key.removeprefix("_"), expected[key]
        np.testing.assert_array_equal(found[key], mask, err_msg=name)
        if name in ("final_obs", "solver_message"):
            for one, other in zip(found[name][mask], expected[name][mask], strict=True):
                np.testing.assert_array_equal(one, other)
        elif name == "final_info":
            assert_same_infos(found[name], expected[name])
        else:
            assert found[name].dtype == expected[name].dtype, name
            np.testing.assert_array_equal(found[name][mask], expected[name][mask], err_msg=name)


def assert_same_steps(found: tuple, expected: tuple) -> None:
    for one, other in zip(found[:4], expected[:4], strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    assert_same_infos(found[4], expected[4])


def swim_together(batch, singles, n: int) -> None:
    """Assert that a batch gives all that its environments give one by one, for random actions."""
    (first, info), (expected, its_info) = (env.reset(seed=1) for env in (batch, singles))
    np.testing.assert_array_equal(first, expected)
    assert_same_infos(info, its_info)
    singles.action_space.seed(0)
    for _ in range(n):
        actions = singles.action_space.sample()
        assert_same_steps(batch.step(actions), singles.step(actions))
        np.testing.assert_array_equal(batch.call("action_masks"), singles.call("action_masks"))
