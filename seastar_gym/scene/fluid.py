"""The fluid around the robot, as a frozen dataclass in SI units; for numbers of each robot see per_robot.py."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from seastar_gym.scene.checks import require_number
from seastar_gym.scene.currents import AnyCurrent
from seastar_gym.scene.per_robot import Numbers, batch_size, require_each
from seastar_gym.scene.serial import register_part


@register_part
@dataclass(frozen=True)
class Water:
    """A fluid with the quadratic drag of (13.8).

    density: rho_f [kg/m^3]. drag_coefficient: C_d, of flow across a limb, and of all flow by default.
    tangential_drag_coefficient: C_t, of flow along a limb; None for that of flow across. The friction C_t |w| w of all
        flow and the pressure (C_d - C_t) |w_n| w_n of the flow across add up, w_n the normal part of w (after G. I.
        Taylor, 1952): no less than C_t across, so C_t must not exceed C_d.
    current: How the fluid moves, or None if it is at rest; w is the velocity relative to it.
    added_mass_coefficient: C_a, mass of the fluid that a limb accelerates across itself over that which it displaces,
        1 for a round limb; None for none, as in the chapter.
    """

    PER_ROBOT: ClassVar = ("density", "drag_coefficient", "tangential_drag_coefficient", "added_mass_coefficient")
    density: Numbers = 1000.0
    drag_coefficient: Numbers = 1.0
    tangential_drag_coefficient: Numbers | None = None
    current: AnyCurrent | None = None
    added_mass_coefficient: Numbers | None = None

    def __post_init__(self) -> None:
        not_negative = partial(require_number, zero_allowed=True)
        require_each(self, "density", partial(not_negative, unit="kg/m^3"))
        require_each(self, "drag_coefficient", partial(not_negative, unit="1"))
        if self.tangential_drag_coefficient is not None:
            require_each(self, "tangential_drag_coefficient", partial(not_negative, unit="1"))
            batch_size(self)
            if np.any(np.greater(self.tangential_drag_coefficient, self.drag_coefficient)):
                raise ValueError(
                    "tangential_drag_coefficient must not exceed drag_coefficient, that of flow across a limb: "
                    f"{self.tangential_drag_coefficient!r} is more than {self.drag_coefficient!r}."
                )
        if self.added_mass_coefficient is not None:
            require_each(self, "added_mass_coefficient", partial(not_negative, unit="1"))
        if not isinstance(self.current, AnyCurrent | None):
            raise ValueError(f"current must be a current such as UniformCurrent(u_x=0.001), not {self.current!r}.")
