"""Gaits of the chapter as commands: the straight swim, the pairs of Fig. 13.8, the pentagon (13.15).

A gait is an array of commands, shape (n_strokes, n_limbs): per stroke and limb a share of the peak angle, + is
anti-clockwise.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SWIMMING_STROKES, RESTING_STROKES = 45, 5
"""Strokes of a side of the pentagon: of swimming, then of rest "to bring the robot to a complete stop"."""


def pair_gait(plus: int, minus: int, n_limbs: int = 5) -> Floats:
    """One stroke of the pair {plus+, minus-}: two limbs, numbered from 1, turned against each other (Fig. 13.8)."""
    if plus == minus or not {plus, minus} <= set(range(1, n_limbs + 1)):
        raise ValueError(f"A pair needs two different limbs from 1 to {n_limbs}, not {plus} and {minus}.")
    command = np.zeros((1, n_limbs))
    command[0, [plus - 1, minus - 1]] = 1.0, -1.0
    return command


def straight_gait(n_limbs: int = 5) -> Floats:
    """One stroke of {2+, 5-}, the neighbours of limb 1: the robot moves along +x."""
    return pair_gait(2, n_limbs, n_limbs)


def pentagon_gait(swimming: int = SWIMMING_STROKES, resting: int = RESTING_STROKES) -> Floats:
    """The strokes of (13.15), 250 by default: {2,5}; {1,3}; {2,4}; {3,5}; {1,4}, with a rest after each.

    The chapter leaves the signs open. The straight gait fixes the first pair, {2+, 5-}; every further side is turned by
    72 degrees, which moves both limbs on by one: {3+, 1-}, {4+, 2-}, {5+, 3-}, {1+, 4-}.

    swimming, resting: Strokes of every side.
    """
    sides = []
    for side in range(5):
        command = np.roll(straight_gait(), side, axis=1)
        sides += [np.repeat(command, swimming, axis=0), np.zeros((resting, 5))]
    return np.concatenate(sides)


STRAIGHT = straight_gait()[0]
"""{2+, 5-}, the straight swim along limb 1, shape (5,)."""
PAIRS = {f"{{1-,{k}+}}": pair_gait(k, 1)[0] for k in (2, 3, 4, 5)}
"""The pairs of Fig. 13.8, by name."""
