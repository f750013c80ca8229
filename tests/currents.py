"""One current of every kind, and the same from their definitions."""

import numpy as np

from seastar_gym import GridCurrent, ShearCurrent, UniformCurrent, Vortex, Water

NONE = Water(1000.0, 1.0, 1.0, UniformCurrent(), 0.0)
"""Water that has every term and shows none: each other set of terms would be machine code of its own to compile. Robots
with a relaxation time, which may be 0, go with it."""


def swirl(x, y):
    """A current that is linear in x, in y and in x y, as bilinear interpolation is."""
    return 0.1 + 0.3 * x - 0.5 * y + 2.0 * x * y, 0.2 * x + 0.05 * y


CURRENTS = {
    "uniform": UniformCurrent(0.03, -0.02),
    "shear": ShearCurrent(0.4, direction=0.7),
    "vortex": Vortex(0.02, x=0.1, y=-0.05, core_radius=0.06),
    "grid": GridCurrent.from_function(swirl, (-0.4, 0.4), (-0.5, 0.4), 0.05),
}


def velocity(name: str, places: np.ndarray) -> np.ndarray:
    """The currents once more, from their definitions."""
    x, y = places.T
    match name:
        case "uniform":
            return np.tile([0.03, -0.02], (len(x), 1))
        case "shear":
            along, across = np.array([np.cos(0.7), np.sin(0.7)]), np.array([-np.sin(0.7), np.cos(0.7)])
            return 0.4 * (places @ across)[:, None] * along
        case "vortex":
            r, angle = np.hypot(x - 0.1, y + 0.05), np.arctan2(y + 0.05, x - 0.1)
            speed = 0.02 / (2.0 * np.pi) * r / (0.06**2 + r**2)
            return speed[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
        case _:
            return np.stack(swirl(x, y), axis=1)
