"""Agents by the names that the command lines know.

A new agent is a class with `predict` and one line in `AGENTS`. An agent of one's own needs no line: it is asked for by
the name of the function that makes it, "module:function".

Agents that were made elsewhere: models of plain Stable-Baselines3, and functions that return a policy.

    seastar evaluate --agents runs/mine/model.zip my_agents:make pentagon

Modules are found as by `python -m`, those of the current folder included. A policy of a function answers for one robot;
one with a true attribute `batched`, and Stable-Baselines3's, is handed the observations of all robots at once.

Both run the code of whoever made them: Stable-Baselines3's files are unpickled, which can execute anything. Load only
files that you trust. The policies of this project (.safetensors, and the model.zip of train.py) are not unpickled.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pickle
import re
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from copy import deepcopy
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np

from seastar_gym.controllers import learned
from seastar_gym.controllers.contract import Policy, actions_of, answer_of, is_batched, require_fit
from seastar_gym.controllers.learned import LearnedPolicy, reason_of
from seastar_gym.controllers.open_loop import GAITS, scripted
from seastar_gym.controllers.reduced import as_it_learned
from seastar_gym.controllers.search import GreedyPolicy, Planner, Searcher, gait_planner
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import OneRobotEnv, SeastarSwimEnv
from seastar_gym.envs.tasks import name_of
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_choice, require_kind, require_period, require_seed, require_texts, shown
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.scene import failure_in, find_modules_in, is_ours

_FUNCTION = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")


def is_function(name: str) -> bool:
    """Whether a name is that of a function in a module, "module:function"."""
    return _FUNCTION.fullmatch(name) is not None


def module_file(name: str) -> Path:
    """File of the module of a function of this name. ValueError if there is none."""
    module = name.partition(":")[0]
    find_modules_in(Path.cwd())
    try:
        spec = importlib.util.find_spec(module)
    except ModuleNotFoundError:
        spec = None
    if spec is None or not spec.has_location or spec.origin is None:
        raise ValueError(f"There is no agent {name!r}: no file has the module {module}.")
    return Path(spec.origin)


@contextmanager
def own_code(name: str) -> Iterator[None]:
    """Context in which an exception of the code of "module:function" becomes a ValueError with one sentence."""
    try:
        yield
    except Exception as wrong:  # the module is anybody's code
        if isinstance(wrong, ValueError | OSError) and is_ours(wrong):
            raise  # a sentence already
        raise ValueError(failure_in(module_file(name), wrong)) from wrong


def call_function(name: str, env: OneRobotEnv) -> Policy:
    """Policy that the function, or class, of this name returns for an environment.

    env: Environment that the function may inspect, simulate or learn in; the evaluation has another one.
    ValueError, with one sentence, if there is no such function or it returns no policy.
    """
    module, _, function = name.partition(":")
    find_modules_in(Path.cwd())
    with own_code(name):
        try:
            make = getattr(importlib.import_module(module), function, None)
        except ModuleNotFoundError as missing:
            raise ValueError(f"There is no agent {name!r}: {missing}.") from missing
    if not callable(make):
        raise ValueError(f"There is no agent {name!r}: the module {module} has no function {function}.")
    if not takes(make, env):
        raise ValueError(f"The agent {name!r} must be a function of one argument, the environment: {function}(env).")
    with own_code(name):
        policy = make(env)
    if not callable(getattr(policy, "predict", None)):
        raise ValueError(f"The agent {name!r} is a {type(policy).__name__}, which has no predict(observation, ...).")
    if not takes(policy.predict, None, state=None, episode_start=None, deterministic=True):
        raise ValueError(f"The agent {name!r} needs predict(observation, state, episode_start, deterministic).")
    policy = as_it_learned(policy, lambda: env)
    return policy if isinstance(policy, LearnedPolicy | Searcher) else OwnPolicy(policy, name)


def takes(function: Callable[..., Any], *arguments: Any, **named: Any) -> bool:
    """Whether a function can be called with these arguments, as far as it tells."""
    try:
        inspect.signature(function).bind(*arguments, **named)
    except TypeError:
        return False
    except ValueError:  # it has no signature
        return True
    return True


class OwnPolicy:
    """Policy of somebody's code, whose failures are sentences; its other attributes are those of that policy.

    One that is not batched answers for every robot of a batch: each has a copy of it, a new one in every episode, so
    that what a policy remembers is of its robot. One that cannot be copied is shared.

    name: "module:function" that it is of.
    """

    batched = True

    def __init__(self, policy: Policy, name: str):
        self._policy, self._name, self._copies = policy, name, dict[int, Any]()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._policy, name)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Action and state of one robot, or actions, shape (n, ...), and states of n robots."""
        with own_code(self._name):
            is_alone = np.ndim(observation) == 1
            if is_batched(self._policy):
                seen = np.asarray(observation)[None] if is_alone else observation
                action, state = answer_of(self._policy.predict(seen, state, episode_start, deterministic))
                return (np.asarray(action)[0] if is_alone else action), state
            if is_alone:
                return answer_of(self._policy.predict(observation, state, episode_start, deterministic))
            return self._of_each(observation, state, episode_start, deterministic)

    def _of_each(self, observation: Any, state: Any, episode_start: Any, deterministic: bool) -> tuple[Any, Any]:
        """Actions of n robots, shape (n, ...), and a list of their states."""
        n = len(observation)
        begins = np.full(n, state is None) if episode_start is None else np.asarray(episode_start, bool)
        states = [None] * n if state is None else list(state)
        answers = [
            answer_of(
                self._of(k, begins[k]).predict(
                    observation[k], None if begins[k] else states[k], begins[k : k + 1], deterministic
                )
            )
            for k in range(n)
        ]
        return np.stack([action for action, _ in answers]), [state for _, state in answers]

    def _of(self, robot: int, begins: bool) -> Any:
        """Policy of a robot."""
        if begins or robot not in self._copies:
            self._copies[robot] = self._policy
            with suppress(Exception):  # it holds what cannot be copied, such as a process
                self._copies[robot] = deepcopy(self._policy)
        return self._copies[robot]


def is_model(path: str | Path) -> bool:
    """Whether a file is a zip of Stable-Baselines3 that this project's training did not write."""
    if not zipfile.is_zipfile(path):
        return False
    with zipfile.ZipFile(path) as archive:
        return "policy.json" not in archive.namelist() and {"data", "policy.pth"} <= {*archive.namelist()}


def load_model(path: str | Path) -> Policy:
    """The policy of any algorithm of Stable-Baselines3, as it is in the file. Unpickles: see above.

    Its `num_timesteps` is how many decisions it learned for.

    One that learned behind `VectorSymmetryReduction` is to be given reduced observations, see `ReducedPolicy`; agents
    by name are behind it already. ValueError, with one sentence, if there is none in the file.
    """
    from stable_baselines3.common.save_util import load_from_zip_file

    try:
        data, parameters, _ = load_from_zip_file(path, device="cpu")
        if data is None:
            raise ValueError("it has no data")
        policy = data["policy_class"](
            data["observation_space"], data["action_space"], lambda progress: 0.0, **data["policy_kwargs"]
        )
        policy.load_state_dict(parameters["policy"])
    except (
        *(ValueError, TypeError, KeyError, AttributeError, RuntimeError, EOFError, ImportError),
        *(pickle.UnpicklingError, zipfile.BadZipFile, zlib.error),
    ) as unfit:
        raise ValueError(f"{path} is damaged, or no model of Stable-Baselines3: {reason_of(unfit)}.") from unfit
    if not all(np.isfinite(one.cpu().numpy()).all() for one in policy.state_dict().values()):
        raise ValueError(f"{path} has weights that are not finite numbers.")
    policy.num_timesteps = data.get("num_timesteps")
    _warn_of_normalised(path, data)
    return policy


def _warn_of_normalised(path: str | Path, data: dict[str, Any]) -> None:
    """Warn where a model learned behind `VecNormalize`, whose statistics its file has not.

    Learners on policy keep observations before normalisation there alone. Those with a replay buffer always do: their
    files do not tell.
    """
    if data.get("_last_original_obs") is not None and "replay_buffer_class" not in data:
        warnings.warn(
            f"{path} learned behind VecNormalize: if that normalised observations, swim it by a module:function that "
            "loads its statistics, too.",
            stacklevel=2,
        )


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
    require_texts("Agents", names)
    _, makers = _makers(names, seed, fidelity, decision_period, scene)
    return {label: make() for label, make in makers.items()}


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
    known, makers = _makers(names, seed, fidelity, decision_period, scene)
    agents, left_out = dict[str, Policy](), list[str]()
    for label, make in makers.items():
        try:
            policy = make()
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


def _makers(
    names: Sequence[str] | None, seed: int, fidelity: Fidelity, decision_period: float | None, scene: Scene | None
) -> tuple[Scene, dict[str, Callable[[], Policy]]]:
    """Scene that agents know, and functions that make them, by what they are called. names: None for the defaults."""
    require_seed(seed)
    require_choice("fidelity", fidelity, get_args(Fidelity))
    require_kind("scene", scene, Scene | None, "a Scene, or None")
    require_period(decision_period)
    known = make_scene(None, fidelity, decision_period) if scene is None else scene

    def make_env() -> SeastarSwimEnv:
        named = fidelity if scene is None else None
        return SeastarSwimEnv(scene=scene, fidelity=named, decision_period=decision_period)

    labels = _labels(default_agents(known) if names is None else names)
    return known, {
        label: partial(_load_agent, name, seed, known, decision_period, None, make_env)
        for label, name in labels.items()
    }


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
        plain = ": give env.unwrapped" if env is not getattr(env, "unwrapped", env) else ""
        raise ValueError(f"env must be an environment of this package, not {shown(env)}{plain}.")
    return _load_agent(name, seed, env.scene, env.timed, task_of(env), lambda: env)


def task_of(env: Any) -> str | None:
    """Name of the task of an environment or a batch; None for waypoints, or where a task has no name."""
    return name_of(getattr(env, "task", None))


def files_of(name: str, decision_period: float | None = None) -> list[Path]:
    """Files that the policy of a name is made of, the module's for "module:function"; none for what is computed.

    decision_period: Time between decisions [s]. None means strokes.
    """
    if is_function(name):
        return [module_file(name)]
    file = learned_file(name, decision_period)
    if file is not None:
        return [file, file.with_suffix(".json")]
    return [Path(name)] if is_file(name) else []


def learned_file(name: str, decision_period: float | None = None) -> Path | None:
    """File with the weights of a learned policy, bundled or not; None for the name of another agent.

    decision_period: As of `files_of`.
    """
    bundled = learned.bundled_file(decision_period) if name == "learned" else learned.by_name().get(name)
    return bundled or (Path(name) if name.endswith(".safetensors") else None)


def learned_policy(name: str, decision_period: float | None = None) -> learned.LearnedPolicy | None:
    """Learned policy of a name, bundled or from the files of a training; None for the name of another agent.

    decision_period: As of `files_of`.
    """
    file = learned_file(name, decision_period)
    if name.endswith(".zip"):
        file = None if is_model(name) else Path(name)
    return None if file is None else learned.load(file)


def period_of(name: str) -> float | None:
    """Time between decisions [s] that a model of Stable-Baselines3 learned with, if this is the file of one and says
    it."""
    sees: Any = getattr(_load_file(name), "observation_space", None) if is_file(name) and is_model(name) else None
    return getattr(sees, "decision_period", None)


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
    if (policy := learned_policy(name)) is not None:
        return policy
    if is_function(name):
        return call_function(name, make_env())
    if is_file(name):
        return as_it_learned(_load_file(name), make_env)
    return _scripted(name, seed, decision_period, scene.robot.n_limbs)


def _scripted(name: str, seed: int, decision_period: float | None, n_limbs: int) -> Policy:
    known = (*GAITS, "random")
    try:
        return scripted(name, None, n_limbs, np.random.default_rng(seed), decision_period)
    except ValueError as unknown:
        if name in known:
            raise  # a gait that does not fit the time between decisions
        if Path(name).exists():
            policy = Path(name, "policy.safetensors") if Path(name).is_dir() else "policy.safetensors or model.zip"
            raise ValueError(f"{name} is no file of a policy, such as {policy}.") from None
        others = f"{', '.join(AGENTS)}, files of policies, and module:function"
        raise ValueError(f"{unknown} Others are {others}.") from unknown


def _load_file(name: str) -> Policy:
    """Policy of a file that is no policy of this project, unless it is one that is refused."""
    try:
        return load_model(name) if is_model(name) else learned.load(name)
    except ModuleNotFoundError as missing:
        raise ValueError(
            f'A model.zip of Stable-Baselines3 needs {missing.name}: pip install "seastar-gym[train]".'
        ) from missing
