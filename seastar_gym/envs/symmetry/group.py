"""Symmetry groups of robots: their elements, their products, and how they turn vectors, order limbs and command them.

A group is the number of limbs, which stands for all turns and mirrors of the regular polygon, or a `PointGroup`.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.commands import Actions, command_table
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import Actuator, Mirror, complete, is_actuator
from seastar_gym.scene.checks import MOST_LIMBS, is_whole_number, require_count, require_kind, shown
from seastar_gym.scene.symmetry import SAME, PointGroup

Elements = NDArray[np.intp]
Group = int | PointGroup


def require_group(group: object) -> None:
    """ValueError for what is neither a number of limbs nor a `PointGroup`."""
    if not isinstance(group, PointGroup):
        require_count("group", group, 1, MOST_LIMBS)


def require_mirror(mirror: object) -> None:
    """ValueError unless a mirror is a pair of index and sign for each number of a limb."""
    rows = mirror if isinstance(mirror, tuple) else (None,)
    if not all(isinstance(row, tuple) and len(row) == 2 and _is_row(row[0], row[1], len(rows)) for row in rows):
        raise ValueError(f"mirror must be a tuple of pairs, an index and a sign, not {shown(mirror)}.")


def _is_row(index: object, sign: object, n: int) -> bool:
    """Whether a row of the mirror of n numbers is an index and a sign."""
    are_whole = is_whole_number(index) and is_whole_number(sign)
    return are_whole and 0 <= index < n and sign in (-1, 1)  # type: ignore[operator]


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


def compose(second: ArrayLike, first: ArrayLike, group: Group) -> Elements:
    """Elements, shape (...), of doing `first` and then `second`."""
    second, first = np.asarray(second), np.asarray(first)
    k_first, k_second = (first + 1) // 2, (second + 1) // 2
    k = k_first + np.where(is_mirror(first), -k_second, k_second)
    return (2 * k - (first + second) % 2) % (2 * n_turns_of(group))


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


def symmetry_of(scene: Scene) -> Group:
    """Turns and mirrors that leave the robot of a scene unchanged: all of its polygon, or those that there are.

    Robots of the chapter's discretisation have all or none.
    """
    require_kind("scene", scene, Scene, "a Scene")
    robot, nothing = scene.robot, tuple(range(scene.robot.n_limbs))
    group = robot.point_group(_feels_directions(scene))
    if group.is_whole:
        return robot.n_limbs
    return PointGroup(1, None, (nothing, nothing)) if robot.discretisation == "chapter" else group


def _feels_directions(scene: Scene) -> bool:
    """Whether fluid that moves along with a body is that of an ellipse along its axes."""
    body, fluid = scene.robot.body, scene.fluid
    if body is None or fluid is None or fluid.added_mass_coefficient is None:
        return False
    along, across = body.shape.widths
    return abs(along - across) > SAME


def memory_mirror(actuator: Actuator) -> Mirror:
    """What a mirror does to the numbers that are observed of a limb's actuator; empty without memory."""
    if not is_actuator(actuator):
        raise ValueError(f"actuator must be an actuator, such as SmaWires, not {shown(actuator)}.")
    known = complete(actuator)
    return (known.mirror or ())[: known.observe(known.rest).shape[-1]]


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
