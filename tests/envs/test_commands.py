"""Actions mean what the table in the environment's docstring says, and what is no action is refused."""

import itertools

import numpy as np
import pytest
from gymnasium import spaces

from seastar_gym.envs.commands import LIMB_COMMANDS, action_space, command_table, to_commands


def test_a_limb_is_left_alone_actuated_anticlockwise_or_actuated_clockwise():
    assert LIMB_COMMANDS.tolist() == [0.0, 1.0, -1.0]


@pytest.mark.parametrize("n_limbs", [3, 5, 6])
def test_spaces_are_the_documented_ones(n_limbs):
    assert action_space("limbs", n_limbs) == spaces.MultiDiscrete([3] * n_limbs)
    assert action_space("joint", n_limbs) == spaces.Discrete(3**n_limbs)
    assert action_space("pairs", n_limbs) == spaces.Discrete(1 + n_limbs * (n_limbs - 1))


@pytest.mark.parametrize("n_limbs", [3, 5])
def test_joint_table_lists_every_command_once_beginning_with_rest(n_limbs):
    table = command_table("joint", n_limbs)
    assert table.shape == (3**n_limbs, n_limbs)
    assert {tuple(row) for row in table} == set(itertools.product([0.0, 1.0, -1.0], repeat=n_limbs))
    assert not table[0].any()
    # Limb 1 varies slowest, each limb in the order 0, +, -.
    np.testing.assert_array_equal(table[1], [0.0] * (n_limbs - 1) + [1.0])
    np.testing.assert_array_equal(table[-1], [-1.0] * n_limbs)


@pytest.mark.parametrize("n_limbs", [3, 5])
def test_pairs_table_lists_rest_and_every_plus_minus_pair_once(n_limbs):
    table = command_table("pairs", n_limbs)
    assert not table[0].any()
    assert np.all((table[1:] == 1.0).sum(axis=1) == 1) and np.all((table[1:] == -1.0).sum(axis=1) == 1)
    assert np.all(np.abs(table[1:]).sum(axis=1) == 2.0)
    assert len({tuple(row) for row in table}) == len(table) == 1 + n_limbs * (n_limbs - 1)


def test_tables_cannot_be_changed():
    """Every environment reads the same one."""
    table = command_table("pairs", 5)
    with pytest.raises(ValueError, match="read-only"):
        table[0, 0] = 1.0
    assert command_table("pairs", 5) is table


def test_actions_become_commands():
    limbs = to_commands("limbs", 5, [[0, 1, 2, 0, 1], [2, 2, 2, 2, 2]], 2)
    assert limbs.tolist() == [[0.0, 1.0, -1.0, 0.0, 1.0], [-1.0] * 5]
    for actions in ("joint", "pairs"):
        np.testing.assert_array_equal(to_commands(actions, 5, np.array([3, 0]), 2), command_table(actions, 5)[[3, 0]])


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int32, np.int64])
def test_any_whole_number_type_is_an_action(dtype):
    assert to_commands("joint", 5, np.array([7], dtype), 1).shape == (1, 5)


@pytest.mark.parametrize("actions", ["limbs", "joint", "pairs", "continuous"])
def test_every_sampled_action_is_accepted(actions):
    space = action_space(actions, 4)
    space.seed(0)
    for _ in range(50):
        assert np.abs(to_commands(actions, 4, np.asarray(space.sample())[None], 1)).max() <= 1.0


@pytest.mark.parametrize(
    "actions, action",
    [
        ("limbs", np.zeros((2, 5))),
        ("limbs", np.full((2, 5), np.nan)),
        ("limbs", np.zeros((2, 5), bool)),
        ("limbs", np.zeros((2, 4), int)),
        ("limbs", np.zeros((1, 5), int)),
        ("limbs", np.zeros(5, int)),
        ("limbs", np.zeros((2, 5, 1), int)),
        ("limbs", None),
        ("limbs", "left"),
        ("joint", np.zeros((2, 5), int)),
        ("joint", np.array([0.0, 1.0])),
        ("joint", 3),
        ("pairs", np.zeros(3, int)),
        ("pairs", [None, 1]),
    ],
)
def test_actions_of_another_shape_or_kind_are_refused_with_a_sentence(actions, action):
    with pytest.raises(ValueError, match=rf'^With actions="{actions}" the actions of 2 robot.*\.$'):
        to_commands(actions, 5, action, 2)


@pytest.mark.parametrize("actions, largest", [("limbs", 2), ("joint", 242), ("pairs", 20)])
def test_actions_beyond_the_last_are_refused_with_a_sentence(actions, largest):
    shape = (2, 5) if actions == "limbs" else (2,)
    for bad in (largest + 1, -1, 10**12):
        action = np.zeros(shape, int)
        action[1] = bad
        with pytest.raises(ValueError, match=rf'^With actions="{actions}" an action is from 0 to {largest}, .*\.$'):
            to_commands(actions, 5, action, 2)
