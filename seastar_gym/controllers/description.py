"""Description of a learned policy: the environment that it expects, checked when it is read from JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple, get_args

from seastar_gym.envs import TASKS
from seastar_gym.envs.commands import Actions, Discrete, checked_decision_period, choices
from seastar_gym.envs.layout import N_STATIONS, OBSERVATION_LAYOUT, Entry, Layout, memory_size
from seastar_gym.envs.randomization import Distribution
from seastar_gym.envs.sight import Drawn, Sight, require_action_delay
from seastar_gym.envs.symmetry import MOST_PAST, FrameStack, Symmetry, memory_mirror, symmetry_of
from seastar_gym.files import parse_json
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import Mirror
from seastar_gym.scene.checks import as_float, is_whole_number, require_count, require_kind, shown
from seastar_gym.scene.serial import read, to_dict
from seastar_gym.version import __version__

FORMAT = 3
"""Version of the entries of a description."""
MOST_NUMBERS = 1000
"""Most numbers of a limb that a description may claim."""
WIDEST = 1_000_000
"""Largest number of neurons of a layer that a description may claim."""


class Description(NamedTuple):
    """Environment that a learned policy expects, and the shape of its network.

    actions: Action mode. symmetry: Whether the policy sees reduced observations, see `seastar_gym.envs.symmetry`.
    scene: Scene of the training. hidden: Widths of the hidden layers. decision_period: Time between decisions [s];
    None means the period of the actuator, and is that in a policy.
    task: Name of the task that the policy was trained for, such as "miswired". None means waypoints.
    limb_mirror: What a mirror does to the numbers that are observed of every limb. None means those of the actuators.
    entries, shows_limbs, stations: Of the observations, see `Layout`. past: Number of past observations that the
    policy sees, see `FrameStack`.
    sight, action_delay: Camera through which the robot was seen, None for full sight, and delay of its actions [s].
    path: Name of the path of the training. None means that it has none.
    """

    actions: Actions
    symmetry: bool
    scene: Scene
    hidden: tuple[int, ...]
    decision_period: float | None = None
    task: str | None = None
    limb_mirror: Mirror | None = None
    entries: tuple[Entry, ...] = ()
    shows_limbs: bool = True
    past: int = 0
    stations: int = N_STATIONS
    sight: Sight | None = None
    action_delay: Drawn = 0.0
    path: str | None = None

    def to_json(self, **more: Any) -> str:
        """Description as text; `more` adds entries for people to read."""
        late = self.action_delay
        facts = {
            "format": FORMAT,
            "seastar_gym": __version__,
            "observation_layout": OBSERVATION_LAYOUT,
            "observation_size": self.observation_size,
            **self._asdict(),
            "scene": self.scene.to_dict(),
            "sight": None if self.sight is None else to_dict(self.sight),
            "action_delay": to_dict(late) if isinstance(late, Distribution) else as_float(late),
            **more,
        }
        return json.dumps(facts, indent=2, default=str, allow_nan=False)

    @classmethod
    def from_json(cls, text: str | bytes) -> Description:
        """Description that `to_json` wrote, see from_facts."""
        return cls.from_facts(read_facts(text))

    @classmethod
    def from_facts(cls, facts: Mapping[str, Any]) -> Description:
        """Description from the entries of `to_json`; ValueError where one is missing or wrong."""
        require_kind("facts", facts, Mapping, "entries by name, as to_json writes them")
        missing = [name for name in ("format", "observation_layout", *cls._fields) if name not in facts]
        if missing:
            raise ValueError(f"It does not say {missing[0]!r}.")
        for name, ours in (("format", FORMAT), ("observation_layout", OBSERVATION_LAYOUT)):
            if facts[name] != ours or isinstance(facts[name], bool):
                raise ValueError(f"Its {name} is {shown(facts[name])}, this version of seastar_gym knows {ours}.")
        own = {name: _as_tuples(facts[name]) for name in cls._fields}
        own |= {"scene": Scene.from_dict(facts["scene"]), "sight": read(facts["sight"], Sight)}
        found = cls(**own | {"action_delay": read(facts["action_delay"], object)})
        found.check()
        return found

    def check(self) -> None:
        """ValueError, with one sentence, where an entry is none of its kind."""
        require_kind("scene", self.scene, Scene, "a Scene")
        if not isinstance(self.actions, str) or self.actions not in get_args(Discrete):
            known = ", ".join(map(repr, get_args(Discrete)))
            raise ValueError(f"Its actions must be one of {known}, not {shown(self.actions)}.")
        if not isinstance(self.symmetry, bool):
            raise ValueError(f"Its symmetry must be true or false, not {shown(self.symmetry)}.")
        if not isinstance(self.hidden, tuple):
            raise ValueError(f"Its hidden must be a tuple of widths, a list in JSON, not {shown(self.hidden)}.")
        for width in self.hidden:
            require_count("a width of its hidden layers", width, 1, WIDEST)
        if self.decision_period is not None:
            checked_decision_period(self.decision_period, self.scene)
        if self.task is not None and (not isinstance(self.task, str) or self.task not in NAMES_OF_TASKS):
            raise ValueError(f"Its task must be one of {', '.join(NAMES_OF_TASKS)}, not {shown(self.task)}.")
        require_count("its past", self.past, 0, MOST_PAST)
        if self.limb_mirror is not None:
            _require_mirror(self.limb_mirror)
        require_kind("its sight", self.sight, Sight | None, "a Sight, or null")
        require_action_delay(self.action_delay)
        require_kind("its path", self.path, str | None, "the name of a path, or null")
        _ = self.layout  # refuses the entries that are its own

    @property
    def mirror(self) -> Mirror:
        """What a mirror does to the numbers that are observed of every limb."""
        return memory_mirror(self.scene.actuator) if self.limb_mirror is None else self.limb_mirror

    @property
    def layout(self) -> Layout:
        """Layout of an observation of the environment."""
        of_limb = memory_size(self.scene.actuator) if self.limb_mirror is None else len(self.limb_mirror)
        return Layout(self.scene.robot.n_limbs, of_limb, self.entries, self.shows_limbs, self.stations)

    @property
    def observation_size(self) -> int:
        """Length of an observation of the environment."""
        return self.layout.size

    @property
    def reduction(self) -> Symmetry | None:
        """Symmetry by which observations are reduced; None for a policy that sees them as they are."""
        return Symmetry(symmetry_of(self.scene), self.mirror, self.layout, self.actions) if self.symmetry else None

    @property
    def frame_stack(self) -> FrameStack | None:
        """What the policy sees of present and past observations; None for a policy without memory."""
        if not self.past:
            return None
        return FrameStack(self.reduction or Symmetry.none_of(self.layout, self.actions), self.past)

    @property
    def input_size(self) -> int:
        """Number of inputs of the network."""
        frame_stack = self.frame_stack
        return self.layout.size if frame_stack is None else frame_stack.size

    @property
    def distributions(self) -> tuple[int, int]:
        """Number of categorical distributions of the network's output, and number of choices of each."""
        return choices(self.actions, self.scene.robot.n_limbs)

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the arrays of weights, by name."""
        widths = [self.input_size, *self.hidden, math.prod(self.distributions)]
        shapes: dict[str, tuple[int, ...]] = {}
        for layer, (inputs, outputs) in enumerate(pairwise(widths)):
            shapes |= {f"{layer}.weight": (outputs, inputs), f"{layer}.bias": (outputs,)}
        return shapes


NAMES_OF_TASKS = tuple(dict.fromkeys(str(row.task) for row in TASKS.values()))
"""Names of tasks that policies are trained for."""


def _as_tuples(value: Any) -> Any:
    """Lists of JSON as tuples, at any depth."""
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


def _require_mirror(rows: object) -> None:
    """ValueError for what is no mirror of the n numbers of a limb: for each, which one takes its place, and a sign."""
    if not isinstance(rows, tuple) or len(rows) > MOST_NUMBERS:
        raise ValueError(f"Its limb_mirror must be a list of pairs, not {shown(rows)}.")
    for row in rows:
        if not isinstance(row, tuple) or len(row) != 2 or not is_whole_number(row[1]) or abs(row[1]) != 1:
            raise ValueError(f"Its limb_mirror has {shown(row)}, not an index and a sign.")
        require_count("an index of its limb_mirror", row[0], 0, len(rows) - 1)
    if any(rows[index] != (place, sign) for place, (index, sign) in enumerate(rows)):
        raise ValueError(f"Its limb_mirror is no mirror, which undoes itself: {shown(rows)}.")


def read_facts(text: str | bytes) -> dict[str, Any]:
    """Entries of a description in JSON. ValueError for anything but an object with finite numbers."""
    require_kind("A description", text, str | bytes, "text")
    try:
        facts = parse_json(text if isinstance(text, str) else text.decode())
    except ValueError as unfit:
        raise ValueError(f"Its description is no JSON: {unfit}.") from None
    if not isinstance(facts, dict):
        raise ValueError(f"Its description is a {type(facts).__name__}, not an object with names.")
    return facts
