"""Classes of commands over which errors are measured.

Every class of commands is drawn anew from a seed, as many sequences as are asked for, ten strokes each:

random ternary          -1, 0 or 1 for every limb and stroke
random continuous       from [-1, 1] for every limb and stroke
repeated ternary        one such command, repeated
repeated continuous
alternating ternary     two such commands in turn
alternating continuous
opposed neighbours      two neighbours turned towards or from each other, by 1, another pair in every stroke
small                   random continuous, a tenth of the amplitude

Where decisions are shorter than strokes, ten seconds of them:

random                  another command for every decision, half of them of -1, 0 and 1
pairs                   1 and -1 for two limbs, others in every decision
repeated second         a second of random commands, repeated
held                    commands of -1, 0 and 1 that change every 1, 2, 5 or 10 s
on-off                  such a command for a second, then a second of rest
repeated command        such a command for ten seconds
held share              shares of pulses that change every 1, 2, 5 or 10 s: half of them from [-1, 1] for every limb,
                        the others -1, 0 and 1 times one share
repeated share          such a command for ten seconds

Such paths may be short: errors are fractions of at least a tenth of a limb length per second.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Draw = Callable[[np.random.Generator, int, int], Floats]
"""Commands of n sequences for a number of limbs, from a generator, shape (STROKES, n, n_limbs)."""

STROKES = 10
LEAST_SHARE = 0.05
"""Least share of a pulse that all limbs of a command have."""
SMALL_COMMANDS, SMALL = "small", 0.1
"""Class whose paths are so short that errors are large shares of them, and its share of the amplitude."""


def _ternary(rng: np.random.Generator, *shape: int) -> Floats:
    """Commands of -1, 0 and 1 that are not all zero for any robot."""
    found = rng.integers(-1, 2, shape).astype(float)
    still = ~found.any(axis=-1)
    found[still, rng.integers(0, shape[-1], int(still.sum()))] = 1.0
    return found


def _continuous(rng: np.random.Generator, *shape: int) -> Floats:
    return rng.uniform(-1.0, 1.0, shape)


def _shares(rng: np.random.Generator, *shape: int) -> Floats:
    """Commands in [-1, 1]; of every second sequence -1, 0 and 1 times one share, which is another in every command.

    Pulses that end early end between two time steps, and all in the same way where their shares are one.
    """
    commands = _continuous(rng, *shape)
    alike = rng.uniform(LEAST_SHARE, 1.0, (*shape[:-1], 1)) * _ternary(rng, *shape)
    commands[..., ::2, :] = alike[..., ::2, :]
    return commands


def _each(draw: Callable[..., Floats], different: int) -> Draw:
    """Sequences of so many different commands in turn."""

    def sequences(rng: np.random.Generator, n: int, n_limbs: int) -> Floats:
        return np.tile(draw(rng, different, n, n_limbs), (STROKES // different, 1, 1))

    return sequences


def _opposed(rng: np.random.Generator, n: int, n_limbs: int) -> Floats:
    commands = np.zeros((STROKES, n, n_limbs))
    first, sign = rng.integers(0, n_limbs, (STROKES, n)), rng.choice([-1.0, 1.0], (STROKES, n))
    np.put_along_axis(commands, first[..., None], sign[..., None], axis=-1)
    if n_limbs > 1:
        np.put_along_axis(commands, ((first + 1) % n_limbs)[..., None], -sign[..., None], axis=-1)
    return commands


def _small(rng: np.random.Generator, n: int, n_limbs: int) -> Floats:
    return SMALL * _continuous(rng, STROKES, n, n_limbs)


CLASSES: dict[str, Draw] = {
    "random ternary": _each(_ternary, STROKES),
    "random continuous": _each(_continuous, STROKES),
    "repeated ternary": _each(_ternary, 1),
    "repeated continuous": _each(_continuous, 1),
    "alternating ternary": _each(_ternary, 2),
    "alternating continuous": _each(_continuous, 2),
    "opposed neighbours": _opposed,
    SMALL_COMMANDS: _small,
}
"""Classes by name."""


SECONDS = 10
"""Length of a swim by decisions that are shorter than strokes [s]."""
SLOWEST = 0.1
"""Errors of such swims are fractions of a path at this speed [limb lengths per second] at least: held and repeated
commands hardly swim, so that shares of their paths would say nothing."""
HELD = (10.0, 5.0, 2.0, 1.0)
"""Times for which a command is held [s]."""


def decisions(period: float) -> int:
    """Number of decisions of a swim. period: Time between them [s]."""
    return round(SECONDS / period)


def _in_turn(commands: Floats, every: float, period: float) -> Floats:
    """Commands that change every so many seconds, as decisions, shape (n_decisions, n, n_limbs)."""
    k = (np.arange(decisions(period)) * period / every + 1e-9).astype(int)
    return np.asarray(commands[k % len(commands)])


def _any(rng: np.random.Generator, n_strokes: int, n: int, n_limbs: int) -> Floats:
    """Commands in [-1, 1], of every second sequence -1, 0 and 1, as an environment's actions are."""
    commands = rng.uniform(-1.0, 1.0, (n_strokes, n, n_limbs))
    commands[:, ::2] = rng.integers(-1, 2, commands[:, ::2].shape)
    return commands


def _pairs(rng: np.random.Generator, n: int, n_limbs: int, period: float) -> Floats:
    commands = np.zeros((decisions(period), n, n_limbs))
    first, apart = rng.integers(n_limbs, size=commands.shape[:2]), rng.integers(1, max(2, n_limbs), commands.shape[:2])
    np.put_along_axis(commands, ((first + apart) % n_limbs)[..., None], -1.0, axis=-1)
    np.put_along_axis(commands, first[..., None], 1.0, axis=-1)
    return commands


def _repeated_second(rng: np.random.Generator, n: int, n_limbs: int, period: float) -> Floats:
    a_second = rng.uniform(-1.0, 1.0, (max(1, round(1.0 / period)), n, n_limbs))
    return np.resize(a_second, (decisions(period), n, n_limbs))


def _held(drawn: Floats, period: float) -> Floats:
    """Commands of every second, shape (SECONDS, n, n_limbs), as decisions, which hold some of them for longer."""
    some = (drawn[:, k :: len(HELD)] for k in range(len(HELD)))
    return np.concatenate([_in_turn(each, every, period) for each, every in zip(some, HELD, strict=True)], axis=1)


def _repeated(command: Floats, period: float) -> Floats:
    """One command, shape (n, n_limbs), as decisions."""
    return np.tile(command, (decisions(period), 1, 1))


def _on_off(rng: np.random.Generator, n: int, n_limbs: int, period: float) -> Floats:
    return _in_turn(np.stack([_ternary(rng, n, n_limbs), np.zeros((n, n_limbs))]), 1.0, period)


DECISIONS: dict[str, Callable[[np.random.Generator, int, int, float], Floats]] = {
    "random": lambda rng, n, n_limbs, period: _any(rng, decisions(period), n, n_limbs),
    "pairs": _pairs,
    "repeated second": _repeated_second,
    "held": lambda rng, n, n_limbs, period: _held(_ternary(rng, SECONDS, n, n_limbs), period),
    "on-off": _on_off,
    "repeated command": lambda rng, n, n_limbs, period: _repeated(_ternary(rng, n, n_limbs), period),
    "held share": lambda rng, n, n_limbs, period: _held(_shares(rng, SECONDS, n, n_limbs), period),
    "repeated share": lambda rng, n, n_limbs, period: _repeated(_shares(rng, n, n_limbs), period),
}
"""Classes of decisions that are shorter than strokes, by name."""


class Batch(NamedTuple):
    """Sequences of equal length, by class of commands, shape (n_strokes, n, n_limbs) each.

    period: Time between decisions [s]. None means strokes.
    """

    commands: Mapping[str, Floats]
    period: float | None = None

    @property
    def joined(self) -> Floats:
        """All sequences, one class after another."""
        return np.concatenate([*self.commands.values()], axis=1)

    def of_classes(self, numbers: Floats) -> dict[str, Floats]:
        """Numbers of all sequences, by class."""
        ends = np.cumsum([each.shape[1] for each in self.commands.values()])
        return dict(zip(self.commands, np.split(numbers, ends[:-1]), strict=True))


def draw_batch(n: int, n_limbs: int, seed: int, period: float | None = None) -> Batch:
    """n sequences of every class of strokes, or of decisions every so many seconds."""
    if period is None:
        rng = np.random.default_rng(seed)
        return Batch({name: draw(rng, n, n_limbs) for name, draw in CLASSES.items()})
    rng = np.random.default_rng([seed, round(1000 * period)])
    return Batch({name: draw(rng, n, n_limbs, period) for name, draw in DECISIONS.items()}, period)
