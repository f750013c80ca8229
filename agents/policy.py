"""Learned policies on disk: weights in a safetensors file, and beside it a JSON file that says what they are for.

    from agents.policy import load

    policy = load()  # the one in the box; or load("runs/mine/policy.safetensors")
    env = gym.make("SeastarSwim-v0", actions=policy.actions, scene=policy.scene)

The network is plain numpy: layers `W x + b` with tanh between them (`0.weight`, `0.bias`, `1.weight`, ...), whose last
numbers are the logits of the actions. Nothing is unpickled, and neither torch nor Stable-Baselines3 is needed.
"""

import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
import safetensors
import safetensors.numpy
from numpy.typing import NDArray

import seastar_gym
from agents.files import write_atomically
from seastar_gym.envs.commands import LIMB_COMMANDS, Actions, command_table
from seastar_gym.envs.observation import OBSERVATION_LAYOUT
from seastar_gym.envs.symmetry import reduce_observations, restore_actions
from seastar_gym.envs.task import scene_observation_size
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import is_finite_number, require_count, shown

FORMAT = 2
"""Version of what a description says."""
WIDEST = 1_000_000
"""Neurons of a layer that a description may claim."""
SHIPPED = Path(__file__).parent / "policies" / "seastar.safetensors"
"""The policy in the box; `python train.py --ship` replaces it."""

Weights = dict[str, NDArray[np.float32]]


# --- what a policy expects -------------------------------------------------------------------------------------------


class Description(NamedTuple):
    """What a learned policy expects of its environment, and its network's shape."""

    actions: Actions
    symmetry: bool
    scene: Scene
    hidden: tuple[int, ...]

    def to_json(self, **more: Any) -> str:
        """As text; `more` is for people to read."""
        facts = {
            "format": FORMAT,
            "seastar_gym": seastar_gym.__version__,
            "observation_layout": OBSERVATION_LAYOUT,
            "observation_size": scene_observation_size(self.scene),
            **self._asdict(),
            "scene": self.scene.to_dict(),
            **more,
        }
        return json.dumps(facts, indent=2, default=str, allow_nan=False)

    @classmethod
    def from_json(cls, text: str | bytes) -> "Description":
        """From `to_json`, see from_facts."""
        return cls.from_facts(read_facts(text))

    @classmethod
    def from_facts(cls, facts: Mapping[str, Any]) -> "Description":
        """From the names and values of `to_json`. KeyError: one is missing. ValueError: one cannot be."""
        for name, ours in (("format", FORMAT), ("observation_layout", OBSERVATION_LAYOUT)):
            if facts[name] != ours or isinstance(facts[name], bool):
                raise ValueError(f"its {name} is {shown(facts[name])}, this version of seastar_gym knows {ours}")
        actions, symmetry, hidden = facts["actions"], facts["symmetry"], facts["hidden"]
        if actions not in get_args(Actions):
            known = ", ".join(map(repr, get_args(Actions)))
            raise ValueError(f"its actions must be one of {known}, not {shown(actions)}")
        if not isinstance(symmetry, bool):
            raise ValueError(f"its symmetry must be true or false, not {shown(symmetry)}")
        if not isinstance(hidden, list):
            raise ValueError(f"its hidden must be a list of widths, not {shown(hidden)}")
        for width in hidden:
            require_count("a width of its hidden layers", width, 1, WIDEST)
        return cls(actions, symmetry, Scene.from_dict(facts["scene"]), tuple(hidden))

    @property
    def distributions(self) -> tuple[int, int]:
        """Categorical distributions over actions, and choices of each."""
        n_limbs = self.scene.robot.n_limbs
        if self.actions == "limbs":
            return n_limbs, len(LIMB_COMMANDS)
        return 1, len(command_table(self.actions, n_limbs))

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of every array of weights."""
        n, choices = self.distributions
        widths = [scene_observation_size(self.scene), *self.hidden, n * choices]
        shapes: dict[str, tuple[int, ...]] = {}
        for layer, (inputs, outputs) in enumerate(pairwise(widths)):
            shapes |= {f"{layer}.weight": (outputs, inputs), f"{layer}.bias": (outputs,)}
        return shapes


# --- the policy ------------------------------------------------------------------------------------------------------


class LearnedPolicy:
    """A trained policy in Stable-Baselines3's form: raw observations of the environment in, its actions out.

    actions: Action mode of the environment that it is for: `gym.make("SeastarSwim-v0", actions=policy.actions)`.
    scene: What was modelled when it was trained.
    training: How it came to be, as far as its file says.
    rng: Draws the actions where they are not deterministic.
    """

    def __init__(
        self,
        description: Description,
        weights: Weights,
        training: Mapping[str, Any] | None = None,
        rng: np.random.Generator | None = None,
    ):
        shapes = {name: array.shape for name, array in weights.items()}
        if shapes != description.shapes():
            raise ValueError(f"its weights have the shapes {shapes}, not {description.shapes()}")
        if not all(array.dtype == np.float32 and np.isfinite(array).all() for array in weights.values()):
            raise ValueError("its weights are not all finite numbers of single precision")
        self.description = description
        self.weights = weights
        self.actions = description.actions
        self.scene = description.scene
        self.training = training or {}
        self.rng = np.random.default_rng(0) if rng is None else rng

    def predict(
        self,
        observation: NDArray[np.float32],
        state: tuple[NDArray[Any], ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[Any], tuple[NDArray[Any], ...] | None]:
        """Actions for observations of shape (size,) or (n, size); there is no state."""
        observation, robot = np.asarray(observation), self.scene.robot
        size = scene_observation_size(self.scene)
        if observation.ndim not in (1, 2) or observation.shape[-1] != size:
            raise ValueError(
                f"This policy was trained on a robot of {robot.n_limbs} limbs of {robot.nodes_per_limb} nodes: "
                f"it sees {size} numbers, not an observation of shape {observation.shape}."
            )
        if not self.description.symmetry:
            return self._choose(observation, deterministic), None
        reduced, elements = reduce_observations(observation, robot.n_limbs)
        chosen = self._choose(reduced, deterministic)
        return restore_actions(chosen, elements, self.actions, robot.n_limbs), None

    def _choose(self, observation: NDArray[Any], deterministic: bool) -> NDArray[np.intp]:
        logits = self.logits(observation)
        if not deterministic:
            noise = self.rng.gumbel(size=logits.shape).astype(np.float32)
            logits = logits + noise  # the largest is then a draw from softmax(logits)
        chosen = np.argmax(logits, axis=-1)
        return chosen if self.actions == "limbs" else chosen[..., 0]

    def logits(self, observation: NDArray[Any]) -> NDArray[np.float32]:
        """Of every distribution's choices, for (reduced) observations (..., size): (..., distributions, choices)."""
        layers = len(self.weights) // 2
        x = observation.astype(np.float32)
        for layer in range(layers):
            x = x @ self.weights[f"{layer}.weight"].T + self.weights[f"{layer}.bias"]
            if layer < layers - 1:
                x = np.tanh(x)
        return x.reshape(*x.shape[:-1], *self.description.distributions)

    def require_fit(self, scene: Scene, actions: Actions) -> None:
        """ValueError, with one sentence, where this policy cannot drive the robot of an environment."""
        ours, robot = self.scene.robot, scene.robot
        if (ours.n_limbs, ours.nodes_per_limb) != (robot.n_limbs, robot.nodes_per_limb):
            raise ValueError(
                f"The policy was trained on a robot of {ours.n_limbs} limbs of {ours.nodes_per_limb} nodes, "
                f"the environment's has {robot.n_limbs} limbs of {robot.nodes_per_limb} nodes."
            )
        if actions != self.actions:
            raise ValueError(
                f'The policy answers with actions="{self.actions}", the environment takes actions="{actions}".'
            )

    def differences(self, scene: Scene) -> str:
        """How this scene differs from the one of the training, numerics apart; empty where it does not."""
        ours, theirs = _flat(asdict(self.scene)), _flat(asdict(scene))
        parts = [
            f"{name} {ours.get(name)} (here {theirs.get(name)})"
            for name in sorted(ours | theirs)
            if ours.get(name) != theirs.get(name) and name.split(".")[0] != "numerics"
        ]
        return f"trained in another scene, with {', '.join(parts)}." if parts else ""


def _flat(facts: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """{"robot": {"n_limbs": 5}} -> {"robot.n_limbs": 5}"""
    flat: dict[str, Any] = {}
    for name, value in facts.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {prefix + name: value}
    return flat


# --- on disk ---------------------------------------------------------------------------------------------------------


def save(policy: LearnedPolicy, path: str | os.PathLike[str], **training: Any) -> None:
    """Write the weights to `path` (.safetensors) and what they are for beside it (.json).

    training: How the policy came to be: the command, the seed, versions of libraries, ...
    """
    path = _checked_suffix(path)
    data = safetensors.numpy.save({name: np.ascontiguousarray(array) for name, array in policy.weights.items()})
    text = policy.description.to_json(sha256=hashlib.sha256(data).hexdigest(), training={**policy.training, **training})
    write_atomically(path, data)
    write_atomically(path.with_suffix(".json"), f"{text}\n".encode())


def load(path: str | os.PathLike[str] = SHIPPED) -> LearnedPolicy:
    """The policy that `save` wrote. FileNotFoundError or ValueError, with one sentence, if there is none."""
    path = _checked_suffix(path)
    for file in (path, path.with_suffix(".json")):
        if not file.is_file():
            raise FileNotFoundError(f"There is no trained policy at {path}: {file.name} is missing.")
    data = path.read_bytes()
    try:
        facts = read_facts(path.with_suffix(".json").read_bytes())
        if hashlib.sha256(data).hexdigest() != facts["sha256"]:
            raise ValueError("the weights are not those that its .json file describes")
        description, weights = Description.from_facts(facts), safetensors.numpy.load(data)
        return LearnedPolicy(description, weights, checked_training(facts["training"]))
    except (KeyError, TypeError, ValueError, safetensors.SafetensorError) as unfit:
        raise ValueError(f"{path} is damaged, or no policy of this version: {reason_of(unfit)}.") from unfit


def reason_of(unfit: Exception) -> str:
    """What an exception says first, to end a sentence with."""
    said = f"it does not say {unfit}" if isinstance(unfit, KeyError) else " ".join(str(unfit).split())
    return said.split(". ")[0].rstrip(".")


def read_facts(text: str | bytes) -> dict[str, Any]:
    """What a description in JSON says. ValueError for anything but an object of finite numbers."""
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


def checked_training(training: object) -> dict[str, Any]:
    """How a policy came to be, as far as the reports read it."""
    if not isinstance(training, dict):
        raise ValueError(f"its training is a {type(training).__name__}, not an object with names")
    progress, commands = training.get("progress", []), training.get("commands", [])
    rows = progress if isinstance(progress, list) else [progress]
    if not all(isinstance(row, list) and len(row) == 3 and all(map(is_finite_number, row)) for row in rows):
        raise ValueError("the progress of its training must be rows of three numbers")
    if not isinstance(commands, list) or not all(isinstance(command, str) for command in commands):
        raise ValueError("the commands of its training must be texts")
    return training


def _checked_suffix(path: str | os.PathLike[str]) -> Path:
    path = Path(path)
    if path.suffix != ".safetensors":
        raise ValueError(f"A policy is in a file named .safetensors, not in {path}.")
    return path
