"""Terms of the equation of motion from a user's own file."""

from dataclasses import is_dataclass
from typing import Any, TypeVar

from seastar_gym.scene.checks import shown
from seastar_gym.scene.serial import KINDS, register_part

Term = TypeVar("Term")

FUNCTIONS = "energy", "dissipation"
"""What a term may have, at least one of them."""


def register_term(kind: type[Term]) -> type[Term]:
    """Register a force of your own on the nodes of limbs, for `Scene(terms=(kind(...),))`. A decorator.

    The class is a frozen dataclass, as for `register_part`, and has

    coefficients(self, mesh): One number per node, shape (n_nodes,), or a tuple of such. `mesh.dl` is the length of
        every node [m], `mesh.per_node(mesh.at_nodes.width)` its diameter [m]; see seastar_gym/rods/star.py.
    dissipation(c, wx, wy): Static; a convex dissipation potential D [W] of a node's velocity relative to the water
        [m/s], least at rest. The force is -grad D.
    energy(c, x, y): Static; the energy U [J] of a node at (x, y) [m]. The force is -grad U.

    One of the two is enough. Each returns (value, (slope in the first, in the second number), (second slopes xx, xy,
    yy)) of c, a node's coefficients as `coefficients` gives them, with the operators and functions of
    seastar_gym/lanes/registers.py alone; other functions that it calls are kernels (seastar_gym/lanes/compile.py).
    isotropic = True in the class tells wrappers of symmetry that turns and mirrors do not change it.
    """
    has = [name for name in FUNCTIONS if callable(getattr(kind, name, None))] if isinstance(kind, type) else []
    if not (has and callable(getattr(kind, "coefficients", None)) and is_dataclass(kind)):
        raise ValueError(
            f"A term is a frozen dataclass with coefficients(self, mesh) and a static energy(c, x, y) or "
            f"dissipation(c, wx, wy), or both, which {shown(kind)} is not."
        )
    for name in has:
        if not isinstance(vars(kind).get(name, None), staticmethod | None):
            raise ValueError(f"{kind.__name__}.{name} must be a staticmethod: compiled code has no self.")
    return register_part(kind)


def is_term(value: Any) -> bool:
    """Whether a value is of a class that `register_term` has registered."""
    kind = type(value)
    return KINDS.get(kind.__name__) is kind and any(hasattr(kind, name) for name in FUNCTIONS)
