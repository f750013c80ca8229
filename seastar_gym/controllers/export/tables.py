"""Tables of what a policy does around its network: what turns and mirrors make of observations and of actions.

All of them follow from `Symmetry` itself, applied to unit vectors, so that an exported policy knows no other rules.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.description import Description
from seastar_gym.envs.commands import LIMB_COMMANDS, command_table
from seastar_gym.envs.symmetry.symmetry import axis_of, n_turns_of

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]


class Sectors(NamedTuple):
    """Sectors of the current waypoint. n: Number of sectors. width: Of each [rad]. axis: Where they begin [rad].

    per_sector: Elements from one sector to the next. n_elements: Number of elements.
    """

    n: int
    width: float
    axis: float
    per_sector: int
    n_elements: int


def sectors_of(description: Description) -> Sectors:
    """Sectors of a policy; one of all directions for a policy without symmetry."""
    reduction = description.reduction
    if reduction is None:
        return Sectors(1, 2.0 * np.pi, 0.0, 1, 1)
    axis, n_turns = axis_of(reduction.group), n_turns_of(reduction.group)
    per_sector = 2 if axis is None else 1
    return Sectors(2 * n_turns // per_sector, per_sector * np.pi / n_turns, axis or 0.0, per_sector, 2 * n_turns)


def carried(description: Description) -> NDArray[np.float32]:
    """Matrices that observations, as rows, are multiplied with, for every element, shape (n_elements, size, size)."""
    reduction, unit = description.reduction, np.eye(description.observation_size, dtype=np.float32)
    if reduction is None:
        return unit[None]
    n = sectors_of(description).n_elements
    return np.stack([reduction.carry(unit, np.full(len(unit), element)) for element in range(n)])


def told(description: Description) -> Integers:
    """Places of the numbers that the network sees of every past observation."""
    return np.zeros(0, np.intp) if description.frame_stack is None else description.frame_stack.features


def restored(description: Description) -> tuple[Integers, Integers]:
    """Actions of the robot as it is, from those of the network, for every element.

    Returns the place of every number of an action, shape (n_elements, n_numbers), and what every choice becomes,
    shape (n_elements, n_choices).
    """
    (n_numbers, n_choices), reduction = description.distributions, description.reduction
    n = sectors_of(description).n_elements
    if reduction is None:
        return np.arange(n_numbers)[None], np.arange(n_choices)[None]
    if description.actions != "limbs":
        every = np.arange(n_choices)
        return np.zeros((n, 1), np.intp), np.stack([reduction.restore(every, np.full(n_choices, e)) for e in range(n)])
    of_one = np.eye(n_numbers, dtype=np.intp)
    every = np.repeat(np.arange(n_choices)[:, None], n_numbers, axis=1)
    places = [(reduction.restore(of_one, np.full(n_numbers, e)) != 0).argmax(axis=1) for e in range(n)]
    return np.stack(places), np.stack([reduction.restore(every, np.full(n_choices, e))[:, 0] for e in range(n)])


def commands(description: Description) -> Floats:
    """Commands of every choice: of all limbs, shape (n_choices, n_limbs), or with actions="limbs" of one, (3, 1)."""
    if description.actions == "limbs":
        return LIMB_COMMANDS[:, None]
    return command_table(description.actions, description.scene.robot.n_limbs)
