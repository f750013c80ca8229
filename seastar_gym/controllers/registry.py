"""Agents by the names that the command lines know.

A new agent is a class with `predict` and one line in `AGENTS`. An agent of one's own needs no line: it is asked for by
the name of the function that makes it, "module:function".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np

from seastar_gym.controllers import checkpoint, learned, third_party
from seastar_gym.controllers.contract import Policy, actions_of, require_fit
from seastar_gym.controllers.greedy import GreedyPolicy
from seastar_gym.controllers.planner import Planner, gait_planner
from seastar_gym.controllers.scripted import GAITS, scripted
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import OneRobotEnv, SeastarSwimEnv
from seastar_gym.envs.tasks import name_of
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import (
    require_choice,
    require_kind,
    require_period,
    require_seed,
    require_texts,
    shown,
)
from seastar_gym.scene.numerics import Fidelity

AGENTS: dict[str, Callable[[Scene, float | None, str | None], Policy]] = {
    "learned": lambda scene, decision_period, task: learned.load(learned.bundled_file(decision_period, task=task)),
    "greedy": lambda scene, decision_period, task: GreedyPolicy(scene, decision_period=decision_period),
    "planner": lambda scene, decision_period, task: Planner(decision_period=decision_period),  # at fidelity "fast"
    "gait-planner": lambda scene, decision_period, task: gait_planner(decision_period),  # likewise
}
"""Functions that make the agents that are not scripted, by name, for the scene that they swim in, the time between
decisions [s], None for strokes, and the name of the task, None for waypoints."""

HELP = (
    f"Agents: {', '.join(AGENTS)} (learned is the bundled policy for the task and the time between decisions); "
    "bundled policies by name, such as timed-0.2s; "
    f"scripted gaits, {', '.join(GAITS)}, random, or a pair of limbs such as 4+,1-; files of policies (.safetensors, "
    "or a model.zip of train.py or of plain Stable-Baselines3); module:function, which gets an environment and returns "
    "anything with predict. A model.zip of plain Stable-Baselines3 and module:function execute the code of whoever "
    "made them: load only files that you trust."
)
"""Help of options that name agents."""
DEFAULTS = "(default: learned pentagon; greedy straight for robots without five limbs)"
"""Help on `default_agents`."""


def load_agents(
    names: Sequence[str],
    seed: int = 0,
    fidelity: Fidelity = "balanced",
    decision_period: float | None = None,
    scene: Scene | None = None,
) -> dict[str, Policy]:
    """Policies by name; those of files have the file's name without its ending.

    names: Names as in `HELP`. seed: Seed of the random agent. fidelity: Accuracy of the simulation that agents know.
    decision_period: Time between decisions [s]. None means strokes. scene: Scene that agents know, with its numerics.
    None means the chapter's at `fidelity`.
    """
    known = _known(seed, fidelity, decision_period, scene)
    make_env = partial(_make_env, scene, fidelity, decision_period)
    return {
        label: _load_agent(name, seed, known, decision_period, None, make_env) for label, name in _labels(names).items()
    }


def default_agents(scene: Scene) -> tuple[str, ...]:
    """Names of the agents that are compared unless others are named; the first two are for five limbs only."""
    return ("learned", "pentagon") if scene.robot.n_limbs == 5 else ("greedy", "straight")


def fitting_agents(
    names: Sequence[str] | None,
    seed: int = 0,
    fidelity: Fidelity = "balanced",
    decision_period: float | None = None,
    scene: Scene | None = None,
) -> tuple[dict[str, Policy], list[str]]:
    """Policies by name, as `load_agents` gives them, of all agents that fit the robot, and a sentence on each other.

    names: Names as in `HELP`. None means `default_agents`. ValueError, with their sentences, where none fits.
    """
    known = _known(seed, fidelity, decision_period, scene)
    make_env = partial(_make_env, scene, fidelity, decision_period)
    agents, left_out = dict[str, Policy](), list[str]()
    for label, name in _labels(default_agents(known) if names is None else names).items():
        try:
            policy = _load_agent(name, seed, known, decision_period, None, make_env)
            sight = learned.camera_of(policy).get("sight")
            n_seen = None if sight is None else policy.description.observation_size  # type: ignore[attr-defined]
            require_fit(policy, known, actions_of(policy, known.robot.n_limbs), decision_period, n_seen, sight=sight)
        except (ValueError, OSError) as unfit:
            left_out.append(f"{label} is left out: {unfit}")
        else:
            agents[label] = policy
    if not agents:
        raise ValueError(" ".join(left_out) or "There is nothing to evaluate: name at least one agent.")
    return agents, left_out


def _known(seed: int, fidelity: Fidelity, decision_period: float | None, scene: Scene | None) -> Scene:
    """Scene that agents know."""
    require_seed(seed)
    require_choice("fidelity", fidelity, get_args(Fidelity))
    known = make_scene(None, fidelity) if scene is None else scene
    require_kind("scene", known, Scene, "a Scene, or None")
    require_period(decision_period)
    return make_scene(None, fidelity, decision_period) if scene is None else scene


def _make_env(scene: Scene | None, fidelity: Fidelity, decision_period: float | None) -> SeastarSwimEnv:
    named = fidelity if scene is None else None
    return SeastarSwimEnv(scene=scene, fidelity=named, decision_period=decision_period)


def _labels(names: Sequence[str]) -> dict[str, str]:
    """Names by what agents are called: a file without its ending, and without its folder where that is enough."""
    require_texts("Agents", names)
    labels: dict[str, str] = {}
    for name in names:
        label = Path(name).stem if is_file(name) else name
        label = str(Path(name).with_suffix("")) if label in labels else label
        if label in labels:
            raise ValueError(f"The agent {name!r} is named twice.")
        labels[label] = name
    return labels


def load_agent(name: str, env: OneRobotEnv, seed: int = 0) -> Policy:
    """Policy by a name as in `HELP`, for the robot and the decisions of an environment."""
    require_kind("name", name, str, "the name of an agent")
    require_seed(seed)
    if not all(hasattr(env, known) for known in ("timed", "scene", "step")):
        raise ValueError(f"env must be an environment of this package, not {shown(env)}.")
    return _load_agent(name, seed, env.scene, env.timed, task_of(env), lambda: env)


def task_of(env: Any) -> str | None:
    """Name of the task of an environment or a batch; None for waypoints, or where a task has no name."""
    return name_of(getattr(env, "task", None))


def files_of(name: str, decision_period: float | None = None) -> list[Path]:
    """Files that the policy of a name is made of, the module's for "module:function"; none for what is computed.

    decision_period: Time between decisions [s]. None means strokes.
    """
    if third_party.is_function(name):
        return [third_party.module_file(name)]
    file = learned_file(name, decision_period)
    if file is not None:
        return [file, file.with_suffix(".json")]
    return [Path(name)] if is_file(name) else []


def learned_file(name: str, decision_period: float | None = None) -> Path | None:
    """File with the weights of a learned policy, bundled or not; None for the name of another agent.

    decision_period: As of `files_of`.
    """
    bundled = learned.bundled_file(decision_period) if name == "learned" else learned.file_of(name)
    return bundled or (Path(name) if name.endswith(".safetensors") else None)


def learned_policy(name: str, decision_period: float | None = None) -> learned.LearnedPolicy | None:
    """Learned policy of a name, bundled or from the files of a training; None for the name of another agent.

    decision_period: As of `files_of`.
    """
    if name.endswith(".zip"):
        return None if third_party.is_model(name) else checkpoint.load(name)
    file = learned_file(name, decision_period)
    return None if file is None else learned.load(file)


def is_file(name: str) -> bool:
    """Whether a name is that of a file."""
    return name.endswith((".zip", ".safetensors", ".pth", ".pt", ".pkl")) or len(Path(name).parts) > 1


def _load_agent(
    name: str,
    seed: int,
    scene: Scene,
    decision_period: float | None,
    task: str | None,
    make_env: Callable[[], OneRobotEnv],
) -> Policy:
    if name in AGENTS:
        return AGENTS[name](scene, decision_period, task)
    bundled = learned.file_of(name)
    if bundled is not None:
        return learned.load(bundled)
    if third_party.is_function(name):
        return third_party.call_function(name, make_env())
    return _load_file(name) if is_file(name) else _scripted(name, seed, decision_period, scene.robot.n_limbs)


def _scripted(name: str, seed: int, decision_period: float | None, n_limbs: int) -> Policy:
    known = (*GAITS, "random")
    try:
        return scripted(name, None, n_limbs, np.random.default_rng(seed), decision_period)
    except ValueError as unknown:
        if name in known:
            raise  # a gait that does not fit the time between decisions
        others = f"{', '.join(AGENTS)}, files of policies, and module:function"
        raise ValueError(f"{unknown} Others are {others}.") from unknown


def _load_file(name: str) -> Policy:
    if not name.endswith(".zip"):
        return learned.load(name)
    if not third_party.is_model(name):
        return checkpoint.load(name)
    try:
        return third_party.load_model(name)
    except ModuleNotFoundError as missing:
        raise ValueError(
            f'A model.zip of Stable-Baselines3 needs {missing.name}: pip install "seastar-gym[train]".'
        ) from missing
