"""Classes of command sequences that errors are measured over.

Every class is drawn anew from a seed, as many sequences as are asked for, ten strokes each:

random ternary          -1, 0 or 1 for every limb and stroke
random continuous       from [-1, 1] for every limb and stroke
repeated ternary        one such command, repeated
repeated continuous
alternating ternary     two such commands in turn
alternating continuous
opposed neighbours      two neighbours turned towards or from each other, by 1, another pair in every stroke
small                   random continuous, a tenth of the amplitude
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Draw = Callable[[np.random.Generator, int, int], Floats]
"""Commands of n sequences for a number of limbs, from a generator, shape (STROKES, n, n_limbs)."""

STROKES = 10
SMALL = 0.1
"""Share of the amplitude of small commands."""


def _ternary(rng: np.random.Generator, *shape: int) -> Floats:
    """Commands of -1, 0 and 1 that are not all zero for any robot."""
    found = rng.integers(-1, 2, shape).astype(float)
    still = ~found.any(axis=-1)
    found[still, rng.integers(0, shape[-1], int(still.sum()))] = 1.0
    return found


def _continuous(rng: np.random.Generator, *shape: int) -> Floats:
    return rng.uniform(-1.0, 1.0, shape)


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
    "small": _small,
}
"""Classes by name."""
PROMISED = tuple(name for name in CLASSES if name != "small")
"""Classes of full amplitude. Paths of small commands are so short that errors are large shares of them."""
ACTIONS = ("random ternary", "repeated ternary", "alternating ternary", "opposed neighbours")
"""Classes that an environment's actions can make."""


def draw_classes(n: int, n_limbs: int, seed: int) -> Floats:
    """n sequences of every class, one class after another, shape (STROKES, len(CLASSES) n, n_limbs)."""
    rng = np.random.default_rng(seed)
    return np.concatenate([draw(rng, n, n_limbs) for draw in CLASSES.values()], axis=1)
