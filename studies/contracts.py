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
from studies.frame import DOCS, Study
from studies.pages import markdown

DEEPER = re.compile(r"^#", re.MULTILINE)
SETTINGS = re.compile(r"(?<= are)\n\n\| id .*?\n(?=\n)", re.DOTALL)
IDS = re.compile(r"\| id .*?\n\n", re.DOTALL)
"""Tables of ids in docstrings, which the page has at its top."""
FEW = 100
"""Words of arguments that are not folded."""
CERTAIN = re.compile(r" \[([\d.]+), \1\]")
"""Intervals of length zero."""
TERMS = re.compile(r"^\| `reward_\w+` +\| float.*\n", re.MULTILINE)
"""Rows of `info` that repeat the table of the reward."""


def specs() -> list[EnvSpec]:
    """Specs of all environments of the package, in the order in which they are registered."""
    return [spec for spec in gym.registry.values() if str(spec.entry_point).startswith(f"{seastar_gym.__name__}.")]


def environment(entry_point: str) -> type[Any]:
    """Class of an entry point "module:class"."""
    module, _, name = entry_point.partition(":")
    return getattr(importlib.import_module(module), name)


def registered() -> str:
    """Table of all ids: what `gym.make` gives by default."""
    head = ["id", "contract", "actions", "numbers seen", "decision [s]", "limit [decisions]", "threshold"]
    return markdown(head, map(row, specs()), (0, 1, 2))


def row(spec: EnvSpec) -> list[str]:
    """Row of an id. An environment of a task has a link to its challenge, whose docstring is the contract."""
    env: Any = gym.make(spec.id, disable_env_checker=True).unwrapped
    (size,) = env.observation_space.shape
    limit, threshold = (f"{value:g}" if value else "-" for value in (spec.max_episode_steps, spec.reward_threshold))
    period = f"{env.decision_period:g}"
    return [f"`{spec.id}`", of_class(env), actions(env.action_space), str(size), period, limit, threshold]


def of_class(env: Any) -> str:
    """Link to the contract of an environment: a section of the page, or the source of its challenge."""
    if not hasattr(env, "challenge"):
        return f"[{type(env).__name__}](#{type(env).__name__.lower()})"
    challenge = type(env.challenge)
    return f"[{challenge.__name__}](../{challenge.__module__.replace('.', '/')}.py)"


def actions(space: gym.Space[Any]) -> str:
    """A space of actions in a few words."""
    match space:
        case spaces.Discrete():
            return f"`Discrete({space.n})`"
        case spaces.MultiDiscrete():
            return f"`MultiDiscrete([{space.nvec[0]}] * {len(space.nvec)})`"
    return f"`Box(-1, 1, {space.shape})`"


def contracts() -> str:
    """Docstring of every class of environments, once, in a section of its own."""
    points = [str(point) for spec in specs() for point in (spec.entry_point, spec.vector_entry_point) if point]
    return "\n\n".join(f"## {each.__name__}\n\n{contract(each)}" for each in dict.fromkeys(map(environment, points)))


def contract(documented: type[Any]) -> str:
    """Docstring one level of headings deeper, without what the page has elsewhere; arguments as a list."""
    head, title, arguments = (inspect.getdoc(documented) or "").partition("## Arguments")
    besides, _, arguments = arguments.partition("\n")
    named, memory, rest = arguments.partition("\n## ")
    named = re.sub(r"^(\w+(?:, \w+)*): ", r"- **\1**: ", named, flags=re.MULTILINE)
    if len(named.split()) > FEW:
        named = f"\n<details><summary>What they are</summary>\n\n{named}\n\n</details>\n"
    text = "".join([head, title, besides, "\n", named, memory, rest])
    return DEEPER.sub("##", TERMS.sub("", IDS.sub("", SETTINGS.sub(" those at the top of this page.\n", text))))


def leaderboard() -> str:
    """Means, intervals and shares of success of agents that do more than rest, from the committed benchmark."""
    rows = []
    for (task, _), of_agent in page.by_task(results.read(DOCS / "leaderboard" / "results.json")).items():
        learned, greedy = of_agent.get("learned"), of_agent.get("greedy")
        if learned:
            measure = f"{learned.measure.replace('time until done', 'time')} [{learned.unit}]"
            cells = [CERTAIN.sub("", page.cell(entry)) for entry in (learned, greedy)]
            rows.append([task.removeprefix("Seastar").removesuffix("-v0"), measure, *cells])
    return markdown(["task", "measure", "learned", "greedy"], rows, (0, 1))


STUDY = Study(
    "contracts",
    tables={
        "contracts": lambda _: contracts(),
        "environments": lambda _: registered(),
        "leaderboard": lambda _: leaderboard(),
    },
)
