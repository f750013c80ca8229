"""The native batch as RLlib's environment. RLlib itself is not needed."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from seastar_gym.adapters.rllib import OfRunner, native_batch
from seastar_gym.envs.symmetry import VectorSymmetryReduction

CONTEXT = {"num_envs": 4, "path": "random", "actions": "pairs", "fidelity": "fast", "random_heading": True}


def test_a_runner_s_batch_is_reduced_if_that_is_asked_for():
    plain, reduced = native_batch(CONTEXT), native_batch({**CONTEXT, "symmetry": True})
    assert isinstance(plain, OfRunner) and isinstance(reduced.env, VectorSymmetryReduction)
    assert reduced.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert reduced.single_action_space.n == 21
    first, info = reduced.reset(seed=0)
    assert first.shape == (4, *reduced.single_observation_space.shape) and info == {}
    reduced.action_space.seed(0)
    *results, info = reduced.step(reduced.action_space.sample())
    assert info == {} and all(len(result) == 4 for result in results)
    with pytest.raises(ValueError, match="colour"):
        native_batch({**CONTEXT, "colour": "red"})


def test_runners_with_neighbouring_seeds_have_no_robot_in_common():
    """RLlib gives its env runners the seeds seed + 1, seed + 2, .."""
    batches = [native_batch(CONTEXT) for _ in range(3)]
    observations = [batch.reset(seed=7 + k)[0] for k, batch in enumerate(batches, start=1)]
    assert len(np.unique(np.concatenate(observations), axis=0)) == 12
    again, _ = batches[0].reset(seed=8)
    np.testing.assert_array_equal(again, observations[0])
