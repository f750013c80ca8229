"""`Water`: the fluid around the robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from seastar_gym.scene.checks import shown
from seastar_gym.scene.currents import AnyCurrent
from seastar_gym.scene.number import Numbers, check_numbers, not_negative
from seastar_gym.scene.per_robot import batch_size
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

    density: Annotated[Numbers, not_negative("kg/m^3")] = 1000.0
    drag_coefficient: Annotated[Numbers, not_negative("1")] = 1.0
    tangential_drag_coefficient: Annotated[Numbers | None, not_negative("1")] = None
    current: AnyCurrent | None = None
    added_mass_coefficient: Annotated[Numbers | None, not_negative("1")] = None

    def __post_init__(self) -> None:
        check_numbers(self)
        if self.tangential_drag_coefficient is not None:
            batch_size(self)
            if np.any(np.greater(self.tangential_drag_coefficient, self.drag_coefficient)):
                raise ValueError(
                    "tangential_drag_coefficient must not exceed drag_coefficient, that of flow across a limb: "
                    f"{shown(self.tangential_drag_coefficient)} is more than {shown(self.drag_coefficient)}."
                )
        if not isinstance(self.current, AnyCurrent | None):
            raise ValueError(f"current must be a current such as UniformCurrent(u_x=0.001), not {shown(self.current)}.")
