"""Scenes of the study: the chapter's robot with one term more each, for any discretisation and number of nodes."""

from typing import Any

from seastar_gym.scene import Contact, Limb, Numerics, Scene, Seastar, SmaPulse, Vortex, Water
from seastar_gym.scene.robot import Discretisation

TAU = 5e-3
"""Relaxation time of the damping [s] that keeps orders of convergence clean: undamped limbs ring for the whole swim."""

UNEQUAL = (Limb(radius=(2e-3, 1e-3)), Limb(length=0.08), Limb(), Limb(youngs_modulus=(2e6, 5e5)), Limb())
"""A tapered limb, a short one, and one that softens towards its tip."""

ROBOTS: dict[str, dict[str, Any]] = {
    "undamped": {"relaxation_time": None},
    "three limbs": {"n_limbs": 3},
    "twelve limbs": {"n_limbs": 12},
    "unequal, tapered limbs": {"limbs": UNEQUAL},
    "curved limbs": {"limbs": (Limb(natural_curvature=6.0),) * 5},
    "soft limbs": {"youngs_modulus": 2e5},
}
"""What robots have that differ from the chapter's with damping."""

PARTS: dict[str, dict[str, Any]] = {
    "three limbs": {"actuator": SmaPulse(0.4)},  # hub hinges of the chapter allow no more
    "vortex": {"fluid": Water(current=Vortex(1e-4))},
    "drag along limbs": {"fluid": Water(tangential_drag_coefficient=0.1)},
    "added mass": {"fluid": Water(added_mass_coefficient=1.0)},
    "contact": {"contact": Contact()},
    "contact, layer of 10 mm": {"contact": Contact(layer=10e-3)},
}
"""Other parts of a scene than the robot."""

NAMES = tuple(dict.fromkeys(("damped", *ROBOTS, *PARTS)))


def scene(name: str, discretisation: Discretisation, nodes_per_limb: int, step: float = 1e-3) -> Scene:
    """Scene of that name, with the implicit midpoint rule at a step [s] that leaves errors of space alone."""
    robot = {"relaxation_time": TAU} | ROBOTS.get(name, {})
    return Scene(
        Seastar(nodes_per_limb=nodes_per_limb, discretisation=discretisation, **robot),
        numerics=Numerics("implicit-midpoint", step),
        **PARTS.get(name, {}),
    )
