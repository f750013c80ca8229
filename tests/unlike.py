"""Robots of unlike limbs in the chapter's discretisation, for the kernels and for the oracle."""

import numpy as np

from oracle import Shaped
from seastar_gym import Limb, Seastar

DIFFERENT = {
    "one limb": ([(0.0, 0.08, (2e-3, 1e-3), (1e6, 2e6), 5.0)], "opening"),
    "two limbs at an angle": (
        [(0.0, 0.1, (2e-3, 1e-3), (1e6, 1e6), 0.0), (2.0, 0.05, (1e-3, 1e-3), (2e6, 1e6), -6.0)],
        "opening",
    ),
    "two limbs in line": (
        [(0.0, 0.1, (2e-3, 1.6e-3), (1e6, 1e6), 0.0), (np.pi, 0.1, (1.6e-3, 1.6e-3), (1e6, 1e6), 3.0)],
        "turning",
    ),
    "a gap wider than pi": (
        [(angle, 0.1 + 0.02 * angle, (1.6e-3, 1e-3), (1e6, 1e6), 2.0 - angle) for angle in (0.0, 1.0, 2.2)],
        "opening",
    ),
    "four limbs, turning": (
        [(angle, 0.1, (1.6e-3, 1e-3 + 1e-4 * angle), (1e6, 1.5e6), 0.0) for angle in (0.0, 1.2, 3.0, 4.9)],
        "turning",
    ),
    "five unlike limbs": (
        [(1.1 * j, 0.06 + 0.01 * j, (2e-3, 1e-3 + 2e-4 * j), (1e6, 8e5), 3.0 * (-1) ** j) for j in range(5)],
        "opening",
    ),
}


def robot_and_star(name: str, nodes_per_limb: int = 4, **fluid: float) -> tuple[Seastar, Shaped]:
    limbs, hub = DIFFERENT[name]
    own = tuple(Limb(*limb) for limb in limbs)
    robot = Seastar(len(limbs), nodes_per_limb, hub_hinge=hub, limbs=own, discretisation="chapter")
    directions, lengths, radii, moduli, curvatures = zip(*limbs, strict=True)
    star = Shaped(
        len(limbs), nodes_per_limb, hub_hinge=hub, directions=directions, lengths=lengths, radii=radii, moduli=moduli,
        curvatures=curvatures, **fluid,
    )  # fmt: skip
    return robot, star
