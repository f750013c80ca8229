"""Symmetry of robots: one of n equal limbs swims alike in every sector of the regular n-gon.

Directions in the body frame fall into 2n sectors; sector g spans the angles [g pi/n, (g + 1) pi/n]. *Element* g of the
symmetry group is the turn (g even) or the turn and mirror (g odd) that brings sector g onto sector 0:

    element 2k:      turn by -2 pi k/n
    element 2k - 1:  turn by -2 pi k/n, then mirror at the x axis (y -> -y), for k = 1..n

An element carries a robot with its waypoints onto another robot, whose limb j was limb `limb_order(n)[g, j]`; a mirror
swaps the commands + and -, and does to the memory of actuators what they say (`memory_mirror`). A turn leaves the turns
that asked headings ask for as they are, a mirror reverses them. What a task shows of its own is carried by its kind
(`own_numbers.py`). A controller that sees
only waypoints in sector 0 and whose actions are carried back is equivariant: in a turned or mirrored world it swims the
turned or mirrored way.

Robots with less symmetry have less to turn and to mirror: four limbs at a rectangle have a mirror and half a turn. A
`PointGroup` says what there is, `symmetry_of` finds it from limbs, body and attachments, and all functions take it in
place of n. Its sectors begin at a mirror's line; with turns alone there are even elements only, whose sectors are twice
as wide.

The functions take batches: observations of shape (..., size), as laid out in `observation.py`, and elements of shape
(...).
"""

from seastar_gym.envs.symmetry.actions import action_table, restore_actions, transform_actions, transform_commands
from seastar_gym.envs.symmetry.group import compose, inverse, limb_order, turns
from seastar_gym.envs.symmetry.masks import transform_masks
from seastar_gym.envs.symmetry.memory import Recollection, VectorMemory
from seastar_gym.envs.symmetry.observations import reduce_observations, sectors, transform_observations
from seastar_gym.envs.symmetry.scenes import memory_mirror, require_symmetry, symmetry_of
from seastar_gym.envs.symmetry.wrappers import SymmetryReduction, VectorSymmetryReduction, observed_mirror

__all__ = [
    "Recollection",
    "SymmetryReduction",
    "VectorMemory",
    "VectorSymmetryReduction",
    "action_table",
    "compose",
    "inverse",
    "limb_order",
    "memory_mirror",
    "observed_mirror",
    "reduce_observations",
    "require_symmetry",
    "restore_actions",
    "sectors",
    "symmetry_of",
    "transform_actions",
    "transform_commands",
    "transform_masks",
    "transform_observations",
    "turns",
]
