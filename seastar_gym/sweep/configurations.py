"""Configurations: what all robots of a lane batch have in common, a scene, and a gait or a controller."""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

from seastar_gym.scene import Scene
from seastar_gym.scene.checks import shown
from seastar_gym.scene.per_robot import with_numbers
from seastar_gym.sweep.axes import PARTS
from seastar_gym.sweep.controllers import Controller, Route, controller_of
from seastar_gym.sweep.gait import Gait, gait_of
from seastar_gym.version import __version__

FORM = 2
"""Form of the results. Parts of another form are other parts."""


@dataclass(frozen=True)
class Swim:
    """How long robots swim. settling, measured: Intervals of a gait before and during the measurement."""

    settling: int
    measured: int


@dataclass(frozen=True)
class Configuration:
    """Scene and gait, or controller, of a lane batch, before its robots get their own numbers.

    gait, swim: Of robots without a controller.
    labels: What was chosen, by the name of the axis: texts or numbers.
    controller: Controller, None for a gait.
    """

    scene: Scene
    gait: Gait
    swim: Swim
    labels: tuple[tuple[str, Any], ...]
    controller: Controller | None = None

    @cached_property
    def text(self) -> str:
        """All that results depend on except the numbers of robots, as JSON."""
        told = {"scene": self.scene.to_dict(), "labels": self.labels, "version": __version__, "form": FORM}
        if self.controller is None:
            told |= {"commands": self.gait.commands, "interval": self.gait.interval, **asdict(self.swim)}
        else:
            told["pilot"] = asdict(self.controller)
        return json.dumps(told, sort_keys=True)

    @property
    def intervals(self) -> int:
        """Intervals, such as strokes, that every robot swims; 0 for controllers, which end when they arrive."""
        return self.swim.settling + self.swim.measured if self.controller is None else 0

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of the text."""
        return hashlib.sha256(self.text.encode()).digest()


def configuration_with(
    scene: Scene, gait: Any, swim: Swim, choices: dict[str, tuple[Any, Any]], route: Route = Route()
) -> Configuration:
    """Configuration of a scene in which choices, (value, label) by the name of the axis, have replaced what was there.

    route: What controllers swim.
    """
    values = {name: value for name, (value, _) in choices.items()}
    try:
        changed = scene_with(scene, values)
        controller = controller_of(values["controller"], route, changed) if "controller" in values else None
        chosen_gait = gait_of(values.get("gait", gait), changed) if controller is None else Gait(())
    except TypeError as unfit:
        raise ValueError(f"{shown(values)} do not fit the scene: {unfit}.") from None
    labels = tuple((name, label) for name, (_, label) in choices.items())
    return Configuration(changed, chosen_gait, swim, labels, controller)


def scene_with(scene: Scene, values: dict[str, Any]) -> Scene:
    """Scene with other values by name: first whole parts, then a fidelity, then single numbers."""
    parts = {name: value for name, value in values.items() if name in PARTS}
    changed = replace(scene, **parts) if parts else scene
    if "fidelity" in values:
        preset = Scene.preset(values["fidelity"])
        nodes, discretisation = preset.robot.nodes_per_limb, preset.robot.discretisation
        robot = replace(changed.robot, nodes_per_limb=nodes, discretisation=discretisation)
        changed = replace(changed, robot=robot, numerics=preset.numerics)
    numbers = {name: value for name, value in values.items() if "." in name}
    return with_numbers(changed, numbers)
