"""`Contact`: forces between limbs that touch each other or a body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from seastar_gym.scene.number import Numbers, check_numbers, positive
from seastar_gym.scene.serial import register_part

LARGEST_OVERLAP = 0.5
"""Depth over the distance at which limbs touch, beyond which a simulator warns: forces are linear in the depth, and
limbs that meet twice as fast come twice as deep, to each other's centre lines, and would pass through each other. Near
a hub whose clamps turn past each other, coarse meshes see less of it than fine ones."""


@register_part
@dataclass(frozen=True)
class Contact:
    """Contact: limbs that touch push each other apart, without friction, and so do limbs and a body.

    See der/contact/contact.py. A body is as hard as a limb that touches it. Limbs do not meet it by their root edges.
    `StrokeReport.largest_overlap` has the depth to which they press; beyond LARGEST_OVERLAP a simulator warns, once.

    modulus: Force per length of limb and per depth of overlap [Pa]. None means pi/6 of Young's modulus, the value of
        incompressible elastic cylinders side by side: pi/4 E*, 1/E* = 2 (1 - 0.5^2)/E (Popov, Contact Mechanics and
        Friction).
        It suits any mesh: limbs give way at a point over 1.57 radii.
    layer: Length over which a limb gives way where it is pressed at a point [m], in place of a modulus, for coarse
        meshes that do not resolve the default's. Each limb has the modulus 4 EI/layer^4 of its own bending stiffness:
        a beam on an elastic foundation k decays as exp(-x (k/4 EI)^(1/4)) from where it is pressed, and a force F
        presses it F layer^3/(8 EI) deep (Hetenyi, Beams on Elastic Foundation). Softer than the limbs themselves are,
        it changes where they go, and limbs that press hard pass through each other sooner, which stops their robot.
    opening_angle: Angle between neighbouring limbs at the hub at which they touch [rad]. Since all limbs begin at one
        point, they taper towards it over three radii divided by this angle, along a cubic that is flat at either end:
        limbs that are pressed onto each other near the hub come to stand at this angle. They lie within cones that fit
        into it. On a body they taper likewise from their roots, and must leave its rim at more than half the angle.
    """

    modulus: Annotated[Numbers | None, positive("Pa")] = None
    opening_angle: Annotated[float, positive("rad")] = 0.25
    layer: Annotated[Numbers | None, positive("m")] = None

    def __post_init__(self) -> None:
        check_numbers(self)
        if self.modulus is not None and self.layer is not None:
            raise ValueError("Contact has either a modulus [Pa] or a layer [m], which says the same.")
