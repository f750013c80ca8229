"""A batch writes its results where it is told, the same numbers, and keeps nothing of what it returned."""

import gymnasium as gym
import numpy as np
import pytest

import seastar_gym  # noqa: F401
from refusals import assert_refused
from seastar_gym.envs.buffers import Buffers

N = 3


@pytest.fixture
def batches():
    """Two equal batches, whose episodes end after two strokes."""
    made = [
        gym.make_vec(
            "SeastarSwim-v0", N, vectorization_mode="vector_entry_point", fidelity="fast", max_episode_steps=2
        )
        for _ in range(2)
    ]
    for batch in made:
        batch.reset(seed=0)
    return made


def memory(steps, size, dtype=np.float32):
    """Memory of a learner, whose rows are the buffers of a step."""
    return Buffers(
        np.full((steps, N, size), np.nan, dtype), np.full((steps, N), np.nan, dtype), np.ones((steps, N), bool),
        np.ones((steps, N), bool),
    )  # fmt: skip


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_results_are_written_into_the_rows_of_a_memory(batches, dtype):
    plain, told = batches
    size = plain.single_observation_space.shape[0]
    rows = memory(3, size, dtype)
    for step in range(3):  # the second ends the episodes, the third begins new ones
        actions = np.tile([0, 1, 0, 0, 2], (N, 1))
        expected = plain.step(actions)
        row = Buffers(*(part[step] for part in rows))
        returned = told.step(actions, out=row)
        assert all(one is other for one, other in zip(returned[:4], row, strict=True))
        for part, right in zip(rows, expected[:4], strict=True):
            np.testing.assert_array_equal(part[step], right.astype(part.dtype))
        assert returned[4].keys() == expected[4].keys()
    assert rows.truncated.any(axis=1).tolist() == [False, True, False]


@pytest.mark.parametrize(
    "name, wrong",
    [
        ("observations", np.zeros((N, 5), np.float32)),
        ("rewards", np.zeros(N, bool)),
        ("rewards", [0.0] * N),
        ("terminated", np.zeros(N)),
        ("truncated", np.broadcast_to(False, N)),
    ],
)
def test_arrays_that_do_not_fit_are_refused_before_the_stroke(batches, name, wrong):
    batch, other = batches
    size = batch.single_observation_space.shape[0]
    fitting = Buffers(*(part[0] for part in memory(1, size)))
    with assert_refused(f"out.{name} must be a writeable array of"):
        batch.step(np.zeros((N, 5), int), out=fitting._replace(**{name: wrong}))
    np.testing.assert_array_equal(batch.step(np.zeros((N, 5), int))[0], other.step(np.zeros((N, 5), int))[0])
