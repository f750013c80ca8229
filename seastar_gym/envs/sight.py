"""`Sight`: what a camera sees of the robots, how often, how late, and with which errors."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.layout import N_STATIONS, Entry
from seastar_gym.envs.randomization import ACTION_DELAY, Distribution
from seastar_gym.files import read_json
from seastar_gym.scene.checks import as_float, is_whole_number, require_number, shown
from seastar_gym.scene.number import check_numbers, positive
from seastar_gym.scene.serial import VERSION, from_dict, register_part

Sees = Literal["nodes", "pose"]
Drawn = float | Distribution
"""Number, or the distribution from which it is drawn at the start of every episode."""

MARKERS = (1, 3, 9)
"""Numbers of markers per limb: those that stand at stations, the last at the tip."""
FASTEST, LONGEST = 1000.0, 5.0
"""Largest rate [Hz], and longest delay [s]."""
UNITS: Mapping[str, tuple[str, float]] = {
    "delay": ("s", LONGEST), "jitter": ("s", LONGEST), "dropout": ("1", 1.0), "noise": ("m", 1.0),
    "turn_noise": ("rad", 1.0),
}  # fmt: skip
"""Numbers that may be drawn, their units and their largest values."""


@register_part
@dataclass(frozen=True)
class Sight:
    """Camera through which robots are seen.

    Pictures are taken at whole multiples of 1/rate since the start of an episode, each at the end of the time step in
    which that time lies. A picture is seen `delay` later, more or less by up to `jitter`, so that it may be overtaken
    by the next. A decision knows the newest picture that has been seen, and the newest that the decision before it
    knew. Before an episode, the robot was at rest, and was seen so.

    Every number but `rate` and `sees` may be a distribution, which is drawn at the start of every episode.

    rate: Pictures per second [Hz].
    delay: Time from a picture to when it is seen [s].
    jitter: Largest deviation of that time, drawn for every picture [s].
    dropout: Share of the pictures that are lost.
    noise: Standard deviation of seen places, in x and in y [m].
    turn_noise: Standard deviation of seen headings [rad].
    sees: "pose": the hub and the heading, as of a tag on the hub. 1, 3 or 9: so many evenly spaced markers on every
        limb, too, the last at the tip. "nodes": all stations and their true velocities, which no camera has.
    """

    rate: Annotated[float, positive("Hz")] = 30.0
    delay: Drawn = 0.0
    jitter: Drawn = 0.0
    dropout: Drawn = 0.0
    noise: Drawn = 0.0
    turn_noise: Drawn = 0.0
    sees: Sees | int = "pose"

    def __post_init__(self) -> None:
        check_numbers(self, "Sight.")
        if self.rate > FASTEST:
            raise ValueError(f"Sight.rate must be at most {FASTEST:g} Hz, not {shown(self.rate)}.")
        for name in UNITS:
            require_drawn(f"Sight.{name}", getattr(self, name), *UNITS[name])
        if is_whole_number(self.sees):
            object.__setattr__(self, "sees", int(self.sees))
        if not isinstance(self.sees, str | int) or self.sees is True or self.sees not in ("pose", "nodes", *MARKERS):
            raise ValueError(f'Sight.sees must be "pose", "nodes", or 1, 3 or 9 markers, not {shown(self.sees)}.')

    @property
    def numbers(self) -> dict[str, Drawn]:
        """Numbers that may be drawn, by their names in a `DomainRandomization`."""
        return {f"sight.{name}": getattr(self, name) for name in UNITS}


FOR_CAMERA = "make one for the camera with python train.py --resume RUN --for-camera camera.json"
"""What to do with a policy that needs to see more than a camera does."""
TEMPLATE = (
    '{"rate": 30, "delay": {"kind": "Uniform", "low": 0.05, "high": 0.15}, "jitter": 0.01, "dropout": 0.01, '
    '"noise": 0.001, "turn_noise": 0.01, "sees": "pose", "action_delay": 0.0}'
)
"""File of a camera, see `read_camera`."""


class Camera(NamedTuple):
    """A sight, and how late the actions are that follow from it [s]."""

    sight: Sight
    action_delay: Drawn = 0.0


def read_camera(file: str | os.PathLike[str]) -> Camera:
    """Camera of a JSON file such as `TEMPLATE`: the numbers of a `Sight`, and `action_delay`, all by their names.

    FileNotFoundError or ValueError, with one sentence, where there is none.
    """
    if not Path(file).is_file():
        raise FileNotFoundError(f"There is no camera in {file}: write it, such as {TEMPLATE}.")
    data = read_json(file)
    try:
        if not isinstance(data, dict):
            raise ValueError(f"it must be such as {TEMPLATE}, not {shown(data)}")
        names = [*(field.name for field in fields(Sight)), ACTION_DELAY]
        for name in data:
            if name not in (*names, "version", "kind"):
                raise ValueError(f"it says {shown(name)}, a camera is written with {', '.join(names)}")
        late: Any = data.pop("action_delay", 0.0)
        sight = from_dict({"version": VERSION, "kind": Sight.__name__, **data}, Sight)
        late = from_dict({"version": VERSION, **late}, object) if isinstance(late, dict) else as_float(late)
        require_action_delay(late)
    except ValueError as wrong:
        raise ValueError(f"{file} is no camera: {str(wrong).rstrip('.')}.") from wrong
    return Camera(sight, late)


def told(sight: Sight | None) -> str:
    """What is seen of robots, in a few words; None means full sight."""
    if sight is None:
        return "full sight"
    if isinstance(sight.sees, str):
        seen = {"pose": "the pose alone", "nodes": "all nodes"}[sight.sees]
        return f'a camera that sees {seen} (sees="{sight.sees}")'
    markers = "a marker" if sight.sees == 1 else f"{sight.sees} markers"
    return f"a camera that sees {markers} on every limb (sees={sight.sees})"


def require_drawn(name: str, value: object, unit: str, largest: float) -> None:
    """ValueError for what is neither a number from 0 to `largest` nor a distribution of such numbers."""
    for bound in bounds_of(value):
        require_number(name, bound, unit, zero_allowed=True)
        if bound > largest:
            raise ValueError(f"{name} must be at most {largest:g} {unit}, not {shown(bound)}.")


def bounds_of(value: object) -> tuple[float, float]:
    """Smallest and largest value of a number, or of a distribution."""
    return value.bounds if isinstance(value, Distribution) else (value, value)  # type: ignore[return-value]


def require_action_delay(value: object) -> None:
    """ValueError for what is no delay of actions [s]."""
    require_drawn(ACTION_DELAY, value, "s", LONGEST)


def entries_of(sees: Sees | int) -> tuple[Entry, ...]:
    """Further entries of an observation: velocity of the hub and rate of turn, if not seen otherwise, and age."""
    known: dict[Sees | int, tuple[Entry, ...]] = {"nodes": ("scalar",), "pose": ("vector", "pseudoscalar", "scalar")}
    return known.get(sees, ("pseudoscalar", "scalar"))


def stations_seen(sees: Sees | int) -> NDArray[np.intp]:
    """Stations of a limb that are seen, counted from 0."""
    if isinstance(sees, str):
        return np.arange(N_STATIONS if sees == "nodes" else 0)
    return np.arange(1, sees + 1) * (N_STATIONS // sees) - 1


class Lateness:
    """Numbers of a sight and of the delay of actions, of `n_robots` robots.

    numbers: By name, see `DomainRandomization`. values: Those of every robot, shape (n_robots,).
    """

    def __init__(self, numbers: Mapping[str, Drawn], n_robots: int):
        self._drawn = {name: value for name, value in numbers.items() if isinstance(value, Distribution)}
        self.values = {name: np.full(n_robots, bounds_of(value)[1]) for name, value in numbers.items()}

    def draw(self, robot: int, rng: np.random.Generator) -> None:
        """Draw the numbers of a robot's next episode."""
        for name, distribution in self._drawn.items():
            self.values[name][robot] = distribution.draw(rng)

    @property
    def drawn(self) -> dict[str, NDArray[np.float64]]:
        """Numbers that are drawn, as they are now, copies."""
        return {name: self.values[name].copy() for name in self._drawn}
