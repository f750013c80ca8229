"""Parameters: positive numbers of a scene, read and replaced by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import is_dataclass
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.checks import as_finite, is_finite_number, require_kind, require_texts, shown
from seastar_gym.scene.per_robot import MISSING, at, numbers_of, with_numbers

Floats = NDArray[np.float64]

COUNTS = (int, int | Any)
"""Types of fields that are counts, which nobody fits."""


def get_parameter(scene: Scene, name: str) -> float:
    """Value of a parameter of the scene. ValueError if no positive number, counts excepted, has that name."""
    if not isinstance(scene, Scene) or not isinstance(name, str):
        raise ValueError(f"A Scene and a parameter's name are needed, not {shown(scene)} and {shown(name)}.")
    value = _found(scene, name)
    if not is_finite_number(value) or value <= 0.0:
        raise ValueError(f"{shown(name)} is no positive number of this scene, {_why_not(scene, name, value)}.")
    return float(value)


def _found(scene: Scene, name: str) -> Any:
    """What a name stands for; MISSING for nothing, and for counts."""
    owner, _, last = name.rpartition(".")
    part = type(at(scene, owner))
    is_count = is_dataclass(part) and get_type_hints(part).get(last) in COUNTS
    known = name.split(".")[0] in ("robot", "fluid", "actuator", "contact") and not is_count
    return at(scene, name) if known else MISSING


def _why_not(scene: Scene, name: str, value: Any) -> str:
    """End of the sentence that refuses to fit what a name stands for."""
    if numbers_of(scene).get(name, 0.0) is None:
        return "which leaves it out (None): give it a first guess"
    if is_finite_number(value):
        return f"where it is {value:g}: the logarithm is fitted, so give it a first guess above zero"
    if isinstance(value, tuple) and value and all(map(is_finite_number, value)):
        return f"but {len(value)} of them: name one, such as {name}.1"
    return "such as fluid.drag_coefficient"


def with_parameters(scene: Scene, names: Sequence[str], values: Sequence[float] | Floats) -> Scene:
    """Scene with other values of the named parameters."""
    require_kind("scene", scene, Scene, "a Scene")
    require_texts("names", names)
    for name in names:
        if "." not in name or _found(scene, name) is MISSING:
            raise ValueError(f"{shown(name)} is no number of this scene, such as fluid.drag_coefficient.")
    numbers = as_finite("values", values, (len(names),))
    if numbers.ndim != 1:
        raise ValueError(f"values must be one for each of {len(names)} names, not of shape {numbers.shape}.")
    return with_numbers(scene, dict(zip(names, numbers.tolist(), strict=True)))
