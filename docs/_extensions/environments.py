"""A page of every registered id and class of environments, in the sections of Gymnasium's pages.

Made of rows in `seastar_gym.envs.IDS`, spaces, docstrings, references of the benchmark and cards of bundled policies.
"""

import inspect
import json
import re
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from reference import listed, markdown

from seastar_gym.controllers.learned import bundled_for
from seastar_gym.envs import IDS
from seastar_gym.envs.layout import HEADINGS, Layout
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.evaluation.rollout import measure_of_task

DOCS = Path(__file__).resolve().parents[1]
PAGE = re.compile(r"\bdocs/(\w+)\.md")
TABLE = re.compile(r"^\|.*\n(?:\|.*\n?)+", re.MULTILINE)
SHOWN = {
    "Action space": "action-space",
    "Time between decisions": "ids",
    "Observation space": "observation-space",
    "Reward": "reward",
}
"""Sections whose first table stands on the page of all environments, and where."""
CLASSES = (SeastarSwimEnv, SeastarSwimVectorEnv)
MADE_OF = ("greedy", "planner", "adaptive", "oracle")
"""Agents of the references, in the order of a page."""


def names() -> list[str]:
    """Ids and classes that have a page."""
    return [*IDS, *(kind.__name__ for kind in CLASSES)]


def pages() -> dict[str, str]:
    """Pages in Markdown, by the names of ids and classes."""
    return {id: page(id) for id in IDS} | {kind.__name__: contract(kind) for kind in CLASSES}


def page(id: str) -> str:
    """Page of an id."""
    env: Any = gym.make(id, disable_env_checker=True).unwrapped
    kind = type(env) if IDS[id].task is None else type(env.task)
    said, common = sections(kind), sections(SeastarSwimEnv)
    told = {
        "Description": said[""],
        "Action Space": actions(env),
        "Observation Space": said["Observation"] if "Observation" in said else observation(env),
        "Rewards": said["Reward"] if IDS[id].task else rewards(env),
        "Starting State": said["Starting state"],
        "Episode End": f"{said['Episode end']}\n\n{limit(id)}",
        "Info": said["Info"] if IDS[id].task else "All of [the contract](SeastarSwimEnv.md#info).",
        "Arguments": arguments(id, env, said["Arguments"] if IDS[id].task else common["Headings"] * bool(IDS[id].more)),
        "Baselines": baselines(id, env),
        "Version History": f"- {id.rpartition('-')[2]}: first release",
    }
    parts = [f"# {id}", film(id), facts(id, env)]
    return "\n\n".join([*parts, *(f"## {title}\n\n{text.strip()}" for title, text in told.items())]) + "\n"


def sections(kind: type) -> dict[str, str]:
    """Sections of a class's docstring by their titles; that without one comes first."""
    first, *others = re.split(r"^## ", listed(inspect.getdoc(kind) or ""), flags=re.MULTILINE)
    texts = {"": first} | {title: text for title, _, text in (part.partition("\n") for part in others)}
    return {title: linked(markdown(text)).strip() for title, text in texts.items()}


def linked(text: str) -> str:
    """Text in which names of pages are links."""
    there = {file.stem for file in DOCS.glob("*.md")}
    return PAGE.sub(lambda said: f"[{said[1]}](../{said[1]}.md)" if said[1] in there else said[0], text)


def film(id: str) -> str:
    """The film of an id, and who swims."""
    policy = bundled_for(id)
    agent = f"the bundled policy `{policy.stem}`" if policy else "the gait `pentagon`"
    told = f"Limbs are numbered. Swum by {agent}, ten times as fast as the robot (`python -m studies.ids`)."
    return f"![{IDS[id].goal}](../ids/{id}.gif)\n\n{told}"


def facts(id: str, env: Any) -> str:
    """Table of an id's spaces and times."""
    row = IDS[id]
    told = {
        "asks for": row.goal,
        "Action Space": f"`{env.action_space}`",
        "Observation Space": f"`{env.observation_space}`",
        "Import": f'`gymnasium.make("{id}")`',
        "decision": f"every {row.decision_period:g} s",
        "time limit": f"{row.seconds:g} s, {row.decisions} decisions",
        "reward threshold": "none" if row.threshold is None else f"{row.threshold:g}",
    }
    return "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in told.items())])


def actions(env: Any) -> str:
    """What an action is, by the contract's table of their forms."""
    lines = sections(SeastarSwimEnv)["Action space"].splitlines()
    row = next(line for line in lines if f'`"{env.actions}"`' in line)
    kind, _, index, values, meaning = (cell.strip() for cell in row.strip("|").split("|"))
    table = ["| index | range | meaning |", "|---|---|---|", f"| {index} | {values} | {meaning} |"]
    forms = "n is the number of limbs. [All forms](../environments.md#action-space)."
    return "\n".join([f"`{env.action_space}`, the form {kind}; {forms}", "", *table])


def observation(env: Any) -> str:
    """Places of what is seen along waypoints."""
    at = Layout.of(env.scene, env.observe_actuators, HEADINGS * bool(env.headings))
    places = {
        "positions of the limbs' stations": at.positions,
        "velocities of the limbs' stations": at.velocities,
        "velocity of the hub": at.hub_velocity,
        "limb after limb: contractions of its wires + and -": at.actuators,
        "cosine and sine of the turns to the headings of the current and the next waypoint": at.headings,
        "current waypoint": at.current_waypoint,
        "next waypoint": at.next_waypoint,
    }
    rows = [f"| {at.start}..{at.stop - 1} | {name} |" for name, at in places.items() if at.start < at.stop]
    units = "[Units, frame and order](../environments.md#observation-space)."
    return "\n".join([f"`{env.observation_space}`. {units}", "", "| index | meaning |", "|---|---|", *rows])


def rewards(env: Any) -> str:
    """Terms along waypoints."""
    terms = [f"`{name}`" for name in env.task.terms]
    return f"The sum of {', '.join(terms)}: [meaning and weights](../environments.md#reward)."


def limit(id: str) -> str:
    return f"The time limit is {IDS[id].seconds:g} s, {IDS[id].decisions} decisions."


def arguments(id: str, env: Any, own: str) -> str:
    """How an id is made of its class, and what may be changed."""
    given = ", ".join(f"{name}={value!r}" for name, value in gym.spec(id).kwargs.items())
    text = f'`gymnasium.make("{id}")` is `SeastarSwimEnv({given})`, which has [more](SeastarSwimEnv.md#arguments).'
    of_task = f"Those of its task, `task={type(env.task).__name__}(...)`:" if IDS[id].task else ""
    return "\n\n".join(filter(None, (text, of_task, own)))


def baselines(id: str, env: Any) -> str:
    """What is kept of agents: references of the benchmark, and the card of the bundled policy."""
    parts = [references(id, measure_of_task(env.task)), card(id)]
    return "\n\n".join(filter(None, [*parts, "More agents: [control](../control.md)."]))


def references(id: str, measure: Any) -> str:
    """Table of the references of the benchmark; empty where there are none."""
    file = "seastar_gym/evaluation/references.json"
    kept = json.loads((DOCS.parent / file).read_text("utf-8"))
    means = {cell["agent"]: np.mean(cell["measure"]) for cell in kept["cells"] if cell["id"] == id}
    if not means:
        return ""
    head = f"Means over {len(kept['cells'][0]['measure'])} test episodes at `fast`; {measure.better} is better:"
    rows = [f"| {agent} | {means[agent]:.3g} |" for agent in MADE_OF if agent in means]
    made = f"`{kept['command']}` at commit `{kept['commit']}`."
    table = [f"| agent | {measure.name} [{measure.unit}] |", "|---|---:|", *rows]
    return "\n".join([head, "", *table, "", made])


def card(id: str) -> str:
    """How the bundled policy of an id swims, as its card says; empty where there is none."""
    if (file := bundled_for(id)) is None:
        return ""
    told = re.split(r"^## ", file.with_suffix(".md").read_text("utf-8"), flags=re.MULTILINE)
    (swims,) = (text.partition("\n")[2].strip() for text in told if text.startswith("How it swims"))
    return f"The bundled policy `{file.stem}`. {linked(swims.replace(' Other agents stand in docs/control.md.', ''))}"


def contract(kind: type) -> str:
    """Page of a class of environments; tables of the page of all stand there."""
    texts = sections(kind)
    for title, anchor in SHOWN.items() if kind is SeastarSwimEnv else ():
        texts[title] = TABLE.sub(f"[The table](../environments.md#{anchor}).\n", texts[title] + "\n", count=1)
    first = texts.pop("")
    parts = [f"# {kind.__name__}", first, *(f"## {title}\n\n{text}" for title, text in texts.items())]
    return "\n\n".join(parts) + "\n"
