"""Policies of learners that see what a symmetry has reduced."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy
from seastar_gym.envs.symmetry import Symmetry


class ReducedPolicy:
    """Policy for the plain environment, from the model that a learner behind the symmetry reduction has learned.

    symmetry: Of the robot, with the environment's actions.
    table: Commands that the model's actions are the numbers of. None means that they are the environment's.
    """

    def __init__(self, model: Policy, symmetry: Symmetry, table: NDArray[np.float64] | None = None):
        self.model, self.symmetry, self.table, self.actions = model, symmetry, table, symmetry.actions

    def predict(
        self, observation: NDArray[Any], state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[NDArray[Any], None]:
        """Actions for observations of shape (size,) or (n, size), and None: the policy has no state."""
        reduced, elements = self.symmetry.reduce(observation)
        chosen, _ = self.model.predict(reduced.astype(np.float32), None, None, deterministic)
        return self.symmetry.restore(chosen if self.table is None else self.table[chosen], elements), None
