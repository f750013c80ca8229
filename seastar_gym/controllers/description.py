"""Description of a learned policy: the environment that it expects, checked when it is read from JSON."""

import json
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple, get_args

from seastar_gym.envs.commands import Actions, Discrete, choices
from seastar_gym.envs.decisions import checked_decision_period
from seastar_gym.envs.observation import OBSERVATION_LAYOUT
from seastar_gym.envs.task import scene_observation_size
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_count, shown
from seastar_gym.version import __version__

FORMAT = 2
"""Version of the entries of a description."""
WIDEST = 1_000_000
"""Largest number of neurons of a layer that a description may claim."""


class Description(NamedTuple):
    """Environment that a learned policy expects, and the shape of its network.

    actions: Action mode. symmetry: Whether the policy sees reduced observations, see `seastar_gym.envs.symmetry`.
    scene: Scene of the training. hidden: Widths of the hidden layers. decision_period: Time between decisions [s].
    None means strokes.
    """

    actions: Actions
    symmetry: bool
    scene: Scene
    hidden: tuple[int, ...]
    decision_period: float | None = None

    def to_json(self, **more: Any) -> str:
        """Description as text; `more` adds entries for people to read."""
        facts = {
            "format": FORMAT,
            "seastar_gym": __version__,
            "observation_layout": OBSERVATION_LAYOUT,
            "observation_size": scene_observation_size(self.scene),
            **self._asdict(),
            "scene": self.scene.to_dict(),
            **more,
        }
        return json.dumps(facts, indent=2, default=str, allow_nan=False)

    @classmethod
    def from_json(cls, text: str | bytes) -> "Description":
        """Description that `to_json` wrote, see from_facts."""
        return cls.from_facts(read_facts(text))

    @classmethod
    def from_facts(cls, facts: Mapping[str, Any]) -> "Description":
        """Description from the entries of `to_json`; KeyError where one is missing, ValueError where one is wrong."""
        for name, ours in (("format", FORMAT), ("observation_layout", OBSERVATION_LAYOUT)):
            if facts[name] != ours or isinstance(facts[name], bool):
                raise ValueError(f"its {name} is {shown(facts[name])}, this version of seastar_gym knows {ours}")
        actions, symmetry, hidden = facts["actions"], facts["symmetry"], facts["hidden"]
        if actions not in get_args(Discrete):
            known = ", ".join(map(repr, get_args(Discrete)))
            raise ValueError(f"its actions must be one of {known}, not {shown(actions)}")
        if not isinstance(symmetry, bool):
            raise ValueError(f"its symmetry must be true or false, not {shown(symmetry)}")
        if not isinstance(hidden, list):
            raise ValueError(f"its hidden must be a list of widths, not {shown(hidden)}")
        for width in hidden:
            require_count("a width of its hidden layers", width, 1, WIDEST)
        scene = Scene.from_dict(facts["scene"])
        decision_period = facts.get("decision_period")  # older descriptions have none: strokes
        if decision_period is not None:
            checked_decision_period(decision_period, scene)
        return cls(actions, symmetry, scene, tuple(hidden), decision_period)

    @property
    def distributions(self) -> tuple[int, int]:
        """Number of categorical distributions of the network's output, and number of choices of each."""
        return choices(self.actions, self.scene.robot.n_limbs)

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the arrays of weights, by name."""
        widths = [scene_observation_size(self.scene), *self.hidden, math.prod(self.distributions)]
        shapes: dict[str, tuple[int, ...]] = {}
        for layer, (inputs, outputs) in enumerate(pairwise(widths)):
            shapes |= {f"{layer}.weight": (outputs, inputs), f"{layer}.bias": (outputs,)}
        return shapes


def read_facts(text: str | bytes) -> dict[str, Any]:
    """Entries of a description in JSON. ValueError for anything but an object with finite numbers."""
    text = text if isinstance(text, str) else text.decode()
    try:
        facts = json.loads(text, parse_constant=_finite, parse_float=_finite)
    except RecursionError:
        raise ValueError("its description is nested too deeply") from None
    if not isinstance(facts, dict):
        raise ValueError(f"its description is a {type(facts).__name__}, not an object with names")
    return facts


def _finite(text: str) -> float:
    if not math.isfinite(float(text)):
        raise ValueError(f"its description says {text}, which is no finite number")
    return float(text)
