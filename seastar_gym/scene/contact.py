"""What limbs do to each other where they touch, as a frozen dataclass in SI units."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from seastar_gym.scene.checks import require_number
from seastar_gym.scene.per_robot import Numbers, require_each
from seastar_gym.scene.serial import register_part


@register_part
@dataclass(frozen=True)
class Contact:
    """Limbs do not pass through each other: they push each other apart, without friction, see der/contact.py.

    modulus: Force per length of limb and depth [Pa], or None for pi/6 of Young's modulus, that of incompressible
        elastic cylinders side by side: pi/4 E*, 1/E* = 2 (1 - 0.5^2)/E (Popov, Contact Mechanics and Friction).
    opening_angle: Limbs begin at one point, so near the hub they cannot be as thick as they are: they are cones there
        that touch where they enclose this angle [rad].
    """

    PER_ROBOT: ClassVar = ("modulus",)
    modulus: Numbers | None = None
    opening_angle: float = 0.3

    def __post_init__(self) -> None:
        if self.modulus is not None:
            require_each(self, "modulus", partial(require_number, unit="Pa"))
        require_number("opening_angle", self.opening_angle, "rad")
