"""Options that all environments share: `SwimOptions` are checked once, and know the scene that they mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

from seastar_gym.accuracy.certificate import Certificate
from seastar_gym.envs.commands import Actions, checked_decision_period
from seastar_gym.envs.randomization import ACTION_DELAY, DomainRandomization
from seastar_gym.envs.sight import Drawn, Sight, require_action_delay
from seastar_gym.scene import Scene, SmaWires
from seastar_gym.scene.checks import as_float, require_flag, require_kind, shown
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.robot import SILICONE
from seastar_gym.scene.scene import load_scene
from seastar_gym.scene.serial import read

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


FIDELITY_HELP = "accuracy of the simulation, also of a scene that names its own"


def own_scene(file: FilePath | None) -> Scene | None:
    """Scene of a file, None for none. It is read before policies, whose robots may have parts that it registers."""
    return None if file is None else load_scene(file)


def scene_at(scene: Scene | None, fidelity: Fidelity | None, otherwise: Fidelity) -> Scene | None:
    """Scene as command lines swim it; None for none.

    fidelity: Which was typed: it replaces the mesh and the numerics of a scene that names its numerics. None for none.
    otherwise: Fidelity of a scene that names no numerics, where none was typed.
    """
    if scene is None:
        return None
    if scene.numerics.named:
        return scene.at(fidelity, instead=fidelity is not None)
    return scene.at(otherwise if fidelity is None else fidelity)
