"""Slopes of what is computed before a swim, and costs nothing, by differences of fourth order.

Coefficients of rods, places at rest and rotations by actuators follow from numbers of a scene by short formulas. Four
more points of them give slopes to some 1e-11: formulas with powers up to the fourth have no error but rounding.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Stencil(NamedTuple):
    """Places beside a number, in steps, and what the changes there weigh in the slope times the step."""

    places: tuple[float, ...]
    weights: tuple[float, ...]

    def slope(self, value: Floats, beside: Floats, step: float) -> Floats:
        """Slope from the value and from those at the places, shape (4, ...); exactly zero for constants."""
        return np.asarray(np.tensordot(self.weights, beside - value, axes=1) / step)


CENTRAL = Stencil((-2.0, -1.0, 1.0, 2.0), (1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0))
UPWARDS = Stencil((1.0, 2.0, 3.0, 4.0), (4.0, -3.0, 4.0 / 3.0, -0.25))
DOWNWARDS = Stencil((-1.0, -2.0, -3.0, -4.0), (-4.0, 3.0, -4.0 / 3.0, 0.25))
OF_COMMANDS, OF_NUMBERS = 1e-4, 3e-4
"""Steps: of commands, and of numbers as a share of each; for a number that is zero it is the step."""


def of_command(command: float) -> Stencil:
    """Stencil of a command: at the ends of [-1, 1] it looks inwards."""
    room = 2.0 * OF_COMMANDS
    return DOWNWARDS if command > 1.0 - room else UPWARDS if command < room - 1.0 else CENTRAL


def step_of(number: float) -> float:
    return OF_NUMBERS * (abs(number) or 1.0)


def arrays_of(bundle: Any) -> list[Floats]:
    """Arrays of a bundle of coefficients, and of the bundles in it, in the order of fields."""
    if isinstance(bundle, np.ndarray):
        return [bundle]
    return [array for field in bundle for array in arrays_of(field)] if hasattr(bundle, "_fields") else []
