"""Blocks of pages that no study makes: ids, contracts of environments, and numbers that tests keep."""

import inspect
import json
from functools import partial
from typing import Any

import gymnasium as gym

from seastar_gym.envs import IDS
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from studies.frame import DOCS, Study
from studies.pages import markdown


def environments() -> str:
    """Table of all ids: pictures, what `gym.make` gives by default, and links to docstrings."""
    head, rows = ["id", "asks for", "actions", "numbers seen", "decision [s]"], []
    for id, row in IDS.items():
        env: Any = gym.make(id, disable_env_checker=True).unwrapped
        place = type(env if row.task is None else env.task).__module__.replace(".", "/")
        numbers = env.observation_space.shape[0], row.decision_period
        link = f"[`{id}`](../{place}.py)<br>![{id}](ids/{id}.png)"
        rows.append([link, row.goal, f"`{env.action_space}`", *(f"{number:g}" for number in numbers)])
    return markdown(head, rows, (0, 1, 2))


def contract(title: str) -> str:
    """First table of a section of the docstring of `SeastarSwimEnv`."""
    section = str(inspect.getdoc(SeastarSwimEnv)).partition(f"\n## {title}\n")[2].partition("\n## ")[0]
    return "|" + section.partition("\n|")[2].partition("\n\n")[0]


def exact(name: str) -> str:
    """Comparisons that tests/exact makes: `pytest tests/exact --update` writes them."""
    kept = DOCS.parent / "tests" / "golden" / "exact" / f"{name}.json"
    return markdown(["quantity", "reference", "ours", "difference"], json.loads(kept.read_text("utf-8")))


TABLES = {
    "environments": environments,
    **{f"contract {title}": partial(contract, title) for title in ("Action space", "Observation space", "Reward")},
    **{f"exact {name}": partial(exact, name) for name in ("elastica", "frequencies", "drag", "waves", "published")},
}  # fmt: skip
STUDY = Study("contracts", tables={name: lambda _, of=of: of() for name, of in TABLES.items()})  # type: ignore[misc]
