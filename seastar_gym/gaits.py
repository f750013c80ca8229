"""Gaits of the chapter as commands: the straight swim, the pairs of Fig. 13.8, the pentagon (13.15); gaits in time.

A gait is an array of commands, shape (n_strokes, n_limbs): per stroke and limb a share of the peak angle, + is
anti-clockwise. In time, a stroke is a decision, and the share is that of a pulse.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import (
    as_finite,
    is_whole_number,
    require_count,
    require_finite,
    require_limbs,
    require_number,
    shown,
)

Floats = NDArray[np.float64]

SWIMMING_STROKES, RESTING_STROKES = 45, 5
"""Strokes of a side of the pentagon: of swimming, then of rest "to bring the robot to a complete stop"."""


def pair_gait(plus: int, minus: int, n_limbs: int = 5) -> Floats:
    """One stroke of the pair {plus+, minus-}: two limbs, numbered from 1, turned against each other (Fig. 13.8)."""
    require_limbs(n_limbs)
    are_limbs = all(is_whole_number(limb) and 1 <= limb <= n_limbs for limb in (plus, minus))
    if not are_limbs or plus == minus:
        raise ValueError(f"A pair needs two different limbs from 1 to {n_limbs}, not {shown(plus)} and {shown(minus)}.")
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
    require_count("swimming", swimming, 0, MOST_DECISIONS)
    require_count("resting", resting, 0, MOST_DECISIONS)
    sides = []
    for side in range(5):
        command = np.roll(straight_gait(), side, axis=1)
        sides += [np.repeat(command, swimming, axis=0), np.zeros((resting, 5))]
    return np.concatenate(sides)


STRAIGHT = straight_gait()[0]
"""{2+, 5-}, the straight swim along limb 1, shape (5,)."""
PAIRS = {f"{{1-,{k}+}}": pair_gait(k, 1)[0] for k in (2, 3, 4, 5)}
"""The pairs of Fig. 13.8, by name."""


# --- gaits in time ---------------------------------------------------------------------------------------------------

PERIOD = 1.0
"""Period of the gaits [s]: that of the chapter's stroke."""
LAG, THRIFTY_LAG = 0.6, 0.5
"""Best time from one pair of the lagged gait to the other [s], for full pulses and for those of the thrifty gait."""
THRIFTY_LEVEL = 0.6
"""Share of a full pulse in the thrifty gait."""
MOST_DECISIONS = 1_000_000
"""Most strokes of a side of the pentagon, and most numbers of strokes that are written as decisions."""
SHORTEST = 1e-3
"""Shortest time between decisions of a gait [s]."""
WAVE = (5, 4, 3, 2, 1)
"""Limbs of the turning wave, in its order."""
LAGGED_SIDES, LAGGED_REST = {0.5: 22, 0.6: 20}, 2
"""Time of lagged swimming along a side of the pentagon [s], by lag [s], and of rest after it. Without rest, limbs that
are still rotated turn the robot at every corner, by 4 degrees."""


def timed(strokes: Floats, decision_period: float) -> Floats:
    """Strokes of a second each as decisions, shape (n_decisions, n_limbs): no commands between those of the strokes."""
    every = decisions_per_second(decision_period)
    strokes = as_finite("strokes", strokes, (None, None))
    if strokes.ndim != 2 or strokes.size * every > MOST_DECISIONS:
        raise ValueError(
            f"strokes must have shape (n_strokes, n_limbs), of {MOST_DECISIONS:,} numbers at most once they are "
            f"decisions, not {strokes.shape}."
        )
    decisions = np.zeros((len(strokes) * every, strokes.shape[1]))
    decisions[::every] = strokes
    return decisions


def decisions_per_second(decision_period: float) -> int:
    """Decisions in a second. ValueError if that is no whole number."""
    require_number("decision_period", decision_period, "s")
    if decision_period < SHORTEST:
        raise ValueError(f"decision_period of a gait must be at least {SHORTEST:g} s, not {decision_period:.4g} s.")
    decision_period = float(decision_period)
    every = max(1, round(PERIOD / decision_period))
    if not np.isclose(every * decision_period, PERIOD, rtol=1e-9):
        raise ValueError(f"Gaits need a whole number of decisions a second, not one every {decision_period:.4g} s.")
    return every


def lagged_gait(decision_period: float, n_limbs: int = 5, lag: float = LAG, level: float = 1.0) -> Floats:
    """Second of {2+, 5-} at 0 s and {3+, 4-} after a lag, as decisions: the robot moves along +x.

    The lag [s] is rounded to decisions, half up. level: Share of a full pulse.
    """
    every = decisions_per_second(decision_period)
    require_limbs(n_limbs)
    require_number("lag", lag, "s")
    require_finite("level", level, "of a full pulse")
    if abs(level) > 1.0:
        raise ValueError(f"level must be from -1 to 1, not {shown(level)}.")
    lag = min(float(lag), 2.0 * PERIOD)  # which is too late anyway
    late = int(lag / decision_period + 0.5)
    if not 0 < late < every:
        raise ValueError(f"A lagged gait needs two decisions a second or more, not one every {decision_period:.4g} s.")
    decisions = np.zeros((every, n_limbs))
    decisions[0] = level * straight_gait(n_limbs)[0]
    decisions[late] = level * pair_gait(3, n_limbs - 1, n_limbs)[0]
    return decisions


def thrifty_gait(decision_period: float, n_limbs: int = 5) -> Floats:
    """The lagged gait with 0.6 of its pulses: three quarters of the speed or more for half the heat per metre."""
    return lagged_gait(decision_period, n_limbs, THRIFTY_LAG, THRIFTY_LEVEL)


def turning_wave(decision_period: float) -> Floats:
    """Second of 5+, 4+, 3+, 2+, 1+, every 0.2 s, as decisions: the robot turns clockwise on the spot."""
    every = decisions_per_second(decision_period)
    if every % len(WAVE):
        raise ValueError(f"The turning wave needs decisions that divide 0.2 s, not one every {decision_period:.4g} s.")
    decisions = np.zeros((every, len(WAVE)))
    for place, limb in enumerate(WAVE):
        decisions[place * every // len(WAVE), limb - 1] = 1.0
    return decisions


def lagged_pentagon(decision_period: float) -> Floats:
    """The lagged gait along five sides, with rest after each, as decisions. Turns of 72 degrees shift limbs by one."""
    side = lagged_gait(decision_period)
    lag = decision_period * int(np.flatnonzero(side.any(axis=1))[-1])
    swimming = np.tile(side, (LAGGED_SIDES[min(LAGGED_SIDES, key=lambda known: abs(known - lag))], 1))
    resting = np.zeros((LAGGED_REST * len(side), 5))
    return np.concatenate([part for turn in range(5) for part in (np.roll(swimming, turn, axis=1), resting)])


# --- evolved gaits ---------------------------------------------------------------------------------------------------

SLOT = 0.05
"""Time between the decisions of the evolved gaits [s]. No pulse outlasts it: no share is above a half."""
ALONG = (
    (0.5, -0.44), (0.5, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (-0.21, 0.0), (0.0, 0.0), (0.0, -0.1),
    (-0.37, -0.43), (-0.22, 0.0), (0.0, 0.0), (0.0, 0.5), (0.0, 0.36), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0),
    (0.0, -0.13), (0.0, -0.45), (0.0, 0.0),
)  # fmt: skip
"""Evolved gait along limb 1: shares of a pulse of limbs 2 and 3; limbs 5 and 4 do the opposite. It is that of
docs/results/gaits/gaits.json at commit 055100c4 with slots of 0.05 s and a price of 0.5 mm/J, its pulses parted where
they are longer than a slot."""
AWAY = (
    (-0.5, 0.0), (-0.35, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.31, 0.0), (0.0, 0.0), (0.0, -0.5),
    (0.0, -0.47), (0.0, -0.5), (0.0, -0.21), (0.0, -0.14), (0.0, 0.0), (0.0, 0.5), (0.0, 0.29), (0.5, 0.13),
    (0.03, 0.0), (-0.17, 0.0), (0.0, 0.0),
)  # fmt: skip
"""Evolved gait away from limb 1, likewise, of the gait with slots of 0.1 s."""


def evolved_gaits(decision_period: float | None) -> Floats:
    """One period of every evolved gait, along and away from each of five limbs, shape (10, 20, 5).

    decision_period: Of the environment [s], SLOT. ValueError for another one.
    """
    if decision_period is None or not np.isclose(decision_period, SLOT, rtol=1e-9):
        theirs = "strokes" if decision_period is None else f"one every {shown(decision_period)} s"
        raise ValueError(f"Evolved gaits need a decision every {SLOT:g} s, not {theirs}.")
    gaits = np.zeros((2, len(ALONG), 5))
    gaits[:, :, 1:3] = ALONG, AWAY
    gaits[:, :, 3:] = -gaits[:, :, 2:0:-1]
    return np.concatenate([np.roll(gaits, limb, axis=2) for limb in range(5)])
