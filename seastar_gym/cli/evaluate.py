"""Compares agents on a path: a table and, with --out, evaluation.csv and a picture of the traces.

--video writes a film of every agent into that folder, --report a page with all results and with playbacks of the swims.

With --sets, agents swim many paths, nominal and disturbed: a table of means with confidence intervals and, with --out,
a CSV file of them.

With --task, agents swim held-out episodes of registered tasks, one for each seed: a table of mean scores with
confidence intervals and, with --out, a file of them, .csv, or .json with every episode. LABEL=A,B,C is one agent whose
seeds are swum by policies A, B, C in turn, as by ten trainings.

With --benchmark, LABEL=A,B,C are trainings of one learner, each of which swims the 64 test episodes of the six ids of
docs/benchmark.md, or those that --task names; --decisions is the length of the trainings. --out is a folder for the
table as CSV, Markdown, LaTeX and JSON, to which another call adds. --merge adds the results of such files.

On paths, the first policy of a file brings the robot that it was trained on, and how often it decides, where options
name none; --fidelity gives it another mesh and other numerics. On one path, a named agent that does not fit the robot
is left out with a sentence, and the exit code is 2.
"""

import argparse
import itertools
import math
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, get_args

from seastar_gym.command import DEFAULT, answered, command_parser
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import LearnedPolicy, load
from seastar_gym.controllers.registry import (
    DEFAULTS,
    HELP,
    default_agents,
    fitting_agents,
    is_file,
    learned_policy,
    load_agents,
)
from seastar_gym.envs.commands import decisions_in
from seastar_gym.envs.options import FIDELITY_HELP, make_scene, own_scene, scene_at
from seastar_gym.envs.paths import PATH_HELP, WAYPOINT_RADIUS, load_path
from seastar_gym.evaluation import benchmark, scores
from seastar_gym.evaluation.benchmark import Cell
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.evaluation.results import Row, write_csv
from seastar_gym.evaluation.rollout import require_task, task_ids
from seastar_gym.evaluation.scores import Scores, measured, policies_of
from seastar_gym.evaluation.swim import TIME_LIMIT
from seastar_gym.evaluation.trials import SETS, as_text, trials
from seastar_gym.files import read_json, require_extra, require_place, require_writable
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_count, require_number, require_period
from seastar_gym.scene.numerics import Fidelity

if TYPE_CHECKING:
    from seastar_gym.evaluation.report import Remarks

OF_TRIALS, OF_TASKS = ("learned", "greedy", "pentagon"), ("learned", "greedy", "random")
"""Agents of trials and of tasks unless others are named."""


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    flag = argparse.BooleanOptionalAction
    found = command_parser("seastar evaluate", __doc__)
    found.add_argument(
        "--agents", nargs="+", action="extend",
        help=f"{HELP} {DEFAULTS}; others with --sets or --task",
    )  # fmt: skip
    found.add_argument("--path", default="pentagon", help=f"{PATH_HELP} {DEFAULT}")
    found.add_argument(
        "--fidelity", nargs="+", action="extend", choices=get_args(Fidelity),
        help=f"{FIDELITY_HELP}, several with --sets (default: the scene's or task's own, otherwise balanced)",
    )  # fmt: skip
    found.add_argument(
        "--scene", type=Path, help="file of the robot's scene, .py or .json (default: a policy's, or the chapter's)"
    )
    found.add_argument(
        "--decision-period", type=float, help="time between decisions [s] (default: a policy's, or a stroke of 1 s)"
    )
    found.add_argument("--seconds", type=float, default=TIME_LIMIT, help=f"time limit [s] {DEFAULT}")
    radius = f"radius of the waypoints [m] {DEFAULT}"
    found.add_argument("--waypoint-radius", type=float, default=WAYPOINT_RADIUS, help=radius)
    found.add_argument("--random-heading", action=flag, default=False, help="turn the robot at random at the start")
    found.add_argument("--seed", type=int, default=0, help=f"seed of what is drawn at random {DEFAULT}")
    found.add_argument(
        "--out", type=Path, help="folder for evaluation.csv and traces.png; with --sets or --task a file"
    )
    found.add_argument("--video", action=flag, default=False, help="write a video of every agent")
    found.add_argument("--report", action=flag, default=False, help="write report.html, one page with all of it")
    found.add_argument(
        "--trajectory", action=flag, default=False, help="write trajectories.csv: time, hub and heat of every stroke"
    )
    report = found.add_argument_group("what the report shows, too")
    report.add_argument(
        "--runs", nargs="+", action="extend", type=Path, default=[],
        help="folders of trainings (default: those of learned agents)",
    )  # fmt: skip
    report.add_argument("--trials", type=Path, help="CSV file that --sets wrote")
    many = found.add_argument_group("many swims")
    many.add_argument(
        "--sets", nargs="+", action="extend", choices=SETS,
        help="named paths; random paths or the pentagon, disturbed",
    )  # fmt: skip
    many.add_argument("--swims", type=int, default=1000, help=f"number of random paths of every set {DEFAULT}")
    tasks = found.add_argument_group("registered tasks")
    tasks.add_argument(
        "--task", nargs="+", action="extend", metavar="ID", help="ids, module:id for one of your own, or all"
    )
    tasks.add_argument("--seeds", type=int, default=10, help=f"number of held-out episodes {DEFAULT}")
    tasks.add_argument("--decisions", type=int, help="time limit [decisions] (default: that of the task); with "
                       f"--benchmark length of the trainings (default: {benchmark.BUDGETS[0]})")  # fmt: skip
    tasks.add_argument("--benchmark", nargs="?", const="test", choices=tuple(benchmark.FIRST),
                       help="the protocol of docs/benchmark.md; check: on its other 64 episodes")  # fmt: skip
    tasks.add_argument(
        "--merge", nargs="+", action="extend", type=Path, default=[],
        help="results of --benchmark to show as well, files or folders",
    )  # fmt: skip
    many.add_argument("--num-threads", type=int, help="threads of the simulator (default: one for every processor)")
    return found


def require_sound(options: argparse.Namespace) -> None:
    """ValueError, with one sentence, where something in the options is wrong."""
    require_number("--seconds", options.seconds, "s")
    require_number("--waypoint-radius", options.waypoint_radius, "m")
    require_count("--swims", options.swims, 1, 1_000_000)
    require_period(options.decision_period, "--decision-period")
    if options.sets is None and len(options.fidelity or ()) > 1:
        raise ValueError("Several fidelities are for --sets: name one.")
    if (options.video or options.report or options.trajectory) and options.out is None:
        raise ValueError("A video, a report or a trajectory needs a folder, --out.")
    if (options.runs or options.trials is not None) and not options.report:
        raise ValueError("--runs and --trials are what a report shows: name --report, too, or leave them out.")


def fidelities(options: argparse.Namespace) -> list[Fidelity]:
    """Accuracies of swims on paths."""
    return options.fidelity or ["balanced"]


def robot_of(options: argparse.Namespace, fidelity: Fidelity | None) -> tuple[Scene | None, float | None]:
    """Scene, None for the chapter's, and time between decisions, None for a stroke: of the options, and where they name
    none of the first policy of a file. fidelity: Which was typed."""
    scene, period = own_scene(options.scene), options.decision_period
    for name in filter(is_file, options.agents or ()):
        try:
            policy = learned_policy(name)
        except (ValueError, OSError):
            continue  # it is left out with that sentence later
        if policy is not None:
            stroke = math.isclose(policy.decision_period, policy.scene.actuator.period)
            period = policy.decision_period if period is None and not stroke else period
            if scene is None and policy.differences(make_scene(None, None, period)):
                scene = policy.scene
            break
    return scene_at(scene, fidelity, "balanced"), period


def require_folder(out: Path | None) -> None:
    """ValueError for a name of a file where several files are written."""
    if out is not None and out.suffix in (*benchmark.FORMS, ".gif", ".html", ".mp4", ".png"):
        raise ValueError(f"Several files are written: --out is a folder for them, not {out.name}.")


def compared(options: argparse.Namespace, command: str) -> int:
    """Let the agents swim the path; returns the exit code, 2 where one that was named does not fit, or failed.

    command: What was typed.
    """
    require_sound(options)
    require_folder(options.out)
    fidelity = fidelities(options)[0]
    own, options.decision_period = robot_of(options, options.fidelity and fidelity)
    path = load_path(options.path)  # now: a scene's file may register it
    agents, left_out = fitting_agents(options.agents, options.seed, fidelity, options.decision_period, own)
    print("".join(f"{sentence}\n" for sentence in left_out), end="", file=sys.stderr)
    limit = decisions_in(options.seconds, options.decision_period, own)
    swims = evaluate(
        agents, path, seed=options.seed, max_strokes=limit, waypoint_radius=options.waypoint_radius, scene=own,
        decision_period=options.decision_period, out=options.out, video=options.video, trajectory=options.trajectory,
        report=remarks(agents, options, command, own) if options.report else None,
        fidelity=fidelity if own is None else None, random_heading=options.random_heading,
    )  # fmt: skip
    return 2 if (left_out and options.agents) or len(swims) < len(agents) else 0


def remarks(agents: Mapping[str, Policy], options: argparse.Namespace, command: str, own: Scene | None) -> "Remarks":
    """Remarks of the report: how the agents were trained, and how it was made. own: Robot that is not the chapter's."""
    require_extra("Reports", "report", "plotly")
    from seastar_gym.evaluation.report import Curve, Remarks, read_progress, trials_table

    trainings = {name: one.training for name, one in agents.items() if isinstance(one, LearnedPolicy)}
    curves = [
        Curve.of(name, how["progress"], agents[name].decision_period)  # type: ignore[attr-defined]
        for name, how in trainings.items() if "progress" in how
    ]  # fmt: skip
    if options.runs:
        named = [folder.name for folder in options.runs]
        curves = [
            Curve.of(str(run) if named.count(run.name) > 1 else run.name, read_progress(run), period_of(run))
            for run in dict.fromkeys(options.runs)
        ]
    commands = dict.fromkeys(command for how in trainings.values() for command in how.get("commands", ()))
    swum = f'Computed at fidelity "{fidelities(options)[0]}".'
    if own is not None:
        swum = f"Swum in {options.scene or 'the scene of the first policy'}, with {own.numerics}."
    return Remarks(
        title=f"Evaluation: {options.path}",
        sentences=[swum],
        commands=[*commands, command],
        curves=curves,
        tables=[] if options.trials is None else [trials_table(options.trials)],
    )


def period_of(folder: Path) -> float:
    """Time between decisions [s] of the training in a folder; a second where neither of its files says one."""
    if (policy := folder / "policy.safetensors").is_file():
        return load(policy).decision_period
    config = folder / "config.json"
    try:
        return float(read_json(config)["options"]["ppo"]["decision_period"] or 1.0)
    except (OSError, KeyError, TypeError, ValueError):
        return 1.0


def swum_often(options: argparse.Namespace) -> int:
    """Let the agents swim the sets; returns the exit code, 2 where one failed."""
    require_sound(options)
    require_place(options.out)
    rows, differences, failed = list[Row](), dict[str, str](), list[str]()
    for typed in options.fidelity or [None]:
        fidelity: Fidelity = typed or "balanced"
        own, period = robot_of(options, typed)
        robot = own or make_scene(None, fidelity, period)
        names = options.agents or (OF_TRIALS if own is None else default_agents(own))
        agents = load_agents(names, options.seed, fidelity, period, own)
        try:
            rows += trials(
                agents, options.sets, options.swims, fidelity=fidelity, seed=options.seed, decision_period=period,
                threads=options.num_threads, max_strokes=decisions_in(options.seconds, period, own), scene=own,
                say=failed.append,
            )  # fmt: skip
        except ValueError:
            if not (failed and rows):
                raise
        if options.out is not None:
            write_csv(rows, options.out)  # now: the next fidelity may take hours
        learned = {name: one for name, one in agents.items() if isinstance(one, LearnedPolicy)}
        differences |= {name: found for name, one in learned.items() if (found := one.differences(robot))}
    print(as_text(rows, period))
    print("".join(f"{name}: {found}\n" for name, found in differences.items()), end="")
    print("".join(f"{sentence}\n" for sentence in failed), end="", file=sys.stderr)
    return 2 if failed else 0


def labelled(agents: Sequence[str]) -> dict[str, list[str]]:
    """Names of the policies of agents by their labels. ValueError where two have the same one."""
    found = dict[str, list[str]]()
    for label, names in map(policies_of, agents):
        if label in found:
            raise ValueError(f"Two agents are called {label}: name them with LABEL=AGENT.")
        found[label] = names
    return found


def measured_on_tasks(options: argparse.Namespace) -> int:
    """Let the agents swim held-out episodes of tasks; returns the exit code, 2 where one did not fit."""
    require_sound(options)
    require_count("--seeds", options.seeds, 1, 10_000)
    if options.decisions is not None:
        require_count("--decisions", options.decisions, 1, 1_000_000)
    agents, tasks = options.agents or OF_TASKS, task_ids() if options.task == ["all"] else options.task
    labelled(agents)
    for task in tasks:
        require_task(task)
    require_place(options.out)
    found, fidelity = list[Scores](), (options.fidelity or [None])[0]
    for task, agent in itertools.product(tasks, agents):
        try:
            found.append(measured(task, agent, options.seeds, fidelity=fidelity, max_decisions=options.decisions,
                                  threads=options.num_threads))  # fmt: skip
        except (ValueError, FileNotFoundError) as unfit:
            print(f"{agent} does not swim {task}: {unfit}", file=sys.stderr)
            continue
        if options.out is not None:
            scores.write(found, options.out)  # now: tasks may take an hour each
    if found:
        print(scores.as_text(found))
    return 0 if len(found) == len(tasks) * len(agents) else 2


def measured_on_benchmark(options: argparse.Namespace) -> int:
    """Let the agents swim the benchmark; returns the exit code, 2 where one did not fit."""
    ids = list(benchmark.ENTRIES) if options.task in (None, ["all"]) else options.task
    benchmark.require_ids(ids)
    agents, first, left_out = labelled(options.agents or ()), benchmark.FIRST[options.benchmark or "test"], 0
    decisions = benchmark.BUDGETS[0] if options.decisions is None else options.decisions
    require_count("--decisions", decisions, 1, 10**9)
    if options.decisions is not None and not agents:
        raise ValueError("--decisions says how long --agents have learned: name them, or leave it out.")
    known = known_cells(options.merge, ids, options.out)
    if agents and options.decisions is None:
        print(f"Trainings of --agents count as of {decisions:,} decisions: --decisions says another length.")
    for id, (label, names) in itertools.product(ids, agents.items()):
        try:
            found = benchmark.measured(id, label, names, first, options.num_threads, decisions)
        except (ValueError, FileNotFoundError) as unfit:
            print(f"{label} does not swim {id}: {unfit}", file=sys.stderr)
            left_out += 1
            continue
        known.setdefault(f"--agents {label}", []).extend(found)
        if options.out is not None:
            benchmark.write_all(benchmark.merged(known), options.out)
    cells = benchmark.merged(known)
    shown = [cell for cell in cells if cell.id in ids and (options.benchmark != "check" or cell.first == first)]
    if not shown:
        raise ValueError("There is nothing to show: name --agents that fit, or files to --merge.")
    if options.out is not None:
        benchmark.write_all(cells, options.out)
    print(benchmark.tables(shown))
    return 2 if left_out else 0


def known_cells(files: Sequence[Path], ids: Sequence[str], out: Path | None) -> dict[str, list[Cell]]:
    """Cells of ids in files, and all that a folder of results has, by file; the folder is made, and can be written to.

    ValueError where they do not merge.
    """
    require_folder(out)
    files = [file / benchmark.RESULTS if file.is_dir() else file for file in files]
    parts = {str(file): [cell for cell in benchmark.cells_in(file) if cell.id in ids] for file in files}
    if out is not None:
        require_writable(out)
        if (kept := out / benchmark.RESULTS).exists():
            parts[str(kept)] = benchmark.cells_in(kept)
    benchmark.merged(parts)
    for source, own in parts.items():
        benchmark.require_current(own, source)
    return parts


class Mode(NamedTuple):
    """What the command does. why: Sentence for options that it does not heed. heeds: Names of those that it does."""

    why: str
    heeds: str
    run: Callable[[argparse.Namespace, str], int]


PATH = Mode(
    "One path is swum once",
    "agents path fidelity scene decision_period seconds waypoint_radius random_heading seed out video report "
    "trajectory runs trials",
    compared,
)
MODES = {
    "merge": (BENCHMARK := Mode(
        "The benchmark says how it is swum", "agents benchmark task merge out decisions num_threads",
        lambda options, _: measured_on_benchmark(options),
    )),
    "benchmark": BENCHMARK,
    "task": Mode(
        "A task has its own robot, paths and decisions", "agents task fidelity seeds decisions num_threads out",
        lambda options, _: measured_on_tasks(options),
    ),
    "sets": Mode(
        "Sets are paths with a radius and headings of their own",
        "agents sets swims fidelity scene decision_period seconds seed num_threads out",
        lambda options, _: swum_often(options),
    ),
}  # fmt: skip
"""Modes by the option that asks for them, the first counts; `PATH` without any."""


def require_heeded(mode: Mode, given: Sequence[str]) -> None:
    """ValueError, with one sentence, where an option was typed that a mode would not heed."""
    own, untyped = parser(), list[str]()  # as options that are given several times are extended
    own.set_defaults(**dict.fromkeys(vars(own.parse_args([])), untyped))
    typed = {name for name, value in vars(own.parse_args(given)).items() if value is not untyped}
    if others := sorted(typed.difference(mode.heeds.split())):
        raise ValueError(f"{mode.why}: leave out --{others[0].replace('_', '-')}.")


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    options = parser().parse_args(given)
    mode = next((mode for name, mode in MODES.items() if getattr(options, name) not in (None, [])), PATH)

    def answer() -> int:
        require_heeded(mode, given)
        return mode.run(options, shlex.join(["seastar", "evaluate", *given]))

    return answered(answer, options)
