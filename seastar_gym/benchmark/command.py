"""Measures agents on registered tasks over seeds: a table, performance profiles, and a file that can be merged.

Agents are names as in `seastar swim`, files of policies, or module:function. LABEL=A,B,C is one agent whose seeds are
swum by policies A, B, C in turn, as by ten trainings. Tasks are the ids that this package registers. An agent that does
not fit a task is left out there, with a sentence that says why.
"""

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import gymnasium as gym
import numpy as np

from seastar_gym.benchmark import page
from seastar_gym.benchmark.episodes import Episodes, held_out, swim_episodes
from seastar_gym.benchmark.measures import measure_of
from seastar_gym.benchmark.results import Entry, merged, read, write
from seastar_gym.command import command_parser
from seastar_gym.controllers.roster import HELP, load_agent
from seastar_gym.evaluation.many import HELD_OUT_SEED
from seastar_gym.evaluation.tasks import require_task, task_ids
from seastar_gym.scene.checks import require_count
from seastar_gym.scene.numerics import Fidelity


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    default = "(default: %(default)s)"
    found = command_parser("seastar benchmark", __doc__)
    found.add_argument("--agents", nargs="*", default=["learned", "greedy", "random"], help=f"{HELP} {default}")
    found.add_argument("--tasks", nargs="+", help=f"ids of tasks (default: all, {', '.join(task_ids())})")
    found.add_argument("--seeds", type=int, default=10, help=f"number of seeds {default}")
    found.add_argument("--fidelity", choices=get_args(Fidelity), help="accuracy (default: that of the task)")
    found.add_argument("--decisions", type=int, help="time limit [decisions] (default: that of the task)")
    found.add_argument("--out", type=Path, default=Path("runs/benchmark"), help=f"folder of the results {default}")
    found.add_argument("--merge", nargs="+", type=Path, default=[], help="files of other results, for the same page")
    return found


def policies_of(agent: str) -> tuple[str, list[str]]:
    """Label of an agent, and the names of the policies that swim its seeds in turn."""
    label, given, several = agent.partition("=")
    return (
        (label, several.split(",")) if given else (Path(agent).stem if len(Path(agent).parts) > 1 else agent, [agent])
    )


def measured(agent: str, task: str, options: argparse.Namespace) -> Entry:
    """Result of an agent on a task. ValueError, with one sentence, where it does not fit."""
    label, policies = policies_of(agent)
    seeds = [HELD_OUT_SEED + number for number in range(options.seeds)]
    arguments = held_out(task) | ({} if options.fidelity is None else {"fidelity": options.fidelity})
    env: Any = gym.make(task, disable_env_checker=True, **arguments).unwrapped
    measure = measure_of(env)
    rows: dict[int, dict[str, Any]] = {}
    for number, name in enumerate(policies[: len(seeds)]):
        own = seeds[number :: len(policies)]
        policy = load_agent(name, env, own[0])
        swum = swim_episodes(task, policy, own, fidelity=options.fidelity, max_decisions=options.decisions)
        rows |= dict(zip(own, _rows(swum, measure.of(swum)), strict=True))
    columns: dict[str, Any] = {name: [rows[seed][name] for seed in seeds] for name in rows[seeds[0]]}
    return Entry(
        task, label, options.fidelity or "", measure.name, measure.unit, measure.better, seeds=seeds, **columns
    )


def _rows(swum: Episodes, scores: np.ndarray[Any, Any]) -> list[dict[str, Any]]:
    """Results of every episode, as plain numbers."""
    names = ("scores", "success", "returns", "decisions")
    columns = (scores, swum.success, swum.returns, swum.decisions)
    return [dict(zip(names, row, strict=True)) for row in zip(*(column.tolist() for column in columns), strict=True)]


def benchmark(options: argparse.Namespace) -> list[Entry]:
    """Results of all agents on all tasks; who does not fit is said on the way."""
    require_count("--seeds", options.seeds, 1, 10_000)
    if options.decisions is not None:
        require_count("--decisions", options.decisions, 1, 1_000_000)
    tasks = task_ids() if options.tasks is None else options.tasks
    for task in tasks:
        require_task(task)
    labels = [policies_of(agent)[0] for agent in options.agents]
    if len(set(labels)) < len(labels):
        raise ValueError(f"Two agents are called {max(labels, key=labels.count)}: name them with LABEL=AGENT.")
    entries = []
    for task in tasks:
        for agent in options.agents:
            try:
                entries.append(measured(agent, task, options))
            except (ValueError, FileNotFoundError) as unfit:
                print(f"{agent} does not swim {task}: {unfit}", file=sys.stderr)
                continue
            print(f"{agent}, {task}: {entries[-1].measure} {entries[-1].estimate()} [{entries[-1].unit}]", flush=True)
    return entries


def publish(entries: Sequence[Entry], folder: Path, command: str) -> list[str]:
    """Write results.json, benchmark.md and, where matplotlib is there, profiles.png; returns their names."""
    folder.mkdir(parents=True, exist_ok=True)
    write(entries, folder / "results.json")
    _, scores = page.common(entries)
    picture = None
    if len(scores) > 1:
        try:
            page.draw(scores, folder / "profiles.png")
            picture = "profiles.png"
        except ModuleNotFoundError:
            print('No picture: that needs matplotlib, pip install "seastar-gym[studies]".')
    (folder / "benchmark.md").write_text(page.page(entries, command, picture), encoding="utf-8")
    return ["results.json", "benchmark.md", *([] if picture is None else [picture])]


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    options = parser().parse_args(given)
    try:
        others = [read(file) for file in options.merge]
        entries = merged(*others, benchmark(options) if options.agents else [])
        if not entries:
            raise ValueError("There is nothing to show: no agent swam a task.")
        files = publish(entries, options.out, shlex.join(["seastar", "benchmark", *given]))
    except (ValueError, ImportError, FileNotFoundError) as bad_input:
        print(bad_input, file=sys.stderr)
        return 2
    print(page.table(entries))
    print(f"Written to {options.out}: {', '.join(files)}")
    return 0
