"""Gaits by name, as the commands of a sweep's robots."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seastar_gym import gaits
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import complete
from seastar_gym.scene.checks import as_floats, shown

DECISION = 0.1
"""Time between the commands of gaits in time [s]."""


class Gait(NamedTuple):
    """Commands that are repeated. commands: One tuple per interval. interval: Its length [s], None for a stroke."""

    commands: tuple[tuple[float, ...], ...]
    interval: float | None = None


def _lagged(n_limbs: int) -> gaits.Floats:
    return gaits.lagged_gait(DECISION, n_limbs)


STROKES: dict[str, Callable[[int], gaits.Floats]] = {"straight": gaits.straight_gait}
TIMED: dict[str, Callable[[int], gaits.Floats]] = {"lagged": _lagged, "thrifty": partial(gaits.thrifty_gait, DECISION)}


def gait_of(what: str | ArrayLike, scene: Scene) -> Gait:
    """Gait for a scene's robot. ValueError if it has none.

    what: "straight", "lagged", "thrifty", a pair such as "2+,5-", or commands, shape (n_strokes, n_limbs).
    """
    n_limbs = scene.robot.n_limbs
    if not isinstance(what, str):
        commands = as_floats("gait", what)
        if commands.ndim != 2 or commands.shape[1] != n_limbs or not len(commands):
            raise ValueError(f"A gait needs rows of commands of {n_limbs} limbs, not {shown(what)}.")
        return Gait(_rows(commands))
    if what in TIMED:
        if not complete(scene.actuator).has_memory:
            raise ValueError(f'The gait "{what}" heats limbs in the middle of strokes: use an actuator like SmaWires.')
        return Gait(_rows(TIMED[what](n_limbs)), DECISION)
    return Gait(_rows(STROKES[what](n_limbs) if what in STROKES else _stroke(what, n_limbs)))


def _rows(commands: gaits.Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, commands.tolist()))


def _stroke(text: str, n_limbs: int) -> gaits.Floats:
    """One stroke that heats what the text says, such as "2+,5-"."""
    command = np.zeros((1, n_limbs))
    for limb in text.split(","):
        number, sign = limb[:-1], limb[-1:]
        if sign not in ("+", "-") or not number.isdecimal() or not 1 <= int(number) <= n_limbs:
            known = ", ".join([*STROKES, *TIMED])
            raise ValueError(f"A gait is one of {known}, or limbs of {n_limbs} such as 1+,2-, not {shown(text)}.")
        command[0, int(number) - 1] = 1.0 if sign == "+" else -1.0
    return command
