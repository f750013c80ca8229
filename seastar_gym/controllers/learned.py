"""Learned policies on disk: weights in a safetensors file with a description in JSON beside it, or a training's zip.

    from seastar_gym.controllers import load, pretrained

    policy = pretrained("timed-0.2s")  # a bundled one; or load("runs/mine/policy.safetensors")
    env = gym.make(
        "SeastarSwim-v0", actions=policy.actions, scene=policy.scene, decision_period=policy.decision_period
    )

The network is plain numpy: layers `W x + b` with tanh between them (`0.weight`, `0.bias`, `1.weight`, ...), whose last
outputs are the logits of the actions. The `model.zip` of a training is Stable-Baselines3's own file with entries that
hold no pickles, of which `policy.json` and `learner.safetensors` are read here. Nothing is unpickled, and neither torch
nor Stable-Baselines3 is needed.
"""

from __future__ import annotations

import hashlib
import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import safetensors
import safetensors.numpy
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy, as_floating, can_be_decided_by, memory_of, starts
from seastar_gym.controllers.description import Description, read_facts
from seastar_gym.envs import IDS, STROKE
from seastar_gym.envs.commands import Actions
from seastar_gym.envs.sight import FOR_CAMERA, Sight, told
from seastar_gym.envs.symmetry import FrameStack
from seastar_gym.files import LARGEST_FILE, read_whole, write_atomically
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import is_finite_number, require_file, require_flag, require_kind, require_period, shown

if TYPE_CHECKING:
    from seastar_gym.envs.robots import Task

BUNDLED = Path(__file__).parent / "policies" / "strokes.safetensors"
"""File of the bundled policy that decides stroke by stroke; `python train.py --publish` replaces it."""

TASKS = BUNDLED.parent / "tasks"
"""Folder of the policies of tasks; `python -m agents.tasks` replaces them."""

Weights = dict[str, NDArray[np.float32]]


RESOLUTION = "robot.nodes_per_limb"
"""Fact of a scene that a policy does not depend on."""


class LearnedPolicy:
    """Trained policy with the `predict` of Stable-Baselines3, from observations of the environment to its actions.

    description: Environment and network that the weights are for.
    weights: Arrays "0.weight" (outputs, inputs), "0.bias" (outputs,), "1.weight", ... of the layers.
    training: Seed, commands, versions and progress of the training, as far as the policy's file has them.
    rng: Random generator of actions that are not deterministic.

    The environment is made with the policy's own attributes: `gym.make("SeastarSwim-v0", actions=policy.actions,
    scene=policy.scene, decision_period=policy.decision_period)`.
    """

    batched = True

    def __init__(
        self,
        description: Description,
        weights: Weights,
        training: Mapping[str, Any] | None = None,
        rng: np.random.Generator | None = None,
    ):
        require_kind("description", description, Description, "a Description")
        description.check()
        if not isinstance(weights, dict) or not all(isinstance(array, np.ndarray) for array in weights.values()):
            raise ValueError(f"weights must be arrays by name, not {shown(weights)}.")
        require_kind("training", training, Mapping | None, "entries by name, or None")
        require_kind("rng", rng, np.random.Generator | None, "a numpy Generator, or None")
        shapes = {name: array.shape for name, array in weights.items()}
        if shapes != description.shapes():
            raise ValueError(f"Its weights have the shapes {shapes}, not {description.shapes()}.")
        if not all(array.dtype == np.float32 and np.isfinite(array).all() for array in weights.values()):
            raise ValueError("Its weights are not all finite numbers of single precision.")
        stroke = float(description.scene.actuator.period)
        self.decision_period = stroke if description.decision_period is None else description.decision_period
        self.description = description._replace(decision_period=self.decision_period)
        self.weights = weights
        self.actions, self.symmetric = description.actions, description.symmetry
        self.scene = description.scene
        self.reduction, self.frame_stack = description.reduction, description.frame_stack
        self._n_seen, self._outputs = description.observation_size, description.distributions  # asked every decision
        self.training = training or {}
        self.rng = np.random.default_rng(0) if rng is None else rng

    def predict(
        self,
        observation: NDArray[np.float32],
        state: tuple[NDArray[Any], ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[Any], tuple[NDArray[Any], ...] | None]:
        """Actions for observations of shape (size,) or (n, size), and the state for the next call.

        A robot whose observation, or memory, has a number that is NaN, infinite or beyond 1e30 rests, by action 0.

        state: State that the last call gave, None for the first. A policy without memory has none. With memory, it is
            the past observations, latest first, shape (n, past, size).
        episode_start: Which robots have begun an episode, shape (n,); their past is the present observation.
        deterministic: Whether the most probable action is taken, rather than one drawn by its probability.
        """
        require_flag("deterministic", deterministic)
        observation, n_limbs = as_floating("observation", observation), self.scene.robot.n_limbs
        if observation.ndim not in (1, 2) or observation.shape[-1] != self._n_seen:
            raise ValueError(
                f"This policy was trained on a robot of {n_limbs} limbs: it sees {self._n_seen} numbers, not an "
                f"observation of shape {observation.shape}."
            )
        if self.frame_stack is not None:
            return self._stacking(self.frame_stack, observation, state, episode_start, deterministic)
        known = can_be_decided_by(observation)
        observation = np.where(known[..., None], observation, 0)
        if self.reduction is None:
            return self._choose(observation, known, deterministic), None
        reduced, elements = self.reduction.reduce(observation)
        return self.reduction.restore(self._choose(reduced, known, deterministic), elements), None

    def _stacking(
        self,
        frame_stack: FrameStack,
        observation: NDArray[Any],
        state: tuple[NDArray[Any], ...] | None,
        episode_start: NDArray[np.bool_] | None,
        deterministic: bool,
    ) -> tuple[NDArray[Any], tuple[NDArray[Any], ...]]:
        """`predict` of a policy that sees past observations."""
        present = np.atleast_2d(observation).astype(np.float32)
        memory_of(state, (len(present), frame_stack.past, present.shape[1]), "f", "past observations")
        at_first = np.repeat(present[:, None], frame_stack.past, axis=1)
        begun = starts(episode_start, len(present))
        past = at_first if state is None else np.where(begun[:, None, None], at_first, state[0])
        known = can_be_decided_by(present) & can_be_decided_by(past).all(axis=1)
        shown, elements = frame_stack.stacked(
            np.where(known[:, None], present, 0), np.where(known[:, None, None], past, 0)
        )
        chosen = frame_stack.symmetry.restore(self._choose(shown, known, deterministic), elements)
        later = np.concatenate([present[:, None], past[:, :-1]], axis=1)
        return (chosen if observation.ndim == 2 else chosen[0]), (later,)

    def _choose(self, observation: NDArray[Any], known: NDArray[np.bool_], deterministic: bool) -> NDArray[np.intp]:
        logits = self.logits(observation)
        if not deterministic:
            noise = self.rng.gumbel(size=logits.shape).astype(np.float32)
            logits = logits + noise  # the largest is then a draw from softmax(logits)
        chosen = np.where(known[..., None], np.argmax(logits, axis=-1), 0)
        return chosen if self.actions == "limbs" else chosen[..., 0]

    def logits(self, observation: NDArray[Any]) -> NDArray[np.float32]:
        """Logits, shape (..., distributions, choices), for (reduced) observations of shape (..., size)."""
        layers = len(self.weights) // 2
        x = observation.astype(np.float32)
        for layer in range(layers):
            x = x @ self.weights[f"{layer}.weight"].T + self.weights[f"{layer}.bias"]
            if layer < layers - 1:
                x = np.tanh(x)
        return x.reshape(*x.shape[:-1], *self._outputs)

    def require_fit(
        self,
        scene: Scene,
        actions: Actions,
        n_seen: int,
        task: Task | None = None,
        sight: Sight | None = None,
    ) -> None:
        """ValueError, with one sentence, where this policy cannot drive the robot of an environment.

        n_seen: Length of the environment's observations. task: Of the environment, None for waypoints. A policy
        of a task fits that task with any numbers; one of waypoints fits wherever the observations are as long.
        sight: Through which the robot is seen, None for full sight; a policy fits any that sees the same.
        """
        ours, theirs = self.scene.robot.n_limbs, scene.robot.n_limbs
        if ours != theirs:
            raise ValueError(f"The policy was trained on a robot of {ours} limbs, the environment's has {theirs}.")
        if actions != self.actions:
            raise ValueError(
                f'The policy answers with actions="{self.actions}", the environment takes actions="{actions}".'
            )
        trained_for = self.description.task
        if trained_for is not None:
            require_task(trained_for, task)
        require_same_sight(self.description.sight, sight)
        ours = self.description.observation_size
        if ours != n_seen:
            raise ValueError(
                f"The policy sees {ours} numbers of {trained_for or 'waypoints'}, the environment shows {n_seen}: "
                "another task, or actuators that remember differently."
            )

    def differences(self, scene: Scene) -> str:
        """Sentence on how a scene differs from the training's, but for resolution and numerics; empty if it does not.

        A policy sees the same stations of any mesh.
        """
        ours, theirs = _flat(asdict(self.scene)), _flat(asdict(scene))
        parts = [
            f"{name} {ours.get(name)} (here {theirs.get(name)})"
            for name in sorted(ours | theirs)
            if ours.get(name) != theirs.get(name) and name.split(".")[0] != "numerics" and name != RESOLUTION
        ]
        return f"trained in another scene, with {', '.join(parts)}." if parts else ""


def require_task(name: str, task: Task | None) -> None:
    """ValueError unless a task is that of a name, with any numbers. None means waypoints.

    A policy of `SimToReal` swims along waypoints, also those of a plant.
    """
    from seastar_gym.envs.tasks import NAMED, name_of  # whoever has a task has imported them
    from seastar_gym.envs.tasks.hidden import SimToReal
    from seastar_gym.envs.waypoints import AlongPath

    is_swim = task is None or isinstance(task, AlongPath)
    if is_swim and isinstance(NAMED[name], SimToReal):
        return
    if not isinstance(task, type(NAMED[name])):
        other = "waypoints" if is_swim else name_of(task) or type(task).__name__
        raise ValueError(f"The policy was trained for the task {name}, the environment's is {other}.")


def require_same_sight(ours: Sight | None, theirs: Sight | None) -> None:
    """ValueError unless a robot is seen as a policy was trained to see it. None means full sight."""
    if (ours and ours.sees) == (theirs and theirs.sees):
        return
    remedy = FOR_CAMERA if theirs else "give it that camera, by sight=policy.description.sight or by --sight and a file"
    raise ValueError(f"The policy was trained for {told(ours)}, and is given {told(theirs)}: {remedy}.")


def camera_of(policy: Policy) -> dict[str, Any]:
    """Options of an environment by which a policy sees the robot as it was trained to; none for full sight."""
    about = policy.description if isinstance(policy, LearnedPolicy) else None
    return {} if about is None or about.sight is None else {"sight": about.sight, "action_delay": about.action_delay}


def _flat(facts: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested entries with dotted names: {"robot": {"n_limbs": 5}} -> {"robot.n_limbs": 5}."""
    flat: dict[str, Any] = {}
    for name, value in facts.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {prefix + name: value}
    return flat


def save(policy: LearnedPolicy, path: str | os.PathLike[str], **training: Any) -> None:
    """Write the weights of a policy to `path` (.safetensors) and its description beside it (.json).

    training: Entries on how the policy was trained: commands, seed, versions of libraries, ...
    """
    require_kind("policy", policy, LearnedPolicy, "a LearnedPolicy")
    path = _checked_suffix(path)
    data = safetensors.numpy.save({name: np.ascontiguousarray(array) for name, array in policy.weights.items()})
    text = policy.description.to_json(sha256=hashlib.sha256(data).hexdigest(), training={**policy.training, **training})
    write_atomically(path, data)
    write_atomically(path.with_suffix(".json"), f"{text}\n")


def bundled_file(decision_period: float | None, bundled: Path = BUNDLED, task: str | None = None) -> Path:
    """File of the bundled policy for a time between decisions [s], None for strokes, and a task by its name.

    A task without a policy of its own has that of waypoints.
    """
    require_period(decision_period)
    require_kind("task", task, str | None, "the name of a task, or None")
    if task is not None and (file := of_task(task, decision_period)).is_file():
        return file
    return bundled if decision_period is None else bundled.with_stem(f"timed-{decision_period:g}s")


def bundled_for(id: str) -> Path | None:
    """File of the bundled policy that was trained for a registered id; None where there is none."""
    row = IDS[id]
    file = bundled_file(None if row.decision_period == STROKE else row.decision_period, task=row.task)
    return file if file.is_file() and row.actions != "continuous" and not row.more else None


def by_name() -> dict[str, Path]:
    """Files of all bundled policies by their names."""
    return {file.stem: file for folder in (BUNDLED.parent, TASKS) for file in sorted(folder.glob(f"*{BUNDLED.suffix}"))}


def pretrained(name: str = BUNDLED.stem) -> LearnedPolicy:
    """Bundled policy of a name, such as "strokes", "timed-0.2s" or "prey".

    ValueError, with the names that there are, for another one.
    """
    file = by_name().get(name) if isinstance(name, str) else None
    if file is None:
        raise ValueError(f"There is no bundled policy {shown(name)}: take one of {', '.join(by_name())}.")
    return load(file)


def of_task(task: str, decision_period: float | None, folder: Path = TASKS) -> Path:
    """File of the policy of a task, by its name, whether it is there or not."""
    period = "" if decision_period is None else f"-{decision_period:g}s"
    return folder / f"{task}{period}{BUNDLED.suffix}"


def load(path: str | os.PathLike[str] = BUNDLED) -> LearnedPolicy:
    """Policy that `save` wrote, or of a training's model.zip; by default the bundled one of strokes.

    FileNotFoundError or ValueError, with one sentence, if there is none.
    """
    require_file("path", path)
    if Path(path).suffix == ".zip":
        return _of_training(Path(path))
    path = _checked_suffix(path)
    for file in (path, path.with_suffix(".json")):
        if not file.is_file():
            raise FileNotFoundError(f"There is no trained policy at {path}: {file.name} is missing.")
    data, description_of = read_whole(path), read_whole(path.with_suffix(".json"))
    try:
        facts = read_facts(description_of)
        if hashlib.sha256(data).hexdigest() != facts["sha256"]:
            raise ValueError("The weights are not those that its .json file describes.")
        description, weights = Description.from_facts(facts), safetensors.numpy.load(data)
        return LearnedPolicy(description, weights, checked_training(facts["training"]))
    except (KeyError, TypeError, ValueError, safetensors.SafetensorError) as unfit:
        raise ValueError(f"{path} is damaged, or no policy of this version: {reason_of(unfit)}.") from unfit


def reason_of(unfit: Exception) -> str:
    """First sentence of an exception, without its full stop, to end another sentence with."""
    said = f"it does not say {unfit}" if isinstance(unfit, KeyError) else " ".join(str(unfit).split())
    first = said.split(". ")[0].rstrip(".")
    return first[0].lower() + first[1:] if first[1:2].islower() or first[1:2] == " " else first


def checked_training(training: object) -> dict[str, Any]:
    """Entries on the training of a policy; ValueError where reports could not read them."""
    if not isinstance(training, dict):
        raise ValueError(f"Its training is a {type(training).__name__}, not an object with names.")
    progress, commands = training.get("progress", []), training.get("commands", [])
    rows = progress if isinstance(progress, list) else [progress]
    if not all(isinstance(row, list) and len(row) == 3 and all(map(is_finite_number, row)) for row in rows):
        raise ValueError("The progress of its training must be rows of three numbers.")
    if not isinstance(commands, list) or not all(isinstance(command, str) for command in commands):
        raise ValueError("The commands of its training must be texts.")
    return training


def _checked_suffix(path: str | os.PathLike[str]) -> Path:
    require_file("path", path)
    path = Path(path)
    if path.suffix != ".safetensors":
        raise ValueError(f"A policy is in a file named .safetensors, not in {path}.")
    return path


DESCRIPTION, LEARNER = "policy.json", "learner.safetensors"
NETWORK = "network."
"""Beginning of the names of the network's arrays."""
ACTOR = "mlp_extractor.policy_net."
"""Beginning of the names of the policy's hidden layers, as Stable-Baselines3 calls them."""


def _of_training(path: Path) -> LearnedPolicy:
    """Policy of a training's model.zip."""
    with opened(path) as archive:
        description = Description.from_json(archive.read(DESCRIPTION).decode())
        arrays = safetensors.numpy.load(archive.read(LEARNER))
        network = {name.removeprefix(NETWORK): one for name, one in arrays.items() if name.startswith(NETWORK)}
        return LearnedPolicy(description, actor(network))


def actor(network: Mapping[str, NDArray[Any]]) -> Weights:
    """Weights of the policy in Stable-Baselines3's network, under the names of `LearnedPolicy`."""
    hidden = sorted({int(name.split(".")[2]) for name in network if name.startswith(ACTOR)})
    layers = [*(f"{ACTOR}{number}" for number in hidden), "action_net"]
    return {
        f"{layer}.{kind}": network[f"{name}.{kind}"] for layer, name in enumerate(layers) for kind in ("weight", "bias")
    }


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[zipfile.ZipFile]:
    """The archive, whose faults are said in one sentence."""
    if not os.path.isfile(path):
        raise FileNotFoundError(f"There is no trained policy at {os.fspath(path)}.")
    with one_sentence(path), zipfile.ZipFile(path) as archive:
        if sum(member.file_size for member in archive.infolist()) > LARGEST_FILE:
            raise ValueError(f"It unpacks to more than {LARGEST_FILE:,} bytes")
        yield archive


@contextmanager
def one_sentence(path: str | os.PathLike[str]) -> Iterator[None]:
    """Context in which any fault of the file's contents becomes a ValueError with one sentence."""
    try:
        yield
    except (zipfile.BadZipFile, EOFError, zlib.error, KeyError, safetensors.SafetensorError) as damaged:
        reason = str(damaged.args[0]).rstrip(".")
        raise ValueError(f"{os.fspath(path)} is damaged, or no policy saved by this project: {reason}.") from damaged
    except (AttributeError, IndexError, OverflowError, RuntimeError, TypeError, ValueError) as mismatch:
        raise ValueError(f"{os.fspath(path)} does not fit: {reason_of(mismatch)}.") from mismatch
