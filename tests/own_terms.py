"""A force of a user's own, for tests."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from seastar_gym import register_term
from seastar_gym.scene.number import Numbers, check_numbers, finite, not_negative


@register_term
@dataclass(frozen=True)
class Trap:
    """A spring to a point, and linear drag, of a limb's length. k [N/m^2], c [N s/m^2], x [m]."""

    k: Annotated[Numbers, finite("N/m^2")] = 0.0
    c: Annotated[Numbers, not_negative("N s/m^2")] = 0.0
    x: Annotated[Numbers, finite("m")] = 0.0

    def __post_init__(self):
        check_numbers(self, "Trap.")

    def coefficients(self, mesh):
        return self.k * mesh.dl, self.c * mesh.dl, np.full(len(mesh.dl), float(self.x))

    @staticmethod
    def energy(of_node, x, y):
        k, _, centre = of_node
        away = x - centre
        return 0.5 * k * (away * away + y * y), (k * away, k * y), (k, 0.0 * k, k)

    @staticmethod
    def dissipation(of_node, wx, wy):
        c = of_node[1]
        return 0.5 * c * (wx * wx + wy * wy), (c * wx, c * wy), (c, 0.0 * c, c)
