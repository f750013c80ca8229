"""Joints of limbs at the hub: springs between the hub and a limb's root, in a row with the clamp."""

from collections.abc import Sequence

import numpy as np

from seastar_gym.der.terms.bending import Bending


def with_joints(bending: Bending, stiffnesses: Sequence[float | None]) -> Bending:
    """Bending with the compliances of joints, of these stiffnesses [N m/rad], added to those of clamps; None for none.

    Exact for small turns; a joint and its clamp share larger ones as the clamp alone does, K (1 - cos(turn)).
    """
    EI_over_dl, dl_over_EI = bending.EI_over_dl.copy(), bending.dl_over_EI.copy()
    roots = np.arange(len(stiffnesses)) * (len(EI_over_dl) // len(stiffnesses))
    for root, stiffness in zip(roots.tolist(), stiffnesses, strict=True):
        if stiffness is not None:
            dl_over_EI[root] += 1.0 / stiffness
            EI_over_dl[root] = 1.0 / dl_over_EI[root]
    return bending._replace(EI_over_dl=EI_over_dl, dl_over_EI=dl_over_EI)
