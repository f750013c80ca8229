"""Agents by the names that the command lines know."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from agents import foreign
from agents import policy as learned
from agents.greedy import GreedyPolicy
from agents.planner import Planner
from agents.scripted import scripted
from agents.swim import Policy
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.task import make_scene
from seastar_gym.scene.numerics import Fidelity

OTHERS = ("learned", "greedy", "planner")
"""Agents that are not scripted."""


def load_agents(names: Sequence[str], seed: int = 0, fidelity: Fidelity = "balanced") -> dict[str, Policy]:
    """Policies by name: the one in the box, scripted ones, the greedy one by a map of a fidelity's physics, the
    planner, which always plans with the fast ones, files under their names without the ending, and "module:function"
    for what a function returns that gets an environment; see foreign.py for what the last two may execute."""
    agents: dict[str, Policy] = {}
    for name in names:
        label = Path(name).stem if _is_file(name) else name
        label = str(Path(name).with_suffix("")) if label in agents else label
        if label in agents:
            raise ValueError(f"The agent {name!r} is named twice.")
        agents[label] = _load_agent(name, seed, fidelity)
    return agents


def _is_file(name: str) -> bool:
    return name.endswith((".zip", ".safetensors", ".pth", ".pt", ".pkl")) or len(Path(name).parts) > 1


def _load_agent(name: str, seed: int, fidelity: Fidelity) -> Policy:
    if name == "learned":
        return learned.load()
    if name == "greedy":
        return GreedyPolicy(make_scene(None, fidelity))
    if name == "planner":
        return Planner()
    if foreign.is_function(name):
        return foreign.call_function(name, SeastarSwimEnv(fidelity=fidelity))
    if not _is_file(name):
        try:
            return scripted(name, rng=np.random.default_rng(seed))
        except ValueError as unknown:
            others = f"{', '.join(OTHERS)}, files of policies, and module:function"
            raise ValueError(f"{unknown} Others are {others}.") from unknown
    if not name.endswith(".zip"):
        return learned.load(name)
    try:
        if foreign.is_model(name):
            return foreign.load_model(name)
        from agents import ppo
    except ModuleNotFoundError as missing:
        raise ValueError(f'A model.zip needs {missing.name}: pip install "seastar-gym[train]".') from missing
    return ppo.load(name)
