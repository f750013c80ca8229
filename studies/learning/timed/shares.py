"""Pulse widths: environments in which a learner heats wires for shares of a pulse."""

from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.commands import command_table

Floats = NDArray[np.float64]


def shares_of_pairs(n_limbs: int, shares: tuple[float, ...]) -> Floats:
    """Commands that heat no limb, or a pair of limbs for a share of a pulse, shape (n_actions, n_limbs)."""
    rest, pairs = np.split(command_table("pairs", n_limbs), [1])
    return np.concatenate([rest, *(share * pairs for share in shares)])


class ChosenCommands(gym.vector.VectorWrapper):
    """Batch with actions="continuous" whose action is the number of a row in a table of commands."""

    env: Any

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any], table: Floats):
        super().__init__(env)
        self.table = table
        self.single_action_space = gym.spaces.Discrete(len(table))
        self.action_space = gym.vector.utils.batch_space(self.single_action_space, env.num_envs)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One decision of every robot."""
        return self.env.step(self.table[actions])
