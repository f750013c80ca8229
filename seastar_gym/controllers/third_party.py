"""Agents that were made elsewhere: models of plain Stable-Baselines3, and functions that return a policy.

    seastar evaluate --agents runs/mine/model.zip my_agents:make pentagon

Modules are found as by `python -m`, those of the current folder included. A policy of a function answers for one robot;
one with a true attribute `batched`, and Stable-Baselines3's, is handed the observations of all robots at once.

Both run the code of whoever made them: Stable-Baselines3's files are unpickled, which can execute anything. Load only
files that you trust. The policies of this project (.safetensors, and the model.zip of train.py) are not unpickled.
"""

import importlib
import importlib.util
import pickle
import re
import zipfile
import zlib
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import reason_of
from seastar_gym.envs.seastar_swim import OneRobotEnv
from seastar_gym.scene.scene_file import search

_FUNCTION = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")


def is_function(name: str) -> bool:
    """Whether a name is that of a function in a module, "module:function"."""
    return _FUNCTION.fullmatch(name) is not None


def module_file(name: str) -> Path:
    """File of the module of a function of this name. ValueError if there is none."""
    module = name.partition(":")[0]
    search(Path.cwd())
    try:
        spec = importlib.util.find_spec(module)
    except ModuleNotFoundError:
        spec = None
    if spec is None or not spec.has_location or spec.origin is None:
        raise ValueError(f"There is no agent {name!r}: no file has the module {module}.")
    return Path(spec.origin)


def call_function(name: str, env: OneRobotEnv) -> Policy:
    """Policy that the function, or class, of this name returns for an environment.

    env: Environment that the function may inspect, simulate or learn in; the evaluation has another one.
    ValueError, with one sentence, if there is no such function or it returns no policy.
    """
    module, _, function = name.partition(":")
    search(Path.cwd())
    try:
        make = getattr(importlib.import_module(module), function, None)
    except ModuleNotFoundError as missing:
        raise ValueError(f"There is no agent {name!r}: {missing}.") from missing
    if not callable(make):
        raise ValueError(f"There is no agent {name!r}: the module {module} has no function {function}.")
    policy = make(env)
    if not callable(getattr(policy, "predict", None)):
        raise ValueError(f"The agent {name!r} is a {type(policy).__name__}, which has no predict(observation, ...).")
    return policy if _is_batched(policy) else RobotByRobot(policy)


def _is_batched(policy: Any) -> bool:
    """Whether a policy answers for many robots at once."""
    third_party = {each.__module__.partition(".")[0] for each in type(policy).__mro__}
    return bool(getattr(policy, "batched", not third_party.isdisjoint({"stable_baselines3", "sb3_contrib"})))


class RobotByRobot:
    """Policy that has another one answer for every robot of a batch; its other attributes are those of that policy.

    Every robot has a copy of the policy, a new one in every episode, so that what a policy remembers is of its robot.
    One that cannot be copied is shared.
    """

    batched = True

    def __init__(self, policy: Policy):
        self._policy, self._copies = policy, dict[int, Any]()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._policy, name)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Action and state of one robot, or actions, shape (n, ...), and a list of states of n robots."""
        if np.ndim(observation) == 1:
            return self._policy.predict(observation, state, episode_start, deterministic)
        n = len(observation)
        begins = np.full(n, state is None) if episode_start is None else np.asarray(episode_start, bool)
        states = [None] * n if state is None else list(state)
        answers = [
            self._of(k, begins[k]).predict(
                observation[k], None if begins[k] else states[k], begins[k : k + 1], deterministic
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
    """The policy of any algorithm of Stable-Baselines3, trained on the plain environment. Unpickles: see above.

    ValueError, with one sentence, if there is none in the file.
    """
    from stable_baselines3.common.save_util import load_from_zip_file

    try:
        data, parameters, _ = load_from_zip_file(path, device="cpu")
        if data is None:
            raise ValueError("it has no data")
        policy = data["policy_class"](
            data["observation_space"], data["action_space"], _no_learning, **data["policy_kwargs"]
        )
        policy.load_state_dict(parameters["policy"])
    except (
        *(ValueError, TypeError, KeyError, AttributeError, RuntimeError, EOFError, ImportError),
        *(pickle.UnpicklingError, zipfile.BadZipFile, zlib.error),
    ) as unfit:
        raise ValueError(f"{path} is damaged, or no model of Stable-Baselines3: {reason_of(unfit)}.") from unfit
    if not all(np.isfinite(one.cpu().numpy()).all() for one in policy.state_dict().values()):
        raise ValueError(f"{path} has weights that are not finite numbers.")
    return policy


def _no_learning(progress: float) -> Any:
    """A learning rate for a policy that has learned."""
    return 0.0
