"""Blocks of pages that no study makes: ids, contracts of environments, and numbers that tests keep."""

import inspect
import json
import re
from functools import partial
from typing import Any

import gymnasium as gym

from seastar_gym.envs import IDS
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from studies.frame import DOCS, Study
from studies.pages import markdown


def environments() -> str:
    """Table of all ids: pictures, what `gym.make` gives by default, and links to docstrings."""
    head, rows = ["id", "asks for", "actions", "numbers seen", "decision [s]", "time limit [s]"], []
    for id, row in IDS.items():
        env: Any = gym.make(id, disable_env_checker=True).unwrapped
        place = type(env if row.task is None else env.task).__module__.replace(".", "/")
        numbers = env.observation_space.shape[0], row.decision_period, row.seconds
        link = f"[`{id}`](../{place}.py)<br>![{id}](ids/{id}.png)"
        rows.append([link, row.goal, f"`{env.action_space}`", *(f"{number:g}" for number in numbers)])
    return markdown(head, rows, (0, 1, 2))


def contract(title: str) -> str:
    """First table of a section of the docstring of `SeastarSwimEnv`."""
    section = str(inspect.getdoc(SeastarSwimEnv)).partition(f"\n## {title}\n")[2].partition("\n## ")[0]
    return "|" + section.partition("\n|")[2].partition("\n\n")[0]


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


TABLES = {
    "environments": environments, "exact": exact,
    **{f"contract {title}": partial(contract, title) for title in ("Action space", "Observation space", "Reward")},
}  # fmt: skip
STUDY = Study("contracts", tables={name: lambda _, of=of: of() for name, of in TABLES.items()})  # type: ignore[misc]
