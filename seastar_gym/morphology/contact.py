"""Coefficients of contact between limbs, for the kernel der/contact.py."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.rods import Contact
from seastar_gym.morphology.limb import LimbShape, along
from seastar_gym.morphology.mesh import Mesh, nodes_along

OF_CYLINDERS = np.pi / 6.0
"""Force per length and depth over Young's modulus, see seastar_gym/contact.py."""


def limbs_that_may_touch(gaps: Sequence[float], alike: bool) -> list[tuple[int, int]]:
    """(right, left) limbs with less than a half turn in between: neighbours, or all such pairs, if limbs are not alike.

    gaps: Angle from every limb to the next [rad]. alike: Whether none is longer, and could reach over another.
    """
    n_limbs = len(gaps)
    turns = {
        (first, (first + steps) % n_limbs): sum(gaps[(first + k) % n_limbs] for k in range(steps))
        for first, steps in itertools.product(range(n_limbs), range(1, 2 if alike else n_limbs))
    }
    return [pair for pair, turn in turns.items() if pair[0] != pair[1] and turn < np.pi * (1.0 - 1e-9)]


def cross_at_rest(nodes: NDArray[np.float64], n_limbs: int, pairs: Sequence[tuple[int, int]]) -> bool:
    """Whether edges of limbs that may touch cross; nodes: [m], shape (n_nodes, 2)."""
    limbs = [np.concatenate([nodes[:1], limb]) for limb in nodes[1:].reshape(n_limbs, -1, 2)]

    def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
        return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

    for right, left in pairs:
        f, tails = np.diff(limbs[left], axis=0), limbs[left][:-1]
        for tail, e in zip(limbs[right][:-1], np.diff(limbs[right], axis=0), strict=True):
            of_e, of_f = cross(e, f) * cross(tails - tail, f), cross(e, f) * cross(tails - tail, e)
            if ((of_e > 0.0) & (of_f > 0.0) & (np.maximum(of_e, of_f) < cross(e, f) ** 2)).any():
                return True
    return False


def contact(
    limbs: Sequence[LimbShape],
    mesh: Mesh,
    pairs: Sequence[tuple[int, int]],
    modulus: float | None,
    opening_angle: float,
) -> Contact:
    """Thickness and stiffness of every node; half of the latter, because nodes of both limbs push."""
    share = nodes_along(1 + len(mesh.l) // len(limbs))
    thickness, stiffness = [0.0], [0.0]
    for limb, radii in zip(limbs, mesh.radius_at_nodes, strict=True):
        moduli = [OF_CYLINDERS * E if modulus is None else modulus for E in along(limb.youngs_modulus, share)]
        thickness += [min(r, 0.5 * opening_angle * limb.length * s) for r, s in zip(radii, share, strict=True)][1:]
        stiffness += moduli[1:]
    return Contact(
        n_pairs=len(pairs),
        pairs=np.array(pairs, dtype=float).ravel(),
        thickness=np.array(thickness),
        widest=np.array([2.0 * max(thickness)]),
        stiffness=0.5 * np.array(stiffness) * mesh.dl,
    )
