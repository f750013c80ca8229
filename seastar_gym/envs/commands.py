"""Actions and the commands they mean: which limbs are heated, which way they turn, for how long, and how often.

A mask is true for actions that are followed as a whole, in the form that sb3-contrib's MaskablePPO takes:

actions         shape of a robot's mask    true where
"limbs"         (3 n_limbs,)               limb after limb, its actions 0, 1 (+), 2 (-) are followed
"joint/pairs"   (n_actions,)               all wires of the action's command can be heated
"continuous"    (2 n_limbs,)               limb after limb, its wires + and - can be heated

`sampling_mask` has them in Gymnasium's own form.
"""

import functools
import itertools
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import JUMP, Actuator, ActuatorBase, complete
from seastar_gym.scene.checks import require_choice, require_unmasked, shown
from seastar_gym.scene.number import batch_size
from seastar_gym.scene.numerics import require_duration

Discrete: TypeAlias = Literal["limbs", "joint", "pairs"]
"""Action modes with a finite number of actions."""
Actions: TypeAlias = Literal[Discrete, "continuous"]

MOST_LIMBS = 8
"""Largest number of limbs for actions="joint", which then has 6,561 actions."""

ROUNDING = 16.0 * float(np.finfo(np.float32).eps)
"""What rounding of float32 may add to a share of 1, as where learners' actions are scaled: it is clipped."""

LIMB_COMMANDS = np.array([0.0, 1.0, -1.0])
"""Command of a limb for its action 0, 1, 2: leave it alone, actuate + (anti-clockwise), actuate -."""


def action_space(actions: Actions, n_limbs: int) -> spaces.MultiDiscrete | spaces.Discrete | spaces.Box:
    """Space of one robot's actions."""
    require_choice("actions", actions, get_args(Actions))
    if actions == "continuous":
        return spaces.Box(-1.0, 1.0, (n_limbs,), np.float32)
    numbers, n_choices = choices(actions, n_limbs)
    return spaces.MultiDiscrete([n_choices] * numbers) if actions == "limbs" else spaces.Discrete(n_choices)


def choices(actions: Actions, n_limbs: int) -> tuple[int, int]:
    """Count of the numbers that one action consists of, and of the values that each can take (from 0 on)."""
    require_discrete(actions)
    return (n_limbs, len(LIMB_COMMANDS)) if actions == "limbs" else (1, len(command_table(actions, n_limbs)))


def require_discrete(actions: Actions) -> None:
    """ValueError for an action mode that is unknown, or has no finite number of actions."""
    require_choice("actions", actions, get_args(Actions))
    if actions == "continuous":
        raise ValueError(f'actions="continuous" has no finite number of actions: use one of {get_args(Discrete)}.')


def command_table(actions: Actions, n_limbs: int) -> NDArray[np.float64]:
    """Commands of all actions of a `Discrete` space, shape (n_actions, n_limbs), values -1, 0, 1; read-only.

    "joint": every command, limb 1 varying slowest, each limb in the order 0, +, -. "pairs": no limb, then every pair
    of one + and one - limb. "limbs" has no table: it is one action per limb.
    """
    require_discrete(actions)
    if actions == "limbs":
        raise ValueError('actions="limbs" has one action per limb, not a table of commands: use LIMB_COMMANDS.')
    if actions == "joint" and n_limbs > MOST_LIMBS:
        raise ValueError(
            f'actions="joint" would have 3^{n_limbs} = {3**n_limbs:,} actions for {n_limbs} limbs: use "limbs" or '
            f'"pairs" for more than {MOST_LIMBS} limbs.'
        )
    return _command_table(actions, n_limbs)


@functools.cache
def _command_table(actions: Actions, n_limbs: int) -> NDArray[np.float64]:
    if actions == "joint":
        table = np.array(list(itertools.product(LIMB_COMMANDS, repeat=n_limbs)))
    else:
        table = np.zeros((1 + n_limbs * (n_limbs - 1), n_limbs))
        for row, (plus, minus) in enumerate(itertools.permutations(range(n_limbs), 2), start=1):
            table[row, [plus, minus]] = 1.0, -1.0
    table.setflags(write=False)  # every environment reads the same one
    return table


def as_array(value: object) -> NDArray[Any]:
    """Value as an array; an array of objects for rows of different lengths, so that they are refused in a sentence."""
    require_unmasked("What is given", value)
    try:
        return np.asarray(value)
    except ValueError:
        return np.array(None)


def to_commands(actions: Actions, n_limbs: int, action: object, n_robots: int) -> NDArray[np.float64]:
    """Commands of `n_robots` robots, shape (n_robots, n_limbs), or ValueError for what is not an action of theirs."""
    array = as_array(action)
    if actions == "continuous":
        return _checked_shares(array, (n_robots, n_limbs))
    shape = (n_robots, n_limbs) if actions == "limbs" else (n_robots,)
    table = LIMB_COMMANDS if actions == "limbs" else _command_table(actions, n_limbs)
    if array.dtype.kind not in "iu" or array.shape != shape:
        raise ValueError(
            f'With actions="{actions}" the actions of {n_robots} robot(s) are whole numbers of shape {shape}, '
            f"not {array.dtype} of shape {array.shape}."
        )
    if np.maximum.reduce(array.astype(np.uint64), axis=None) >= len(table):  # numbers below 0 are large ones then
        raise ValueError(
            f'With actions="{actions}" an action is from 0 to {len(table) - 1}, not {shown(array.tolist())}.'
        )
    return np.asarray(table[array])


def _checked_shares(array: NDArray[Any], shape: tuple[int, int]) -> NDArray[np.float64]:
    """Numbers of actions="continuous" as commands, a fresh array."""
    if array.dtype.kind not in "iuf" or array.shape != shape:
        raise ValueError(
            f'With actions="continuous" the actions of {shape[0]} robot(s) are numbers of shape {shape}, '
            f"not {array.dtype} of shape {array.shape}."
        )
    shares = array.astype(np.float64)
    if not (np.abs(shares) <= 1.0 + ROUNDING).all():
        raise ValueError(f'With actions="continuous" an action is numbers from -1 to 1, not {shown(array.tolist())}.')
    return np.clip(shares, -1.0, 1.0, out=shares)


def decisions_in(seconds: float, decision_period: float | None, scene: Scene | None = None) -> int:
    """Number of decisions in a time [s], one at least.

    decision_period: Time between them [s]. None means a stroke, of the scene's actuator or without a scene of 1 s.
    """
    stroke = 1.0 if scene is None else scene.actuator.period
    return max(1, round(seconds / (stroke if decision_period is None else decision_period)))


def checked_decision_period(seconds: float | None, scene: Scene) -> float:
    """Time between decisions [s], a stroke if None; ValueError if the scene's actuator cannot be commanded so often."""
    actuator = scene.actuator
    if seconds is None:
        return float(actuator.period)
    require_duration(seconds, scene.numerics.step, "decision_period")
    if not _can_begin_anew(complete(actuator), float(seconds)):
        raise ValueError(
            f"decision_period must be at least {actuator.period:.4g} s, the period of this {type(actuator).__name__}: "
            f"limbs would jump at a new command after {seconds:.4g} s. Use an actuator with memory, such as SmaWires."
        )
    return float(seconds)


def _can_begin_anew(actuator: ActuatorBase, seconds: float) -> bool:
    """Whether new commands that come after a time [s] find limbs at rest, or turn them on from where they are."""
    if not actuator.has_memory:
        return seconds >= actuator.period * (1.0 - JUMP)
    n_robots = batch_size(actuator)
    shape = (1,) if n_robots is None else (n_robots, 1)
    state = np.broadcast_to(actuator.rest, (*shape, actuator.rest.shape[-1]))
    ends = np.array([0.0, *(corner for corner in actuator.corners if 0.0 < corner < seconds), seconds])
    turned, state = actuator.respond(ends, np.ones(shape), state)
    jump = np.abs(actuator.respond(np.zeros(1), np.ones(shape), state)[0][0] - turned[-1])
    return bool((jump <= JUMP * np.max(actuator.peak_angle)).all())


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
