"""Commands and actions under the symmetry group: what a turned or mirrored robot is told."""

from functools import cache
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.commands import LIMB_COMMANDS, Actions, as_array, choices, command_table
from seastar_gym.envs.symmetry.group import (
    Elements,
    Group,
    inverse,
    is_mirror,
    limb_order,
    n_limbs_of,
    n_turns_of,
    read_only,
    require_group,
)
from seastar_gym.scene.checks import require_choice, shown


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


_SWAPPED_LIMB_ACTIONS = np.argmax(-LIMB_COMMANDS[:, None] == LIMB_COMMANDS, axis=1)
"""Action of a limb after a mirror, by its action before: + and - change places."""


def transform_actions(
    actions: NDArray[Any], elements: ArrayLike, mode: Actions, group: Group
) -> NDArray[Any]:
    """Actions of the robots carried by the elements: shape (..., n_limbs) for "limbs" and "continuous", or (...)."""
    n_limbs = n_limbs_of(group)
    actions, elements = as_array(actions), np.asarray(elements, dtype=np.intp)
    _check_shape(actions, elements, mode, n_limbs)
    if mode == "continuous":
        if actions.dtype.kind not in "iuf":
            raise ValueError(f'With actions="continuous" an action is numbers, not {actions.dtype}.')
        return transform_commands(actions, elements, group)
    _, n_choices = choices(mode, n_limbs)
    if actions.dtype.kind not in "iu" or (actions.size and (actions.min() < 0 or actions.max() >= n_choices)):
        raise ValueError(f'With actions="{mode}" an action is a whole number from 0 to {n_choices - 1}.')
    if mode != "limbs":
        return action_table(mode, group)[elements, actions]
    moved = move_limbs(actions, elements, group)
    return np.where(is_mirror(elements)[..., None], _SWAPPED_LIMB_ACTIONS[moved], moved)


def _check_shape(actions: NDArray[Any], elements: Elements, mode: Actions, n_limbs: int) -> None:
    """ValueError where there is not one action for every element, or one for all."""
    of_one = (n_limbs,) if mode in ("limbs", "continuous") else ()
    robots = actions.shape[: actions.ndim - len(of_one)]
    if actions.shape != (*robots, *of_one) or (robots != elements.shape and () not in (robots, elements.shape)):
        one = f"{n_limbs} numbers" if of_one else "a number"
        raise ValueError(
            f'With actions="{mode}" an action is {one}, for each of {elements.size} robot(s), not an array of shape '
            f"{actions.shape}."
        )


def restore_actions(
    actions: NDArray[Any], elements: ArrayLike, mode: Actions, group: Group
) -> NDArray[Any]:
    """Actions of the robots as they are, from those chosen on observations reduced by the elements."""
    require_group(group)
    require_choice("mode", mode, get_args(Actions))
    checked = as_array(elements)
    n = 2 * n_turns_of(group)
    if checked.dtype.kind not in "iu" or (checked.size and (checked.min() < 0 or checked.max() >= n)):
        raise ValueError(f"elements must be whole numbers from 0 to {n - 1}, not {shown(elements)}.")
    return transform_actions(actions, inverse(checked, group), mode, group)
