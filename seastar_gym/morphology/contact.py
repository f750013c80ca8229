"""Coefficients of contact between limbs, for the kernel der/contact.py."""

import itertools
from collections.abc import Sequence

import numpy as np

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
