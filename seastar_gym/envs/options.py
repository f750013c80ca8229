"""Options that all environments share, the weights and terms of the reward, and the headings that may be asked for.

`SwimOptions` are checked once, and know the scene that they mean. `reward_terms` are the named terms of which tasks on
waypoints make their reward; `Robots` in robots.py adds them up. `HeadingTargets` say which way robots have to look.

The heading of a robot is the direction of the x axis of its body frame (`layout.py`): that of limb 1, by all
stations. Limbs are told from each other, as by a camera on limb 1: a heading repeats after 360 degrees, not after 72.
Angles are those of the world, anti-clockwise from +x.

What is left to turn is known by the shortest way round, from one heading to the next: in [-pi, pi), anti-clockwise
positive. It does not depend on which limb is called limb 1. A turn of the world leaves it, a mirror changes its sign.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.accuracy.certificate import Certificate
from seastar_gym.envs.commands import Actions, checked_decision_period
from seastar_gym.envs.paths import shortest_way
from seastar_gym.envs.randomization import ACTION_DELAY, DomainRandomization
from seastar_gym.envs.sight import Drawn, Sight, require_action_delay
from seastar_gym.scene import Scene, SmaWires
from seastar_gym.scene.checks import as_float, is_finite_number, require_flag, require_kind, require_number, shown
from seastar_gym.scene.number import check_numbers, make_floats, not_negative, within
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.robot import SILICONE
from seastar_gym.scene.scene import load_scene
from seastar_gym.scene.serial import read, register_part

Plain = Mapping[str, Any]
"""Part of a scene, or of the task, as plain data, see `seastar_gym.scene.serial`."""


@dataclass(frozen=True)
class SwimOptions:
    """Arguments of the environments, but for those of the task and of pictures; `SeastarSwimEnv` documents them.

    `scene`, `randomization`, `sight` and a distribution as `action_delay` may be given as plain data, and are parts
    then.
    """

    actions: Actions = "limbs"
    fidelity: Fidelity | None = None
    scene: Scene | None = None
    randomization: DomainRandomization | None = None
    certificate: Certificate | str | PathLike[str] | None = None
    error_bars: bool = False
    decision_period: float | None = None
    observe_actuators: bool = True
    device: str = "cpu"
    sight: Sight | None = None
    action_delay: Drawn = 0.0

    def __post_init__(self) -> None:
        kinds = {"scene": Scene, "randomization": DomainRandomization, "sight": Sight, "action_delay": object}
        for name, kind in kinds.items():
            object.__setattr__(self, name, read(getattr(self, name), kind))
        require_kind("scene", self.scene, Scene | None, "a Scene")
        require_kind("randomization", self.randomization, DomainRandomization | None, "a DomainRandomization or None")
        require_kind("sight", self.sight, Sight | None, "a Sight or None")
        object.__setattr__(self, "action_delay", as_float(self.action_delay))
        self._check_late()
        require_flag("observe_actuators", self.observe_actuators)

    def _check_late(self) -> None:
        """Refuse distributions of what there is not, or beyond what it may be."""
        own = () if self.sight is None else tuple(self.sight.numbers)
        for name, drawn in self.late.items():
            if name == ACTION_DELAY:
                require_action_delay(drawn)
            elif name in own and self.sight is not None:
                replace(self.sight, **{name.removeprefix("sight."): drawn})  # type: ignore[arg-type]
            else:
                known = ", ".join([*own, ACTION_DELAY])
                raise ValueError(f"The environment has no number {shown(name)} to draw: it has {known}.")

    @property
    def late(self) -> dict[str, Drawn]:
        """Numbers of the sight and of the delay of actions, or their distributions; `randomization` comes first."""
        own = {} if self.sight is None else self.sight.numbers
        drawn = {} if self.randomization is None else self.randomization.late
        return {**own, ACTION_DELAY: self.action_delay, **drawn}

    @property
    def modelled(self) -> Scene:
        """Scene that is simulated, see `make_scene`."""
        return make_scene(self.scene, self.fidelity, self.decision_period)

    @property
    def period(self) -> float:
        """Time between decisions [s]: that of the actuator if none is given. ValueError for one that it cannot take."""
        return checked_decision_period(self.decision_period, self.modelled)

    @property
    def fidelity_of_scene(self) -> Fidelity | None:
        """Fidelity that is asked for of a scene; None without a scene."""
        return None if self.scene is None else self.fidelity


def make_scene(scene: Scene | Plain | None, fidelity: Fidelity | None, decision_period: float | None = None) -> Scene:
    """Scene with the nodes and numerics that it names, otherwise with those of `fidelity`, see `Scene.at`.

    Without a scene, it is the chapter's at the fidelity; for decisions that are not strokes with wires, and with the
    material damping of soft silicone, without which steps resonate with decisions (docs/numerics.md, "Resonance").

    decision_period: Time between decisions [s]. None means a stroke.
    """
    if scene is None:
        chapters = Scene().at(fidelity)
        in_strokes = decision_period in (None, chapters.actuator.period)
        if in_strokes:
            return chapters
        return replace(chapters, actuator=SmaWires(), robot=replace(chapters.robot, relaxation_time=SILICONE))
    scene = read(scene, Scene)
    require_kind("scene", scene, Scene, "a Scene")
    return scene.at(fidelity)


def scene_at(file: FilePath | None, fidelity: Fidelity) -> Scene | None:
    """Scene of a file as command lines name it, with its own numerics, or those of `fidelity` where it names none.

    None for no file.
    """
    if file is None:
        return None
    scene = load_scene(file)
    return make_scene(scene, None if scene.numerics.named else fidelity)


PULSE = 0.1
"""Heating time of one wire [s] that `RewardWeights.effort` is the price of."""


@register_part
@dataclass(frozen=True)
class RewardWeights:
    """Weights of the reward's terms, none negative, and `aim`, the shape of the rewarded route.

    progress: Reward per metre by which the rewarded route to the last waypoint became shorter [1/m].
    waypoint: Reward per waypoint reached.
    effort: Price of heating one wire for PULSE = 0.1 s.
    aim: Distance from a waypoint's centre, as a fraction of its radius, at which the rewarded route passes it, 0 to 1.
    heading: Reward per radian by which there is less left to turn [1/rad], where headings are asked for.
    time: Price of a second [1/s].
    """

    progress: Annotated[float, not_negative("1")] = 200.0
    """Reward per metre by which the rewarded route to the last waypoint became shorter [1/m]. One stroke of the best
    gaits, about 5 mm, earns about 1."""
    waypoint: Annotated[float, not_negative("1")] = 1.0
    """Reward per waypoint reached."""
    effort: Annotated[float, not_negative("1")] = 0.01
    """Price of heating one wire for PULSE = 0.1 s, as a stroke of the chapter does; shorter heating costs its share."""
    aim: Annotated[float, within(0.0, 1.0)] = 0.7
    """Distance from a waypoint's centre, as a fraction of its radius, at which the rewarded route passes it, 0 to 1. A
    route at 1 only touches the circle, so that no stroke need ever end within it."""
    heading: Annotated[float, not_negative("1")] = 8.0
    """Reward per radian by which there is less left to turn [1/rad], where headings are asked for. A second of the
    turning wave, 0.19 rad, earns about as much as a second of the lagged pairs, 7.3 mm."""
    time: Annotated[float, not_negative("1/s")] = 0.0
    """Price of a second [1/s]. Without it, an episode pays its route, however long that takes: returns and times are
    uncorrelated where discounts are near 1."""

    def __post_init__(self) -> None:
        check_numbers(self, "RewardWeights.")

    def way_to_next(
        self, hub: ArrayLike, current: ArrayLike, following: ArrayLike, waypoint_radius: float
    ) -> NDArray[np.float64]:
        """Length [m], shape (...), of the rewarded route from the hub past the current waypoint to the following one.

        hub, current, following: Positions [m], shape (..., 2), in any one frame. On the last leg `following` equals
        `current`, as in an observation, and the route ends in its centre. waypoint_radius: [m].
        """
        return shortest_way(hub, current, following, self.aim * waypoint_radius)


class Weights(NamedTuple):
    """The numbers of the `RewardWeights` of every robot, shape (n_robots,) each, in their order."""

    progress: NDArray[np.float64]
    waypoint: NDArray[np.float64]
    effort: NDArray[np.float64]
    aim: NDArray[np.float64]
    heading: NDArray[np.float64]
    time: NDArray[np.float64]


def reward_terms(
    weights: RewardWeights | Weights,
    progress: NDArray[np.float64],
    waypoints_reached: NDArray[np.int64],
    pulses: NDArray[np.float64],
    seconds: float,
    turned: NDArray[np.float64] | None = None,
) -> dict[str, NDArray[np.float64]]:
    """Terms of the reward by their names in `info`, each of shape (n_robots,).

    progress: Decrease of the way to go [m]. waypoints_reached: Their number. pulses: Heat, see `pulses_of`.
    seconds: Duration of the decision [s]. turned: Decrease of what is left to turn [rad], None where no headings are
    asked for. All others are of this decision, shapes (n_robots,).
    """
    return {
        "reward_progress": weights.progress * progress,
        "reward_waypoint": np.asarray(weights.waypoint * waypoints_reached, np.float64),
        "reward_effort": -weights.effort * pulses,
        "reward_time": np.broadcast_to(0.0 - weights.time * seconds, np.shape(progress)).copy(),
        **({} if turned is None else {"reward_heading": weights.heading * turned}),
    }


def pulses_of(heating_time: NDArray[np.float64], commands: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heat as a number of pulses of 0.1 s, shape (n_robots,).

    heating_time: Time for which wires were heated, summed over limbs [s], shape (n_robots,). NaN where the actuator
        does not say it: a command then counts as its share of a pulse.
    commands: Shape (n_robots, n_limbs).
    """
    whole = (heating_time / PULSE).round(12)  # sums of tenths of a second are whole pulses again
    unknown = np.isnan(heating_time)
    return np.where(unknown, np.abs(commands).sum(axis=1), whole) if np.count_nonzero(unknown) else np.asarray(whole)


Floats = NDArray[np.float64]

LARGEST = 1e6
"""Largest angle that may be asked for [rad]: beyond it, rounding is seen."""


@register_part
@dataclass(frozen=True)
class HeadingTargets:
    """Headings at the waypoints, without which they are not reached.

    target: "along", the direction of the leg that ends at the waypoint; "random", drawn for every waypoint of every
        episode; angles [rad], one for each waypoint; or one angle for all.
    tolerance: Largest difference between heading and asked heading at which a waypoint is reached [rad], at most pi.
    """

    target: Literal["along", "random"] | float | tuple[float, ...] = "along"
    tolerance: float = math.radians(10.0)

    def __post_init__(self) -> None:
        make_floats(self)
        angles = self.target if isinstance(self.target, tuple) else (self.target,)
        is_named = isinstance(self.target, str) and self.target in ("along", "random")
        if not is_named and not (angles and all(map(_is_angle, angles))):
            raise ValueError(
                f"HeadingTargets.target must be 'along', 'random', an angle or a tuple of angles [rad], at most "
                f"{LARGEST:g}, not {shown(self.target)}."
            )
        require_number("HeadingTargets.tolerance", self.tolerance, "rad")
        if self.tolerance > math.pi:
            raise ValueError(f"HeadingTargets.tolerance must be at most pi, not {shown(self.tolerance)} rad.")

    def of_path(self, waypoints: Floats, rng: np.random.Generator) -> Floats:
        """Asked headings [rad], shape (n,), at waypoints [m], shape (n, 2). rng: Generator of random ones.

        ValueError: the waypoints are not as many as the angles, or a leg has no direction.
        """
        if self.target == "random":
            return rng.uniform(-np.pi, np.pi, len(waypoints))
        if self.target == "along":
            return _along(waypoints)
        angles = np.array(self.target, dtype=np.float64)
        if angles.ndim and len(angles) != len(waypoints):
            counts = f"{len(angles)} angles, but the path has {len(waypoints)} waypoint(s)"
            raise ValueError(f"HeadingTargets.target has {counts}.")
        return np.broadcast_to(angles, len(waypoints)).copy()


def _is_angle(value: object) -> bool:
    return is_finite_number(value) and abs(float(value)) <= LARGEST  # type: ignore[arg-type]


def _along(waypoints: Floats) -> Floats:
    """Directions [rad], shape (n,), of the legs that end at the waypoints [m], shape (n, 2)."""
    legs = np.diff(waypoints, axis=0, prepend=np.zeros((1, 2)))
    if not legs.any(axis=1).all():
        k = int(np.argmin(legs.any(axis=1)))
        raise ValueError(f"Headings along the path need legs with a direction: the leg to waypoint {k + 1} has none.")
    return np.arctan2(legs[:, 1], legs[:, 0])


def wrapped(angles: Floats) -> Floats:
    """Angles [rad] by the shortest way round, in [-pi, pi)."""
    return np.asarray(np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi)
