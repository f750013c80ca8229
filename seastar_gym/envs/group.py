"""The group of turns and mirrors of a robot's limbs: its elements, and what they do to commands and actions.

Directions in the body frame fall into 2n sectors; sector g spans the angles [g pi/n, (g + 1) pi/n]. *Element* g of the
symmetry group is the turn (g even) or the turn and mirror (g odd) that brings sector g onto sector 0:

    element 2k:      turn by -2 pi k/n
    element 2k - 1:  turn by -2 pi k/n, then mirror at the x axis (y -> -y), for k = 1..n

An element carries a robot onto another one, whose limb j was limb `limb_order(n)[g, j]`; a mirror swaps the commands +
and -.

A group is the number n of limbs, which stands for all turns and mirrors of the regular polygon, or a `PointGroup`, for
those that there are. Its sectors begin at a mirror's line; with turns alone there are even elements only, whose sectors
are twice as wide.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.commands import Actions, command_table
from seastar_gym.scene.checks import MOST_LIMBS, require_count
from seastar_gym.scene.shape import PointGroup

Elements = NDArray[np.intp]
Group = int | PointGroup


def require_group(group: object) -> None:
    """ValueError for what is neither a number of limbs nor a `PointGroup`."""
    if not isinstance(group, PointGroup):
        require_count("group", group, 1, MOST_LIMBS)


def trivial_group(n_limbs: int) -> PointGroup:
    """Group of a robot that nothing leaves as it is."""
    limbs = tuple(range(n_limbs))
    return PointGroup(1, None, (limbs, limbs))


def n_limbs_of(group: Group) -> int:
    """Number of limbs of a robot with this group."""
    return len(group.orders[0]) if isinstance(group, PointGroup) else group


def n_turns_of(group: Group) -> int:
    """Number of turns, with that by nothing."""
    return group.n_turns if isinstance(group, PointGroup) else group


def axis_of(group: Group) -> float | None:
    """Direction of the mirror's line [rad]; None for a group of turns alone."""
    return group.axis if isinstance(group, PointGroup) else 0.0


def is_mirror(elements: ArrayLike) -> NDArray[np.bool_]:
    """Whether each element mirrors, shape (...)."""
    return np.asarray(elements) % 2 == 1


def inverse(elements: ArrayLike, group: Group) -> Elements:
    """Elements, shape (...), that undo these; a mirror undoes itself."""
    elements = np.asarray(elements)
    return np.where(is_mirror(elements), elements, -elements % (2 * n_turns_of(group)))


@cache
def turns(group: Group) -> NDArray[np.complex128]:
    """Factors by which elements turn a vector x + iy, shape (2 n_turns,); exactly 1 for element 0."""
    n = n_turns_of(group)
    k = (np.arange(2 * n) + 1) // 2 % n
    return read_only(np.exp(-2j * np.pi / n * k))


@cache
def limb_order(group: Group) -> NDArray[np.intp]:
    """Order of limbs, shape (2 n_turns, n_limbs): limb j of a robot carried by element g was limb order[g, j]."""
    if isinstance(group, PointGroup):
        return read_only(np.array(group.orders, dtype=np.intp))
    elements, limbs = np.arange(2 * group)[:, None], np.arange(group)
    return read_only(((elements + 1) // 2 + np.where(is_mirror(elements), -limbs, limbs)) % group)


def read_only(table: NDArray[Any]) -> NDArray[Any]:
    """Table that can be cached and shared, because nobody can write to it."""
    table.setflags(write=False)
    return table


def transform_commands(
    commands: NDArray[np.floating[Any]], elements: ArrayLike, group: Group | None = None
) -> NDArray[np.floating[Any]]:
    """Commands, shape (..., n_limbs), of the robots carried by the elements.

    group: None means that of the regular polygon.
    """
    moved = move_limbs(np.asarray(commands), np.asarray(elements, dtype=np.intp), group)
    return np.where(is_mirror(elements)[..., None], -moved, moved) + 0.0  # no -0.0


def move_limbs(values: NDArray[Any], elements: Elements, group: Group | None = None) -> NDArray[Any]:
    """Values of the limbs, shape (..., n_limbs), in the order of the robots carried by the elements."""
    order = limb_order(values.shape[-1] if group is None else group)[elements]
    shape = np.broadcast_shapes(values.shape, order.shape)
    return np.take_along_axis(np.broadcast_to(values, shape), np.broadcast_to(order, shape), axis=-1)


@cache
def action_table(actions: Actions, group: Group) -> NDArray[np.intp]:
    """Actions, shape (2 n_turns, n_actions), that each action becomes under each element; for "joint" and "pairs"."""
    commands = command_table(actions, n_limbs_of(group))
    number = {command.tobytes(): action for action, command in enumerate(commands + 0.0)}
    carried = transform_commands(commands, np.arange(2 * n_turns_of(group))[:, None], group)
    return read_only(np.array([[number[command.tobytes()] for command in row] for row in carried]))
