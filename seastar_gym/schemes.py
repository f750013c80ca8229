"""Time stepping schemes of scenes: those of the package, and tableaux that a user has registered."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from seastar_gym.rods.step import OWN_SCHEMES, SCHEMES, Scheme, scheme_of, tableau
from seastar_gym.scene import numerics
from seastar_gym.scene.checks import shown
from seastar_gym.scene.scene import Scene


def register_scheme(name: str, A: ArrayLike, b: ArrayLike) -> None:
    """Register a diagonally implicit Runge-Kutta scheme of your own, for `Numerics(scheme=name)`.

    A: Shape (n, n), zero above the diagonal, positive on it. b: Shape (n,), adding up to 1. Where b is the last row of
    A, the last stage is the step's result. Stages that would have to be solved together, or one that is explicit, and
    tableaux that are not A-stable, raise a ValueError in one sentence, as does a name that another tableau has.
    """
    if not isinstance(name, str) or not (name and name.isprintable()):
        raise ValueError(f"A scheme's name must be a text, not {shown(name)}.")
    own = tableau(A, b)
    known = {**SCHEMES, **OWN_SCHEMES}.get(name, own)
    if not (np.array_equal(known.a, own.a) and np.array_equal(known.b, own.b)):
        raise ValueError(f"There is a scheme {name!r} with other numbers already: give this one another name.")
    if name not in SCHEMES:
        OWN_SCHEMES[name] = own
    if name not in numerics.SCHEME_NAMES:
        numerics.SCHEME_NAMES.append(name)


def scheme_for(scene: Scene) -> Scheme:
    """Scheme of a scene. ValueError where its terms cannot follow an own scheme."""
    found = scheme_of(scene.numerics.scheme, scene.numerics.damping)
    if found.n_stages > 1 and not found.stiffly_accurate and (scene.contact is not None or scene.robot.has_body):
        raise ValueError(
            f"The scheme {scene.numerics.scheme!r} does not end with its last stage, as contact and bodies need it of "
            "several stages: use one whose b is the last row of A."
        )
    return found
