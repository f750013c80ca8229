"""Axes of a sweep: what differs from design to design.

An axis has the name of a number of the scene ("robot.limb_length", "numerics.step"), of a whole part ("robot",
"fluid", "actuator", "numerics", "contact"), "fidelity" for the name of a preset, "gait" or "controller".
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, is_dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.checks import as_finite, is_finite_number, require_count, require_flag, require_kind, shown
from seastar_gym.scene.per_robot import MISSING, at

Floats = NDArray[np.float64]

PARTS = ("robot", "fluid", "actuator", "numerics", "contact")
"""Parts of a scene that an axis may replace as a whole."""
MOST_VALUES = 1_000_000
"""Most values of an axis that are spaced evenly."""


@dataclass(frozen=True)
class Range:
    """Axis of all numbers from `low` to `high`, evenly spread, or their logarithms are if `is_log`."""

    name: str
    low: float
    high: float
    is_log: bool = False

    def __post_init__(self) -> None:
        _require_name(self.name)
        require_flag("is_log", self.is_log)
        if not is_finite_number(self.low) or not is_finite_number(self.high) or self.low >= self.high:
            raise ValueError(f"{self.name} must go from a finite number to a larger one, not {shown(self)}.")
        if self.is_log and self.low <= 0.0:
            raise ValueError(f"Logarithms need positive numbers, and {self.name} begins at {shown(self.low)}.")

    def at(self, share: Floats) -> Floats:
        """Numbers at shares of the way from `low` to `high`."""
        share = as_finite("share", share, ())
        if self.is_log:
            low, high = math.log(self.low), math.log(self.high)
            return np.clip(np.exp(low + share * (high - low)), self.low, self.high)
        return self.low + share * (self.high - self.low)

    def spaced(self, n: int) -> Choices:
        """Axis of n of its numbers, both ends included."""
        require_count("n", n, 1, MOST_VALUES)
        return Choices(self.name, tuple(self.at(np.linspace(0.0, 1.0, n)).tolist()))


@dataclass(frozen=True)
class Choices:
    """Axis of a few values: numbers, names or parts of a scene.

    labels: Texts or numbers that stand for the values in results; by default the values themselves, or their kinds.
    """

    name: str
    values: tuple[Any, ...]
    labels: tuple[Any, ...] = field(default=())

    def __post_init__(self) -> None:
        _require_name(self.name)
        require_kind("labels", self.labels, tuple, "a tuple")
        if not isinstance(self.values, tuple) or not self.values:
            raise ValueError(f"{self.name} needs a tuple of values to choose from, not {shown(self.values)}.")
        labels = self.labels or tuple(map(_label, self.values))
        object.__setattr__(self, "labels", labels)
        known = all(isinstance(label, str | int | float) for label in labels)
        if not known or len(labels) != len(self.values) or len(set(labels)) < len(labels):
            raise ValueError(f"Values of {self.name} need labels that differ, not {shown(labels)}.")

    @property
    def is_numeric(self) -> bool:
        """Whether all values are finite numbers."""
        return all(map(is_finite_number, self.values))


Axis: TypeAlias = Range | Choices


def _require_name(name: object) -> None:
    """Refuse what is no name of an axis."""
    if not isinstance(name, str) or not name:
        raise ValueError(f"The name of an axis must be a text, not {shown(name)}.")


def _label(value: Any) -> Any:
    return value if isinstance(value, str | int | float) else type(value).__name__


def require_known(scene: Scene, name: str) -> None:
    """ValueError unless an axis of this name can change the scene."""
    if name in (*PARTS, "fidelity", "gait", "controller"):
        return
    owner, _, _ = name.rpartition(".")
    known = owner.split(".")[0] in PARTS and is_dataclass(at(scene, owner)) and at(scene, name) is not MISSING
    if not known:
        raise ValueError(f"{shown(name)} is nothing that a sweep can vary in this scene, such as robot.limb_length.")
