"""Rounds among prizes: what the best choice of prizes brings within a way, and what the greedy one does.

A point swims from the origin straight from prize to prize. The best choice is exact, by dynamic programming over all
sets of prizes and their last ones.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.robots import Floats


class _Sets(NamedTuple):
    """Sets of n prizes as numbers whose bit k says whether prize k is among them."""

    members: NDArray[np.bool_]
    """Shape (2^n, n)."""
    steps: list[tuple[int, NDArray[np.intp], NDArray[np.intp]]]
    """Prize, sets without it, and the same with it, smaller sets first."""


@cache
def _sets(n: int) -> _Sets:
    numbers = np.arange(1 << n)
    members = (numbers[:, None] >> np.arange(n) & 1).astype(bool)
    size = members.sum(axis=1)
    steps = []
    for k in range(1, n):
        for prize in range(n):
            without = numbers[(size == k) & ~members[:, prize]]
            steps.append((prize, without, without | (1 << prize)))
    return _Sets(members, steps)


class Best(NamedTuple):
    """Best choice of prizes within a way."""

    worth: float
    """What it brings."""
    order: list[int]
    """Prizes in the order of the shortest way through them; empty if none is near enough."""


def best_round(first: Floats, between: Floats, worth: Floats, way: float) -> Best:
    """Best choice of prizes within a way [m]; of equal ones, the shortest.

    first: Ways to all prizes [m], shape (n,). between: Ways from prize to prize [m], shape (n, n), 0 to itself. worth:
    Shape (n,).
    """
    n = len(worth)
    sets = _sets(n)
    shortest = np.full((1 << n, n), np.inf)  # to be in the last one, having been in all
    shortest[1 << np.arange(n), np.arange(n)] = first
    for prize, without, along in sets.steps:
        shortest[along, prize] = (shortest[without] + between[:, prize]).min(axis=1)
    length = shortest.min(axis=1)
    brought = np.where(length <= way, sets.members @ worth, 0.0)
    most = brought.max()
    if most <= 0.0:
        return Best(0.0, [])
    among = np.flatnonzero(brought >= most - 1e-9)
    chosen = int(among[np.argmin(length[among])])
    order: list[int] = []
    last = int(np.argmin(shortest[chosen]))
    while True:
        order.append(last)
        chosen ^= 1 << last
        if chosen == 0:
            return Best(float(most), order[::-1])
        last = int(np.argmin(shortest[chosen] + between[:, last]))


def greedy_round(first: Floats, between: Floats, worth: Floats, way: float) -> float:
    """What a point brings that swims to the prize of most worth per metre, as long as one is within the way.

    Arguments as in `best_round`.
    """
    left, to, brought = np.ones(len(worth), bool), first, 0.0
    while True:
        value = np.where(left & (to <= way), worth / np.maximum(to, 1e-9), 0.0)
        best = int(np.argmax(value))
        if value[best] <= 0.0:
            return brought
        way, brought, left[best] = way - to[best], brought + float(worth[best]), False
        to = between[best]


def distances(points: Floats) -> Floats:
    """Distances between points [m], shape (n, n), of points of shape (n, 2)."""
    away = points[:, None] - points
    return np.asarray(np.hypot(away[..., 0], away[..., 1]))
