"""Agents that were made elsewhere: models of plain Stable-Baselines3, and functions that return a policy.

    seastar evaluate --agents runs/mine/model.zip my_agents:make pentagon

Both run the code of whoever made them: Stable-Baselines3's files are unpickled, which can execute anything. Load only
files that you trust. The policies of this project (.safetensors, and the model.zip of train.py) are not unpickled.
"""

import importlib
import importlib.util
import pickle
import re
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import reason_of
from seastar_gym.envs.seastar_swim import SeastarSwimEnv

_FUNCTION = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")


def is_function(name: str) -> bool:
    """Whether a name is that of a function in a module, "module:function"."""
    return _FUNCTION.fullmatch(name) is not None


def module_file(name: str) -> Path:
    """File of the module of a function of this name. ValueError if there is none."""
    module = name.partition(":")[0]
    try:
        spec = importlib.util.find_spec(module)
    except ModuleNotFoundError:
        spec = None
    if spec is None or not spec.has_location or spec.origin is None:
        raise ValueError(f"There is no agent {name!r}: no file has the module {module}.")
    return Path(spec.origin)


def call_function(name: str, env: SeastarSwimEnv) -> Policy:
    """Policy that the function, or class, of this name returns for an environment.

    env: Environment that the function may inspect, simulate or learn in; the evaluation has another one.
    ValueError, with one sentence, if there is no such function or it returns no policy.
    """
    module, _, function = name.partition(":")
    try:
        make = getattr(importlib.import_module(module), function, None)
    except ModuleNotFoundError as missing:
        raise ValueError(f"There is no agent {name!r}: {missing}.") from missing
    if not callable(make):
        raise ValueError(f"There is no agent {name!r}: the module {module} has no function {function}.")
    policy = make(env)
    if not callable(getattr(policy, "predict", None)):
        raise ValueError(f"The agent {name!r} is a {type(policy).__name__}, which has no predict(observation, ...).")
    return policy


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
