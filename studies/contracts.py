"""Blocks of pages that no study makes: ids, contracts of environments, and numbers that tests keep."""

import importlib
import inspect
import json
import re
from typing import Any

import gymnasium as gym

from seastar_gym import TASKS
from studies.frame import DOCS, Study
from studies.pages import markdown


def environments() -> str:
    """Table of all ids: what `gym.make` gives by default. Tasks have a link to what their docstring says."""
    head, rows = ["id", "contract", "actions", "numbers seen", "decision [s]", "limit [decisions]", "threshold"], []
    for spec in specs():
        env: Any = gym.make(spec.id, disable_env_checker=True).unwrapped
        of = type(env.task if spec.id in TASKS else env)
        place = f"../{of.__module__.replace('.', '/')}.py" if spec.id in TASKS else f"#{of.__name__.lower()}"
        numbers = env.observation_space.shape[0], env.decision_period, spec.max_episode_steps, spec.reward_threshold
        shown = ("-" if number is None else f"{number:g}" for number in numbers)
        rows.append([f"`{spec.id}`", f"[{of.__name__}]({place})", f"`{env.action_space}`", *shown])
    return markdown(head, rows, (0, 1, 2))


def specs() -> list[Any]:
    """What is registered of the package, in its order."""
    return [spec for spec in gym.registry.values() if str(spec.entry_point).startswith("seastar_gym.")]


def contracts() -> str:
    """Docstring of every class of environments, with its headings one level deeper and its arguments as a list."""
    points = dict.fromkeys(point for spec in specs() for point in (spec.entry_point, spec.vector_entry_point) if point)
    sections = []
    for module, name in (str(point).split(":") for point in points):
        said = inspect.getdoc(getattr(importlib.import_module(module), name)) or ""
        listed = re.sub(r"^(\w+(?:, \w+)*): ", r"- **\1**: ", said, flags=re.MULTILINE)
        sections.append(f"## {name}\n\n{re.sub('^#', '##', listed, flags=re.MULTILINE)}")
    return "\n\n".join(sections)


SHOWN = ("elastica", "frequencies", "drag", "waves", "published")
"""Files of comparisons in tests/golden/exact."""
LEFT_OUT = re.compile(r"chapter|frequency [23]|the worst of|^distance")
"""Comparisons that only the tests have: the other discretisation, higher modes, loose tolerances, distances."""


def exact() -> str:
    """Comparisons that tests/exact makes: `pytest tests/exact --update` writes them."""
    folder = DOCS.parent / "tests" / "golden" / "exact"
    rows = [row for name in SHOWN for row in json.loads((folder / f"{name}.json").read_text("utf-8"))]
    kept = [row for row in rows if not LEFT_OUT.search(row[0])]
    return markdown(["quantity", "reference", "ours", "difference"], kept)


TABLES = {"contracts": contracts, "environments": environments, "exact": exact}
STUDY = Study("contracts", tables={name: lambda _, of=of: of() for name, of in TABLES.items()})  # type: ignore[misc]
