"""Every gait of a second from rest: each limb is heated at most once, fully, to + or -, in one of ten slots.

Once heated, a limb of the chapter is at rest again after a second, so a gait of one second heats each limb once or
not at all. Of 21^5 such gaits, those that differ only by a turn, a mirror or a shift in time swim alike: one of each
class is simulated.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.symmetry import limb_order

Floats = NDArray[np.float64]
Codes = NDArray[np.int64]

SLOTS = 10
"""Slots of a period."""


def all_codes(n_limbs: int, slots: int) -> Codes:
    """Codes of all gaits, shape (n_gaits, n_limbs): 0 for a limb at rest, 1 + 2 slot for +, 2 + 2 slot for -."""
    numbers = np.arange((2 * slots + 1) ** n_limbs)
    return np.stack([numbers // (2 * slots + 1) ** place % (2 * slots + 1) for place in range(n_limbs)], axis=1)


def _carried(slots: int, shift: int, mirror: bool) -> Codes:
    """Code of a limb, by its code before, after a shift in time, and with + and - exchanged by a mirror."""
    codes = np.arange(1, 2 * slots + 1)
    sign, slot = (codes - 1) % 2, (codes - 1) // 2
    return np.append(0, 1 + 2 * ((slot + shift) % slots) + (1 - sign if mirror else sign))


def distinct_codes(n_limbs: int = 5, slots: int = SLOTS) -> Codes:
    """Codes of one gait of every class under turns, mirrors and shifts in time."""
    codes = all_codes(n_limbs, slots).astype(np.int8)
    place = (2 * slots + 1) ** np.arange(n_limbs)
    numbers = np.arange(len(codes))
    is_least = np.ones(len(codes), bool)
    for element, shift in itertools.product(range(2 * n_limbs), range(slots)):
        table = _carried(slots, shift, element % 2 == 1)
        moved = codes[:, limb_order(n_limbs)[element]]
        is_least &= sum(table[moved[:, limb]] * place[limb] for limb in range(n_limbs)) >= numbers
    return np.asarray(codes[is_least], np.int64)


def gaits_of(codes: Codes, slots: int = SLOTS) -> Floats:
    """Gaits of codes, shape (n_gaits, slots, n_limbs)."""
    gaits = np.zeros((len(codes), slots, codes.shape[1]))
    gait, limb = np.nonzero(codes)
    code = codes[gait, limb] - 1
    gaits[gait, code // 2, limb] = np.where(code % 2 == 0, 1.0, -1.0)
    return gaits
