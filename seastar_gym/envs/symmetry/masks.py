"""Masks of actions under the symmetry group: what a turned or mirrored robot's wires can follow."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.commands import Actions
from seastar_gym.envs.symmetry.actions import action_table, move_limbs
from seastar_gym.envs.symmetry.group import Group, inverse, is_mirror, n_limbs_of

Mask = NDArray[np.bool_]

MIRRORED = {"limbs": [0, 2, 1], "continuous": [1, 0]}
"""Order of a limb's numbers in a mask after a mirror: + and - change places."""


def transform_masks(masks: Mask, elements: ArrayLike, mode: Actions, group: Group) -> Mask:
    """Masks of the robots carried by the elements, shape (..., k), as in `seastar_gym.envs.masks`."""
    masks, elements = np.asarray(masks), np.asarray(elements, dtype=np.intp)
    if mode not in MIRRORED:
        before = action_table(mode, group)[inverse(elements, group)]
        return np.take_along_axis(masks, before, axis=-1)
    of_limbs = np.moveaxis(masks.reshape(*masks.shape[:-1], n_limbs_of(group), -1), -1, 0)
    moved = np.moveaxis(np.stack([move_limbs(one, elements, group) for one in of_limbs]), 0, -1)
    mirrored = np.where(is_mirror(elements)[..., None, None], moved[..., MIRRORED[mode]], moved)
    return mirrored.reshape(*masks.shape)
