"""Physics that policies are trained and swum on: numerics with nodes per limb, and other fluids and materials."""

from dataclasses import replace

from seastar_gym import Numerics, Scene, Seastar, Water, relaxation_time
from seastar_gym.scene.numerics import PRESETS

NODES = (8, 10, 19)
"""Nodes per limb."""
NUMERICS: dict[str, Numerics] = {
    "coarse": Numerics("sdirk2", 20e-3, 1e-6),
    "balanced": PRESETS["balanced"].numerics,
    "reference": PRESETS["reference"].numerics,
    "chapter": PRESETS["chapter"].numerics,
}
"""Numerics by name. Those of the fidelities "fast" and "balanced" are the same: they differ in nodes only.

"coarse" has the longest steps that `seastar_gym.certify` measures. "chapter" has the chapter's discretisation, too.
"""
DEAR, CHEAP = "reference 19", "coarse 8"
"""The dearest fidelity, which stands for the truth, and the cheapest one."""
_MIDDLE = Seastar(nodes_per_limb=10)
PHYSICS: dict[str, Scene] = {
    "drag along limbs": Scene(_MIDDLE, Water(tangential_drag_coefficient=0.1), numerics=NUMERICS["balanced"]),
    "added mass": Scene(_MIDDLE, Water(added_mass_coefficient=1.0), numerics=NUMERICS["balanced"]),
    "silicone": Scene(replace(_MIDDLE, relaxation_time=relaxation_time(0.1, 10.0)), numerics=NUMERICS["balanced"]),
}
"""Physics that nobody is trained in, at "balanced 10": a tenth of the drag along limbs, added mass, damped material."""


def fidelity(numerics: str, nodes_per_limb: int) -> Scene:
    """Chapter's robot in water with numerics of that name."""
    discretisation = PRESETS["chapter" if numerics == "chapter" else "balanced"].discretisation
    robot = Seastar(nodes_per_limb=nodes_per_limb, discretisation=discretisation)
    return Scene(robot, numerics=NUMERICS[numerics])


FIDELITIES: dict[str, Scene] = {f"{name} {nodes}": fidelity(name, nodes) for name in NUMERICS for nodes in NODES}
"""Fidelities that policies are trained at, by name."""
SWUM: dict[str, Scene] = FIDELITIES | PHYSICS
"""Physics that every policy is swum on."""
