"""Measures agents on registered tasks over seeds: a table, performance profiles, and a file that can be merged.

Agents are names as in `seastar swim`, files of policies, or module:function. LABEL=A,B,C is one agent whose seeds are
swum by policies A, B, C in turn, as by ten trainings. Tasks are the ids that this package registers. An agent that does
not fit a task is left out there, with a sentence that says why, and the exit code is 2.

An agent's episodes on a task are a job, or several (--seeds-per-job), which an executor runs. Results are the same on
each. Nodes of a cluster need the package, the modules and the files of policies where this machine has them.

Ctrl-C keeps the results of agents on tasks that are finished, in OUT/interrupted.json, for --merge.
"""

import argparse
import shlex
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, get_args

from seastar_gym.benchmark import page
from seastar_gym.benchmark.jobs import Answer, Job, answers
from seastar_gym.benchmark.results import Entry, merged, read, write
from seastar_gym.command import DEFAULT, INTERRUPTED, answered, command_parser
from seastar_gym.controllers.registry import HELP
from seastar_gym.evaluation.many import HELD_OUT_SEED
from seastar_gym.evaluation.measures import measure_of
from seastar_gym.evaluation.tasks import env_of, held_out, require_task, task_ids
from seastar_gym.executors.options import add_options, executor_of
from seastar_gym.files import write_atomically
from seastar_gym.scene.checks import require_count
from seastar_gym.scene.numerics import Fidelity


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    found = command_parser("seastar benchmark", __doc__)
    found.add_argument("--agents", nargs="*", default=["learned", "greedy", "random"], help=f"{HELP} {DEFAULT}")
    found.add_argument("--tasks", nargs="+", help=f"ids of tasks (default: all, {', '.join(task_ids())})")
    found.add_argument("--seeds", type=int, default=10, help=f"number of seeds {DEFAULT}")
    found.add_argument("--fidelity", choices=get_args(Fidelity), help="accuracy (default: that of the task)")
    found.add_argument("--decisions", type=int, help="time limit [decisions] (default: that of the task)")
    found.add_argument("--out", type=Path, default=Path("runs/benchmark"), help=f"folder of the results {DEFAULT}")
    found.add_argument("--seeds-per-job", type=int, help="seeds of a job (default: all of a policy)")
    add_options(found, "jobs", "here")
    found.add_argument("--merge", nargs="+", type=Path, default=[], help="files of other results, for the same page")
    return found


def policies_of(agent: str) -> tuple[str, list[str]]:
    """Label of an agent, and the names of the policies that swim its seeds in turn."""
    label, given, several = agent.partition("=")
    return (
        (label, several.split(",")) if given else (Path(agent).stem if len(Path(agent).parts) > 1 else agent, [agent])
    )


def jobs_of(agent: str, task: str, options: argparse.Namespace) -> list[Job]:
    """Jobs of an agent on a task."""
    _, policies = policies_of(agent)
    seeds = [HELD_OUT_SEED + number for number in range(options.seeds)]
    size, threads = options.seeds_per_job or len(seeds), None if options.executor == "here" else 1
    return [
        Job(task, agent, name, tuple(own[begin : begin + size]), options.fidelity, options.decisions, threads)
        for number, name in enumerate(policies[: len(seeds)])
        for own in [seeds[number :: len(policies)]]
        for begin in range(0, len(own), size)
    ]


def entry_of(found: Sequence[Answer]) -> Entry:
    """Entry of all jobs of an agent on a task."""
    job = found[0].job
    rows = {seed: row for each in found for seed, row in zip(each.job.seeds, each.rows, strict=True)}
    seeds = sorted(rows)
    columns: dict[str, Any] = {name: [rows[seed][name] for seed in seeds] for name in rows[seeds[0]]}
    measure = measure_of(env_of(job.task, **held_out(job.task, job.fidelity)))
    return Entry(
        job.task, policies_of(job.agent)[0], job.fidelity or "", measure.name, measure.unit, measure.better,
        seeds=seeds, **columns,
    )  # fmt: skip


def require_sound(options: argparse.Namespace) -> list[str]:
    """Tasks of the options; ValueError where something in them is wrong."""
    require_count("--seeds", options.seeds, 1, 10_000)
    for name in ("decisions", "seeds_per_job"):
        if getattr(options, name) is not None:
            require_count(f"--{name.replace('_', '-')}", getattr(options, name), 1, 1_000_000)
    tasks: list[str] = task_ids() if options.tasks is None else options.tasks
    for task in tasks:
        require_task(task)
    labels = [policies_of(agent)[0] for agent in options.agents]
    if len(set(labels)) < len(labels):
        raise ValueError(f"Two agents are called {max(labels, key=labels.count)}: name them with LABEL=AGENT.")
    return tasks


def require_measures(entries: Sequence[Entry]) -> None:
    """ValueError where results of others name a task that this package has not, or another measure than its own."""
    for task in {entry.task for entry in entries}:
        require_task(task)
        measure = measure_of(env_of(task, **held_out(task)))
        for entry in entries:
            if entry.task == task and (entry.measure, entry.unit, entry.better) != measure[:3]:
                raise ValueError(
                    f"{task} is measured by {measure.name} [{measure.unit}], of which {measure.better} is better, not "
                    f"by {entry.measure} [{entry.unit}]."
                )


class Measured(NamedTuple):
    """Results so far. code: 2 where an agent did not fit, 1 where a job was lost, INTERRUPTED after Ctrl-C, else 0."""

    entries: list[Entry]
    code: int


def benchmark(options: argparse.Namespace) -> Measured:
    """Results of all agents on all tasks, those so far after Ctrl-C; who does not fit is said on the way."""
    pairs = [(task, agent) for task in require_sound(options) for agent in options.agents]
    jobs = [job for task, agent in pairs for job in jobs_of(agent, task, options)]
    waiting = Counter((job.task, job.agent) for job in jobs)
    found: dict[tuple[str, str], list[Answer]] = {pair: [] for pair in pairs}
    entries, code = dict[tuple[str, str], Entry](), 0
    try:
        for answer in answers(jobs, executor_of(options)):
            pair = answer.job.task, answer.job.agent
            found[pair].append(answer)
            if len(found[pair]) < waiting[pair]:
                continue
            try:
                entry = entries[pair] = whole(found[pair])
            except ValueError as unfit:
                print(f"{pair[1]} does not swim {pair[0]}: {unfit}", file=sys.stderr)
                code = max(code, 1 if any(each.is_lost for each in found[pair]) else 2)
                continue
            print(f"{pair[1]}, {pair[0]}: {entry.measure} {entry.estimate()} [{entry.unit}]", flush=True)
    except KeyboardInterrupt:
        code = INTERRUPTED
    return Measured([entries[pair] for pair in pairs if pair in entries], code)


def whole(found: Sequence[Answer]) -> Entry:
    """Entry of jobs. ValueError, with one sentence, where one of them has no result."""
    for answer in found:
        if answer.problem:
            raise ValueError(answer.problem)
    return entry_of(found)


def publish(entries: Sequence[Entry], folder: Path, command: str) -> list[str]:
    """Write results.json, benchmark.md and, where matplotlib is there, profiles.png; returns their names."""
    write(entries, folder / "results.json")
    _, scores = page.common(entries)
    picture = None
    if len(scores) > 1:
        try:
            page.draw(scores, folder / "profiles.png")
            picture = "profiles.png"
        except ModuleNotFoundError:
            print('No picture: that needs matplotlib, pip install "seastar-gym[studies]".')
    write_atomically(folder / "benchmark.md", page.page(entries, command, picture))
    return ["results.json", "benchmark.md", *([] if picture is None else [picture])]


def keep(entries: Sequence[Entry], folder: Path) -> None:
    """Write what an interrupted benchmark has, if anything, and say where. Whole results of another one stay."""
    file = folder / "interrupted.json"
    if entries:
        write(entries, file)
    told = f"what is finished is in {file}, which --merge takes" if entries else "no agent had finished a task"
    print(f"Interrupted: {told}.", file=sys.stderr)


def measure_all(options: argparse.Namespace, command: str) -> int:
    """Measure, merge and publish; returns the exit code."""
    others = [read(file) for file in options.merge]
    require_measures([entry for entries in others for entry in entries])
    own, code = benchmark(options) if options.agents else Measured([], 0)
    entries = merged(*others, own)
    if code == INTERRUPTED:
        keep(entries, options.out)
        return code
    if not entries:
        raise ValueError("There is nothing to show: no agent swam a task.")
    files = publish(entries, options.out, command)
    print(page.table(entries))
    print(f"Written to {options.out}: {', '.join(files)}")
    return code


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    options = parser().parse_args(given)
    return answered(lambda: measure_all(options, shlex.join(["seastar", "benchmark", *given])))
