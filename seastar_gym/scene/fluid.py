"""`Water`: the fluid around the robot."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from seastar_gym.scene.checks import require_number, shown
from seastar_gym.scene.currents import AnyCurrent
from seastar_gym.scene.per_robot import Numbers, batch_size, require_each
from seastar_gym.scene.serial import register_part


@register_part
@dataclass(frozen=True)
class Water:
    """Fluid with the quadratic drag of (13.8).

    density: rho_f [kg/m^3].
    drag_coefficient: C_d [1], drag coefficient of flow across a limb.
    tangential_drag_coefficient: C_t [1], drag coefficient of flow along a limb, at most C_d. None means C_d. With the
        velocity w relative to the fluid and its part w_n normal to the limb, the friction C_t |w| w and the pressure
        (C_d - C_t) |w_n| w_n add up (after G. I. Taylor, 1952).
    current: Velocity field of the fluid. None means that the fluid is at rest.
    added_mass_coefficient: C_a [1], mass of the fluid that a limb accelerates when it moves sideways, over the mass of
        the fluid that it displaces; 1 for a round limb. None means no added mass, as in the chapter.
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
                    f"{shown(self.tangential_drag_coefficient)} is more than {shown(self.drag_coefficient)}."
                )
        if self.added_mass_coefficient is not None:
            require_each(self, "added_mass_coefficient", partial(not_negative, unit="1"))
        if not isinstance(self.current, AnyCurrent | None):
            raise ValueError(f"current must be a current such as UniformCurrent(u_x=0.001), not {shown(self.current)}.")
