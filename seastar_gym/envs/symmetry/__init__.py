"""Symmetry of robots: one of n equal limbs swims alike in every sector of the regular n-gon.

Directions in the body frame fall into 2n sectors; sector g spans the angles [g pi/n, (g + 1) pi/n]. *Element* g of the
symmetry group is the turn (g even) or the turn and mirror (g odd) that brings sector g onto sector 0:

    element 2k:      turn by -2 pi k/n
    element 2k - 1:  turn by -2 pi k/n, then mirror at the x axis (y -> -y), for k = 1..n

An element carries a robot with its waypoints onto another robot, whose limb j was limb `limb_order(n)[g, j]`; a mirror
swaps the commands + and -, and does to the memory of actuators what they say (`memory_mirror`). A turn leaves the turns
that asked headings ask for as they are, a mirror reverses them. Further entries of an observation are carried by what
they are (`layout.py`). A controller that sees only waypoints in sector 0 and whose actions are carried back is
equivariant: in a turned or mirrored world it swims the turned or mirrored way.

Robots with less symmetry have less to turn and to mirror: four limbs at a rectangle have a mirror and half a turn. A
`PointGroup` says what there is, `symmetry_of` finds it from limbs, body and attachments, and all functions take it in
place of n. Its sectors begin at a mirror's line; with turns alone there are even elements only, whose sectors are twice
as wide.

A `Symmetry` knows the group, the layout and the actions of a robot. Its methods take batches: observations of shape
(..., size), and elements of shape (...).
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
