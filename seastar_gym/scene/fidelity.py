"""Measured errors and speeds of settings of `Numerics`.

They are stored in `presets.json`, and were measured by `python -m studies.accuracy --store` for the chapter's robot in
the chapter's water, over ten strokes from rest. For example, promise("fast").path_error is 0.05 if the hub strays from
its converged path by at most 5 % of the path's length.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from seastar_gym.scene.checks import is_finite_number, shown

PRESETS = Path(__file__).with_name("presets.json")
SETTING = ("scheme", "step", "newton_tolerance", "path_tolerance")


@dataclass(frozen=True)
class Promise:
    """Measured errors and speed of a setting of `Numerics`. Errors are relative to the solution for h -> 0.

    scheme, step [s], newton_tolerance, path_tolerance: Setting, see `Numerics`.
    path_error: Largest distance of the hub from its converged path at the ends of strokes, as a fraction of the path's
        length. It is the largest over the straight swim, the four pairs of Fig. 13.8, the pentagon and random commands.
    gait_error: Path error as above, the largest over repetitions of any command of -1, 0 and 1 per limb.
    straight_error: Path error of the straight swim.
    heading_error: Largest error of the heading [deg] in the swims of path_error.
    end_error: Distance of the hub from its converged end, as a fraction of the path's length, the largest over the
        swims of path_error.
    speed: Simulated time over computing time, for a batch on one core of the machine named in presets.json.
    """

    scheme: str
    step: float
    newton_tolerance: float
    path_tolerance: float | None
    path_error: float
    gait_error: float
    straight_error: float
    heading_error: float
    end_error: float
    speed: float

    def __str__(self) -> str:
        adapted = "" if self.path_tolerance is None else f" adapted to {100 * self.path_tolerance:g} %"
        return f'"{self.scheme}" at {1e3 * self.step:g} ms{adapted}'


class Setting(Protocol):
    """Fields of `Numerics` on which errors depend."""

    @property
    def scheme(self) -> str: ...
    @property
    def step(self) -> float: ...
    @property
    def newton_tolerance(self) -> float: ...
    @property
    def path_tolerance(self) -> float | None: ...


@cache
def _stored() -> dict[str, Any]:
    stored: dict[str, Any] = json.loads(PRESETS.read_text(encoding="utf-8"))
    return stored


def machine() -> str:
    """Name of the machine on which the speeds were measured."""
    return str(_stored()["machine"])


def promises() -> tuple[Promise, ...]:
    """Stored settings, fastest first. No other measured setting beats any of them in both error and speed."""
    return tuple(Promise(**row) for row in _stored()["front"])


def promise(setting: str | Setting) -> Promise:
    """Errors and speed of a preset or a `Numerics`. ValueError if it was not measured."""
    presets = {name: Promise(**row) for name, row in _stored()["presets"].items()}
    if not isinstance(setting, str) and not all(hasattr(setting, name) for name in SETTING):
        raise ValueError(f"promise needs the name of a preset or a Numerics, not {shown(setting)}.")
    if isinstance(setting, str):
        if setting not in presets:
            raise ValueError(f"A preset is one of {', '.join(map(repr, presets))}, not {shown(setting)}.")
        return presets[setting]
    known = measured(setting)
    if known is None:
        raise ValueError(f"Nothing was measured, so nothing can be promised, for {shown(setting)}.")
    return known


def measured(setting: Setting) -> Promise | None:
    """Errors and speed of a `Numerics`, or None if it was not measured."""
    known = (*(Promise(**row) for row in _stored()["presets"].values()), *promises())
    return next((row for row in known if _identity(row) == _identity(setting)), None)


def _identity(setting: Setting) -> tuple[str, float, float, float | None]:
    return setting.scheme, setting.step, setting.newton_tolerance, setting.path_tolerance


def cheapest(error: float, any_gait: bool = False) -> Promise:
    """Fastest stored setting whose path error is at most `error`. ValueError if there is none.

    any_gait: Require it for gait_error, too.
    """
    if not is_finite_number(error) or error <= 0.0:
        raise ValueError(f"error must be a positive, finite share of the path's length, not {shown(error)}.")
    if not isinstance(any_gait, bool | np.bool_):
        raise ValueError(f"any_gait must be True or False, not {shown(any_gait)}.")
    known = sorted(promises(), key=lambda row: -row.speed)

    def kept(row: Promise) -> float:
        return max(row.path_error, row.gait_error) if any_gait else row.path_error

    for row in known:
        if kept(row) <= error:
            return row
    best = min(known, key=kept)
    raise ValueError(
        f"No measured setting keeps the path error below {100 * error:g} %: "
        f"the best, {best}, keeps {100 * kept(best):g} %."
    )
