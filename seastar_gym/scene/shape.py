"""Geometry of a robot at rest: node positions, natural angles of hinges, and limbs that may touch."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.limb import LimbShape

Floats = NDArray[np.float64]


def rest_positions(limbs: Sequence[LimbShape], nodes_per_limb: int, tangent: bool) -> Floats:
    """Node positions of the undeformed robot [m], shape (n_nodes, 2): hub at the origin, limb after limb.

    Edges of a limb have equal lengths and turn by its natural curvature times that length, so its nodes lie on an arc.

    tangent: Whether a limb's direction is that of the arc at the hub, rather than that of its root edge.
    """
    i = np.arange(1, nodes_per_limb)
    nodes = [np.zeros((1, 2))]
    for limb in limbs:
        half_turn = 0.5 * turn_per_hinge(limb, nodes_per_limb)
        # Length of the sum of i unit vectors, each turned from the last by twice half_turn, over i.
        chord = np.sin(i * half_turn) / (i * np.sin(half_turn)) if half_turn else 1.0
        distance = limb.length * i / (nodes_per_limb - 1) * chord
        angle = limb.direction + (i if tangent else i - 1) * half_turn
        x, y = limb.root
        nodes.append(np.stack([x + distance * np.cos(angle), y + distance * np.sin(angle)], axis=1))
    return np.concatenate(nodes)


def turn_per_hinge(limb: LimbShape, nodes_per_limb: int) -> float:
    """Natural angle of the hinges within a limb [rad]."""
    return limb.natural_curvature * limb.length / (nodes_per_limb - 1)


def natural_hub_angle(gap: float, hub_hinge: str) -> float:
    """Natural angle of an unactuated hub hinge [rad], from -pi to pi.

    gap: Angle between the two limbs [rad]. hub_hinge: Measure of the hinge, see `Seastar`.
    """
    if hub_hinge == "turning":
        return gap - np.pi
    return gap if gap <= np.pi else gap - 2.0 * np.pi


def n_hub_hinges(n_limbs: int) -> int:
    """Number of hub hinges: one between neighbouring limbs, and one in all for two limbs."""
    return n_limbs if n_limbs > 2 else n_limbs - 1


def limbs_that_may_touch(gaps: Sequence[float], alike: bool) -> list[tuple[int, int]]:
    """Pairs of limbs (right, left) less than half a turn apart: neighbours, or all such pairs if lengths differ.

    gaps: Angle from every limb to the next [rad]. alike: Whether limbs have equal lengths, so that none can reach over
        another.
    """
    n_limbs = len(gaps)
    turns = {
        (first, (first + steps) % n_limbs): sum(gaps[(first + k) % n_limbs] for k in range(steps))
        for first, steps in itertools.product(range(n_limbs), range(1, 2 if alike else n_limbs))
    }
    return [pair for pair, turn in turns.items() if pair[0] != pair[1] and turn < np.pi * (1.0 - 1e-9)]


def cross_at_rest(nodes: NDArray[np.float64], n_limbs: int, pairs: Sequence[tuple[int, int]]) -> bool:
    """Whether limbs of any of the pairs cross. nodes: Node positions [m], shape (n_nodes, 2)."""
    limbs = [np.concatenate([nodes[:1], limb]) for limb in nodes[1:].reshape(n_limbs, -1, 2)]
    return any(lines_cross(limbs[right], limbs[left]) for right, left in pairs)


def lines_cross(line: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether two lines of edges cross, each with its corners, shape (n, 2)."""

    def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
        return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

    f, tails = np.diff(other, axis=0), other[:-1]
    for tail, e in zip(line[:-1], np.diff(line, axis=0), strict=True):
        of_e, of_f = cross(e, f) * cross(tails - tail, f), cross(e, f) * cross(tails - tail, e)
        if ((of_e > 0.0) & (of_f > 0.0) & (np.maximum(of_e, of_f) < cross(e, f) ** 2)).any():
            return True
    return False
