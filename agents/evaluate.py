"""Runs any set of agents on any path: one table, the same as CSV, a picture of their traces, a video of each.

    python -m agents.evaluate                                      the policy in the box and the scripted pentagon
    python -m agents.evaluate --agents learned straight 4+,1- runs/mine/policy.safetensors --path square

From Python, `evaluate({"mine": policy, "script": scripted("pentagon")}, path)` does the same.
"""

import csv
import json
import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from agents import policy as learned
from agents.report.charts import Curve, read_progress
from agents.report.page import Remarks, ResultsTable, number, read_trials, write_report
from agents.report.pictures import FRAMES_PER_STROKE, draw_traces, film
from agents.report.playback import Playback, RecordingEnv
from agents.roster import load_agents
from agents.swim import Policy, Swim, actions_of, require_fit, swim
from seastar_gym.command import run_command
from seastar_gym.envs.paths import PATHS, make_path
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.task import make_scene
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_number
from seastar_gym.scene.csv_rows import read_numbers
from seastar_gym.scene.numerics import Fidelity

MM = 1000.0


def evaluate(
    agents: Mapping[str, Policy],
    path: Any = "pentagon",
    *,
    seed: int | None = 0,
    reset_options: dict[str, Any] | None = None,
    max_strokes: int = 400,
    waypoint_radius: float = 0.01,
    scene: Scene | None = None,
    out: Path | str | None = None,
    video: bool = True,
    report: Remarks | None = None,
    console: Console | None = None,
    **environment: Any,
) -> list[Swim]:
    """Let every agent swim the path, print the table, and return the swims in the order of the agents.

    agents: Policies by name; see `Policy` for what they must be able to do.
    path: A name, or waypoints [m], shape (n, 2). seed, reset_options: Of every agent's `reset`.
    max_strokes: Time limit [strokes]. waypoint_radius: [m].
    scene: What is modelled; the chapter's robot in water if None.
    out: Folder for evaluation.csv, traces.png and, with `video`, an MP4 of every agent; nothing is written if None.
    report: Write report.html there too, a page with all of it, playbacks of the swims and these remarks.
    environment: Further arguments of `SeastarSwimEnv`: fidelity, random_heading, ...
    """
    if not agents:
        raise ValueError("There is nothing to evaluate: name at least one agent.")
    if max_strokes < 1:
        raise ValueError(f"max_strokes must be at least 1, not {max_strokes!r}.")
    console = Console() if console is None else console
    folder = None if out is None else Path(out)
    videos = {} if folder is None or not video else _video_files(agents, folder)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    environment |= {"path": path, "waypoint_radius": waypoint_radius, "scene": scene}
    episode = {"seed": seed, "reset_options": reset_options, "max_strokes": max_strokes}
    swims, playbacks = [], []
    for name, policy in agents.items():
        with console.status(Text(f"{name} swims")):
            swum, playback = _swim_once(name, policy, environment, episode, videos.get(name), report is not None)
        swims.append(swum)
        if playback is not None:
            playbacks.append(playback)
    console.print(_table(swims))
    for done in swims:
        if done.solver_message is not None:
            console.print(Text(f"{done.agent}: {done.solver_message}"))
    for name, policy in agents.items():
        if isinstance(policy, learned.LearnedPolicy) and (differences := policy.differences(scene or Scene())):
            console.print(Text(f"{name}: {differences}"))
    if folder is not None:
        _write_csv(swims, folder / "evaluation.csv")
        draw_traces(swims, waypoint_radius, folder / "traces.png")
        files = ["evaluation.csv", "traces.png", *(file.name for file in videos.values())]
        if report is not None:
            _write_report(swims, playbacks, path, waypoint_radius, report, folder / "report.html")
            files.append("report.html")
        console.print(Text(f"Written to {folder}: {', '.join(files)}"), soft_wrap=True)
    return swims


def _swim_once(
    name: str, policy: Policy, environment: dict[str, Any], episode: dict[str, Any], video: Path | None, record: bool
) -> tuple[Swim, Playback | None]:
    """The swim; filmed if there is a file for the video, with a playback if it is to be recorded."""
    scene = make_scene(environment["scene"], None)
    environment = {"actions": actions_of(policy, scene.robot.n_limbs), **environment}
    if video is None and not record:
        return swim(name, policy, SeastarSwimEnv(**environment), **episode), None
    env = RecordingEnv(film=video is not None, frames_per_stroke=FRAMES_PER_STROKE, **environment)
    with film(video) if video is not None else nullcontext() as watch:
        swum = swim(name, policy, env, **episode, watch=watch)
    env.close()
    return swum, env.playback(name)


def _video_files(agents: Mapping[str, Policy], folder: Path) -> dict[str, Path]:
    files = {name: folder / (re.sub(r"[^\w.,+-]+", "_", name) + ".mp4") for name in agents}
    if len(set(files.values())) < len(files):
        raise ValueError("The names of two agents make the same file name: give them names that differ in more.")
    return files


# --- the table -------------------------------------------------------------------------------------------------------

COLUMNS = {
    "agent": "agent",
    "strokes_to_finish": "strokes\nto\nfinish",
    "simulated_time_s": "simulated\ntime\n[s]",
    "waypoints_reached": "waypoints\nreached",
    "mean_cross_track_error_mm": "mean\ncross-track\nerror [mm]",
    "largest_cross_track_error_mm": "largest\ncross-track\nerror [mm]",
    "limbs_heated_per_metre": "limbs\nheated per\nmetre [1/m]",
}
"""Columns of the table: their names in the CSV, their titles in print."""


def results(swims: Sequence[Swim]) -> list[dict[str, str | int | float | None]]:
    """The table's numbers by the CSV's names; None where there is no number, as for who did not finish."""
    return [
        {
            "agent": done.agent,
            "strokes_to_finish": done.strokes if done.finished else None,
            "simulated_time_s": float(done.time[-1]),
            "waypoints_reached": done.waypoints_reached,
            "waypoints": len(done.waypoints),
            "mean_cross_track_error_mm": MM * float(done.cross_track_errors.mean()),
            "largest_cross_track_error_mm": MM * float(done.cross_track_errors.max()),
            "limbs_heated_per_metre": done.heated_per_metre,
        }
        for done in swims
    ]


def _table(swims: Sequence[Swim]) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False, pad_edge=False)
    for name, title in COLUMNS.items():
        if name == "agent":
            table.add_column(title, vertical="bottom", overflow="fold")
        else:
            table.add_column(Text(title), justify="right", no_wrap=True)
    for row in _shown(swims):
        table.add_row(*(Text(number(row[name])) for name in COLUMNS))
    return table


def _shown(swims: Sequence[Swim]) -> list[dict[str, str | int | float | None]]:
    """The results with the waypoints in words."""
    return [{**row, "waypoints_reached": f"{row['waypoints_reached']} of {row['waypoints']}"} for row in results(swims)]


def _write_csv(swims: Sequence[Swim], file: Path) -> None:
    rows = results(swims)
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _write_report(
    swims: Sequence[Swim],
    playbacks: Sequence[Playback],
    path: Any,
    waypoint_radius: float,
    remarks: Remarks,
    file: Path,
) -> None:
    finished = {done.agent: done.strokes for done in swims if done.finished}
    curves = {curve.name for curve in remarks.curves}
    baselines = {agent: strokes for agent, strokes in finished.items() if agent not in curves}
    write_report(
        file,
        ResultsTable("Results", COLUMNS, _shown(swims)),
        swims,
        playbacks,
        waypoint_radius,
        baselines if isinstance(path, str) and path == "pentagon" else {},
        remarks,
    )


# --- the command line ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Options:
    """Compare agents on a path: a table, the same as CSV, a picture of their traces, and a video of each."""

    agents: tuple[str, ...] = ("learned", "pentagon")
    """The policy in the box (learned), greedy, planner, scripted agents (pentagon, straight, rest, random, or a pair
    such as 4+,1-), files of policies (.safetensors, or a training's model.zip), a model.zip of plain
    Stable-Baselines3, and module:function, which gets an environment and returns anything with predict. The last two
    execute the code of whoever made them, because Stable-Baselines3 unpickles: load only files that you trust."""
    path: str = "pentagon"
    """pentagon, square, triangle, line, figure-eight, random, or a text file with x, y [m] of one waypoint per line."""
    fidelity: Fidelity = "balanced"
    """How exactly the swims are computed."""
    out: Path = Path("runs/evaluate")
    """Folder of the results."""
    seed: int = 0
    """Of a random path, a random heading and the random agent; every agent gets the same path and heading."""
    max_strokes: int = 400
    """Time limit [strokes]."""
    waypoint_radius: float = 0.01
    """A waypoint is reached within this distance [m]."""
    random_heading: bool = False
    """Turn the robot at random at the start; otherwise limb 1 points along +x."""
    video: bool = True
    """Film every agent."""
    report: bool = False
    """Write report.html: all of it on one page, with playbacks of the swims."""
    runs: tuple[Path, ...] = ()
    """Folders of trainings, of several seeds for instance: their learning curves, not those of the learned agents, are
    in the report."""
    trials: Path | None = None
    """What agents.trials wrote (.csv), for the report to show too."""
    bound: Path = Path("docs/bound.json")
    """What studies.learning.bound wrote, for the report to show too, where there is such a file."""

    def __post_init__(self) -> None:
        if self.max_strokes < 1:
            raise ValueError(f"max_strokes must be at least 1, not {self.max_strokes}.")
        require_number("waypoint_radius", self.waypoint_radius, "m")


def _load_path(name: str) -> Any:
    """The name of a path, or the waypoints [m] of a text file."""
    if name in PATHS or not Path(name).is_file():
        make_path(name, np.random.default_rng(0))
        return name
    waypoints = read_numbers(name, "x and y [m] of a waypoint", 2)
    try:
        return make_path(waypoints, np.random.default_rng(0))
    except ValueError as bad:
        raise ValueError(f"{name}: {bad}") from bad


def _remarks(agents: Mapping[str, Policy], options: Options, arguments: Sequence[str]) -> Remarks:
    """What the report says about the agents, and how it was made."""
    trainings = {name: one.training for name, one in agents.items() if isinstance(one, learned.LearnedPolicy)}
    progress = {name: how["progress"] for name, how in trainings.items() if "progress" in how}
    if options.runs:
        progress = {folder.name: read_progress(folder) for folder in options.runs}
    commands = dict.fromkeys(command for how in trainings.values() for command in how.get("commands", ()))
    return Remarks(
        title=f"Evaluation: {options.path}",
        sentences=[f'Computed at fidelity "{options.fidelity}".'],
        commands=[*commands, shlex.join(["python", "-m", "agents.evaluate", *arguments])],
        curves=[Curve.of(name, rows) for name, rows in progress.items()],
        tables=[] if options.trials is None else [read_trials(options.trials)],
        bound=json.loads(options.bound.read_text(encoding="utf-8")) if options.bound.is_file() else None,
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    options = tyro.cli(Options, args=arguments)
    try:
        agents, path = load_agents(options.agents, options.seed, options.fidelity), _load_path(options.path)
        for agent in agents.values():
            require_fit(agent, Scene(), actions_of(agent, Scene().robot.n_limbs))
        remarks = _remarks(agents, options, arguments) if options.report else None
    except (ValueError, OSError) as bad_input:
        print(bad_input, file=sys.stderr)
        return 2
    evaluate(
        agents,
        path,
        seed=options.seed,
        max_strokes=options.max_strokes,
        waypoint_radius=options.waypoint_radius,
        out=options.out,
        video=options.video,
        report=remarks,
        fidelity=options.fidelity,
        random_heading=options.random_heading,
    )
    return 0


if __name__ == "__main__":
    run_command(main)
