"""Coefficients of contact between limbs, for the kernel der/contact.py."""

from collections.abc import Sequence

import numpy as np

from seastar_gym.der.rods import Contact
from seastar_gym.model.mesh import Mesh, nodes_along
from seastar_gym.scene import contact as contact_scene
from seastar_gym.scene.limb import LimbShape, along

OF_CYLINDERS = np.pi / 6.0
"""Force per length and depth over Young's modulus, see seastar_gym/scene/contact.py."""


def contact(
    limbs: Sequence[LimbShape],
    mesh: Mesh,
    pairs: Sequence[tuple[int, int]],
    said: contact_scene.Contact,
) -> Contact:
    """Thickness and stiffness of every node; half of the latter, because nodes of both limbs push."""
    modulus, opening_angle = said.modulus, said.opening_angle
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
