"""Keys of the keyboard and the commands that they mean.

The row of digits turns limbs 1, 2, .. anti-clockwise (+), the row below clockwise (-). The third row swims along a limb
for as long as it is held, by the lagged gait or, where decisions are strokes, the straight one; an arrow takes the limb
that points most its way. Keys that are held together add up.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from seastar_gym.gaits import lagged_gait, straight_gait

Floats = NDArray[np.float64]

PLUS, MINUS, ALONG = "12345678", "qwertyui", "asdfghjk"
"""Keys of limbs 1, 2, .. by row: +, -, and swimming along the limb."""
ARROWS = {"right": (1.0, 0.0), "up": (0.0, 1.0), "left": (-1.0, 0.0), "down": (0.0, -1.0)}
"""Directions of the arrow keys in the picture."""
NOTHING = "."
"""Word for a decision without keys."""


def swimming_gait(decision_period: float, n_limbs: int) -> Floats:
    """Commands of a gait along limb 1, shape (n_decisions, n_limbs)."""
    try:
        return lagged_gait(decision_period, n_limbs)
    except ValueError:  # decisions that are no fraction of a second
        return straight_gait(n_limbs)


class Steering:
    """Commands of the keys that are held, decision by decision.

    decision_period: Time between decisions [s].
    """

    def __init__(self, decision_period: float, n_limbs: int):
        self._gait, self._n_limbs = swimming_gait(decision_period, n_limbs), n_limbs
        self._swum = 0

    def command(self, keys: Iterable[str], headings: Floats) -> NDArray[np.int64]:
        """Command, -1, 0 or 1 for every limb. headings: Directions of the limbs [rad], shape (n_limbs,)."""
        keys = sorted(keys)
        limbs = {limb for key in keys if (limb := self._along(key, headings)) is not None}
        stroke = self._gait[self._swum % len(self._gait)]
        self._swum = self._swum + 1 if limbs else 0
        command = np.zeros(self._n_limbs)
        for limb in limbs:
            command += np.roll(stroke, limb)
        for row, sign in ((PLUS, 1.0), (MINUS, -1.0)):
            command[[row.index(key) for key in keys if key in row[: self._n_limbs]]] += sign
        return np.sign(command).astype(np.int64)

    def _along(self, key: str, headings: Floats) -> int | None:
        """Limb, numbered from 0, along which a key swims; None for a key that does not."""
        if key in ARROWS:
            return int(np.argmax(np.stack([np.cos(headings), np.sin(headings)], axis=1) @ ARROWS[key]))
        return ALONG.index(key) if key in ALONG[: self._n_limbs] else None


def known_keys(n_limbs: int) -> set[str]:
    """Keys that mean a command."""
    return {*PLUS[:n_limbs], *MINUS[:n_limbs], *ALONG[:n_limbs], *ARROWS}


def typed(text: str, n_limbs: int) -> Iterator[set[str]]:
    """Keys of every decision, from words: "a", "1w" for keys held together, "up", "." for none, "a*5" for five times.

    ValueError, with one sentence, for a key that means nothing.
    """
    for word in text.split():
        keys, _, times = word.partition("*")
        held = {keys} if keys in ARROWS else set(keys) - {NOTHING}
        if unknown := held - known_keys(n_limbs):
            raise ValueError(f"There is no key {min(unknown)!r}: {', '.join(sorted(known_keys(n_limbs)))} are known.")
        if times and not times.isdecimal():
            raise ValueError(f"A word such as a*5 says how often, {word!r} does not.")
        yield from [held] * (int(times) if times else 1)
