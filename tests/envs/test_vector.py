"""What a native batch offers besides the bits of single environments, which test_conformance.py is about."""

import copy

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from episodes import SHORT, assert_same_steps
from refusals import assert_refused
from seastar_gym import Numerics, Scene, Seastar
from seastar_gym.envs.vector import Buffers, SeastarSwimVectorEnv

ID = "SeastarSwim-v0"


def native(num_envs=3, **arguments) -> SeastarSwimVectorEnv:
    arguments = {"fidelity": "fast"} | arguments
    return gym.make_vec(ID, num_envs, "vector_entry_point", **arguments)


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_nothing_that_was_returned_changes_later_and_what_a_caller_does_to_it_changes_no_robot(mode):
    meddled, left = (native(path=SHORT, max_episode_steps=2, autoreset_mode=mode) for _ in range(2))
    meddled.reset(seed=0)
    returned, kept, actions = [left.reset(seed=0)], [], np.ones((3, 5), int)
    for _ in range(5):
        kept.append(copy.deepcopy(returned[-1]))
        found, expected = meddled.step(actions), left.step(actions)
        assert_same_steps(found, expected)
        returned.append(expected)
        for array in found[:4]:
            array[:] = True
        for name, array in found[4].items():
            if not isinstance(array, dict):
                array[:] = not name.startswith("_")
    for before, after in zip(kept, returned, strict=False):
        assert_same_steps(after, before)
    assert actions.min() == 1


# What a vector environment of Gymnasium offers


def test_every_robot_has_its_own_scene_and_promise():
    """Its generator, too: test_conformance.py."""
    scene = Scene(Seastar(youngs_modulus=np.array([1e6, 2e6, 3e6])), numerics=Numerics.preset("fast"))
    own = SeastarSwimVectorEnv(3, scene=scene).get_attr("scene")
    assert [one.robot.youngs_modulus for one in own] == [1e6, 2e6, 3e6]
    alike = native()
    alike.reset(seed=0)
    alike.simulator.set_limb_strengths([[1.0] * 5, [0.5] * 5, [1.0] * 5])
    assert np.isnan(alike.step(np.ones((3, 5), int))[4]["path_error"]).tolist() == [False, True, False]


# A batch writes its results where it is told.


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_results_are_written_into_the_rows_of_a_memory_and_what_does_not_fit_is_refused_before_the_stroke(dtype):
    plain, told = (native(max_episode_steps=2) for _ in range(2))
    for batch in (plain, told):
        batch.reset(seed=0)
    size = plain.single_observation_space.shape[0]
    rows = Buffers(*(np.full(shape, np.nan, dtype) for shape in ((3, 3, size), (3, 3))), *np.ones((2, 3, 3), bool))
    wrong = {
        "observations": np.zeros((3, 5), dtype), "rewards": np.zeros(3, bool), "terminated": np.zeros(3),
        "truncated": np.broadcast_to(False, 3),
    }  # fmt: skip
    actions = np.tile([0, 1, 0, 0, 2], (3, 1))
    for step in range(3):  # the second ends the episodes, the third begins new ones
        row = Buffers(*(part[step] for part in rows))
        for name, array in [*wrong.items(), ("rewards", [0.0] * 3)]:
            with assert_refused(f"out.{name} must be a writeable array of"):
                told.step(actions, out=row._replace(**{name: array}))
        expected, returned = plain.step(actions), told.step(actions, out=row)
        assert all(one is other for one, other in zip(returned[:4], row, strict=True))
        for part, right in zip(rows, expected[:4], strict=True):
            np.testing.assert_array_equal(part[step], right.astype(part.dtype))
        assert returned[4].keys() == expected[4].keys()
    assert rows.truncated.any(axis=1).tolist() == [False, True, False]
