"""Controllers of designs: policies by the names that `seastar evaluate` knows, and the path that they swim."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.controllers.contract import Policy, require_fit
from seastar_gym.controllers.learned import load
from seastar_gym.controllers.registry import AGENTS, files_of, learned_file, load_agent
from seastar_gym.controllers.scripted import scripted
from seastar_gym.envs.commands import checked_decision_period, decisions_in
from seastar_gym.envs.paths import make_path
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.waypoints import Path as SwimPath
from seastar_gym.evaluation.many import HELD_OUT_SEED
from seastar_gym.evaluation.swim import TIME_LIMIT
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_number, require_period, shown


@dataclass(frozen=True)
class Route:
    """What controllers swim: a path, once, from rest.

    path: Name of a path, or waypoints [m]. One that is drawn, such as "random", is the same for all designs.
    seconds: Time limit [s].
    decision_period: Time between decisions [s]. None means a stroke.
    """

    path: SwimPath = "pentagon"
    seconds: float = TIME_LIMIT
    decision_period: float | None = None

    def __post_init__(self) -> None:
        require_number("seconds", self.seconds, "s")
        make_path(self.path, np.random.default_rng(HELD_OUT_SEED))
        require_period(self.decision_period)


@dataclass(frozen=True)
class Controller:
    """A controller, and what it swims.

    name: As in `seastar_gym.controllers.registry`. digest: SHA-256 of the files that it is made of. waypoints: [m].
    decisions: Decisions at most. decision_period: Time between them [s]. None means a stroke.
    """

    name: str
    digest: str
    waypoints: tuple[tuple[float, float], ...]
    decisions: int
    decision_period: float | None

    def policy(self, scene: Scene) -> Policy:
        """The policy, new. ValueError where its files are others than when the sweep was planned.

        scene: Of the frame: what robots have of their own is not known to controllers.
        """
        if _digest(files_of(self.name, self.decision_period)) != self.digest:
            raise ValueError(f"The controller {self.name} is another one here than where the sweep was planned.")
        return load_agent(self.name, SeastarSwimEnv(scene=scene, decision_period=self.decision_period))


def controller_of(name: Any, route: Route, scene: Scene) -> Controller:
    """Controller of a name for a scene.

    ValueError, or FileNotFoundError, where there is none or a learned one does not fit. Whether agents of one's own
    fit, their first batch says: they are not made here.
    """
    if not isinstance(name, str):
        raise ValueError(f"A controller is the name of an agent, such as learned, not {shown(name)}.")
    seconds = checked_decision_period(route.decision_period, scene)
    period = None if seconds == scene.actuator.period else seconds
    files, file = files_of(name, period), learned_file(name, period)
    if file is not None:
        policy = load(file)
        require_fit(policy, scene, policy.actions, period)
    elif name not in AGENTS and not files:
        scripted(name, n_limbs=scene.robot.n_limbs, decision_period=period)
    waypoints = make_path(route.path, np.random.default_rng(HELD_OUT_SEED))
    return Controller(
        name, _digest(files), tuple(map(tuple, waypoints.tolist())), decisions_in(route.seconds, seconds), period
    )


def _digest(files: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()
