"""The environments as tables: their ids from Gymnasium's registry, their contracts from their docstrings."""

import importlib
import inspect
import re
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec

import seastar_gym
from seastar_gym.envs.tasks.envs import CHALLENGES

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
    lines = ["| id | class | time limit [decisions] | arguments by default |", "|---|---|---:|---|"]
    for spec in specs():
        arguments = ", ".join(f"`{name}={value!r}`" for name, value in spec.kwargs.items()) or "-"
        name = str(spec.entry_point).partition(":")[2]
        lines.append(f"| `{spec.id}` | [{name}](#{name.lower()}) | {spec.max_episode_steps or '-'} | {arguments} |")
    return "\n".join(lines)


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
