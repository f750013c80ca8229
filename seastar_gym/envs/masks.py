"""Masks: actions that wires can follow now, and commands to wires that cannot.

A mask is true for actions that are followed as a whole, in the form that sb3-contrib's MaskablePPO takes:

actions         shape of a robot's mask    true where
"limbs"         (3 n_limbs,)               limb after limb, its actions 0, 1 (+), 2 (-) are followed
"joint/pairs"   (n_actions,)               all wires of the action's command can be heated
"continuous"    (2 n_limbs,)               limb after limb, its wires + and - can be heated

`sampling_mask` has them in Gymnasium's own form.
"""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from seastar_gym.envs.commands import LIMB_COMMANDS, Actions, command_table
from seastar_gym.scene.actuators.actuator import Actuator, complete

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


def can_be_masked(actuator: Actuator) -> bool:
    """Whether an actuator ever has wires that cannot be heated."""
    return complete(actuator).can_be_refractory


def action_masks(actions: Actions, refractory: Mask) -> Mask:
    """Masks of the robots' actions, shape (n_robots, k).

    refractory: As `Simulator.refractory_wires`, shape (n_robots, n_limbs, 2).
    """
    n_robots, n_limbs, _ = refractory.shape
    if actions == "continuous":
        return ~refractory.reshape(n_robots, -1)
    if actions == "limbs":
        return np.concatenate([np.ones((n_robots, n_limbs, 1), bool), ~refractory], axis=-1).reshape(n_robots, -1)
    return np.asarray(~masked_limbs(command_table(actions, n_limbs), refractory[:, None]).any(axis=-1))


def sampling_mask(space: spaces.Space[Any], mask: NDArray[Any]) -> Any:
    """A robot's mask in the form that `space.sample(mask=...)` of Gymnasium takes; None for continuous actions.

    space: Of one robot's actions. mask: As its `action_masks`, shape (k,).
    """
    if isinstance(space, spaces.Box):
        return None
    numbers = np.asarray(mask, np.int8)
    return numbers if isinstance(space, spaces.Discrete) else tuple(numbers.reshape(-1, len(LIMB_COMMANDS)))


def masked_limbs(commands: Floats, refractory: Mask) -> Mask:
    """Limbs whose wire cannot follow its command, shape (..., n_limbs). refractory: Shape (..., n_limbs, 2)."""
    return ((commands > 0.0) & refractory[..., 0]) | ((commands < 0.0) & refractory[..., 1])
