"""Tables of docs/environments.md: ids from Gymnasium's registry, contracts from docstrings; and the leaderboard's."""

import importlib
import inspect
import re
from typing import Any

import gymnasium as gym
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec

import seastar_gym
from seastar_gym.benchmark import page, results
from seastar_gym.envs.tasks.envs import CHALLENGES
from studies.frame import DOCS, Study

DEEPER = re.compile(r"^#", re.MULTILINE)


def specs() -> list[EnvSpec]:
    """Specs of all environments of the package, in the order in which they are registered."""
    return [spec for spec in gym.registry.values() if str(spec.entry_point).startswith(f"{seastar_gym.__name__}.")]


def environment(entry_point: str) -> type[Any]:
    """Class of an entry point "module:class"."""
    module, _, name = entry_point.partition(":")
    return getattr(importlib.import_module(module), name)


def registered() -> str:
    """Table of all ids: what `gym.make` gives by default."""
    head = "| id | contract | actions | observation | time limit [decisions] | arguments by default |"
    return "\n".join([head, "|---|---|---|---|---:|---|", *map(row, specs())])


def row(spec: EnvSpec) -> str:
    """Row of an id. An environment of a task has the contract of its challenge, too."""
    env: Any = gym.make(spec.id, disable_env_checker=True).unwrapped
    names = [type(env).__name__, *([type(env.challenge).__name__] if hasattr(env, "challenge") else [])]
    links = ", ".join(f"[{name}](#{name.lower()})" for name in names)
    arguments = ", ".join(f"`{name}={short(value)}`" for name, value in spec.kwargs.items()) or "-"
    (size,) = env.observation_space.shape
    limit = spec.max_episode_steps or "-"
    return f"| `{spec.id}` | {links} | {actions(env.action_space)} | {size} numbers | {limit} | {arguments} |"


def actions(space: gym.Space[Any]) -> str:
    """A space of actions in a few words."""
    match space:
        case spaces.Discrete():
            return f"`Discrete({space.n})`"
        case spaces.MultiDiscrete():
            return f"`MultiDiscrete({space.nvec.tolist()})`"
    return f"`Box(-1, 1, {space.shape})`"


def short(value: Any) -> str:
    """An argument; a part of a scene or a task by the name of its class."""
    return f"{value['kind']}()" if isinstance(value, dict) else repr(value)


def contracts() -> str:
    """Docstring of every class of environments and of every challenge, once, in a section of its own."""
    points = [str(point) for spec in specs() for point in (spec.entry_point, spec.vector_entry_point) if point]
    classes = dict.fromkeys([*map(environment, points), *map(type, CHALLENGES.values())])
    return "\n\n".join(f"## {each.__name__}\n\n{contract(each)}" for each in classes)


def contract(documented: type[Any]) -> str:
    """Docstring one level of headings deeper; arguments as a list."""
    head, title, arguments = (inspect.getdoc(documented) or "").partition("## Arguments\n")
    text = head + title + re.sub(r"^(\w+): ", r"- **\1**: ", arguments, flags=re.MULTILINE)
    return DEEPER.sub("##", text)


STUDY = Study(
    "contracts",
    tables={
        "contracts": lambda _: contracts(),
        "environments": lambda _: registered(),
        "leaderboard": lambda _: page.table(results.read(DOCS / "leaderboard" / "results.json")),
    },
)
