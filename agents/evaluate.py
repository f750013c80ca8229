"""Comparison of agents on a path: a table, also as CSV, a picture of the traces, a video of each, and a report.

    python -m agents.evaluate                                      the policy in the box and the scripted pentagon
    python -m agents.evaluate --agents learned straight 4+,1- runs/mine/policy.safetensors --path square

From Python, `evaluate({"mine": policy, "script": scripted("pentagon")}, path)` does the same.
"""

import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.text import Text

from agents.report.charts import Curve, read_progress
from agents.report.page import Remarks, ResultsTable, read_bound, read_trials, write_report
from agents.report.playback import Playback, RecordingEnv
from agents.results import results_table
from seastar_gym.command import run_command
from seastar_gym.controllers import learned
from seastar_gym.controllers.contract import Policy, actions_of
from seastar_gym.controllers.roster import DEFAULTS, HELP, fitting_agents
from seastar_gym.envs.options import make_scene, scene_at
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.path_file import PATH_HELP, load_path
from seastar_gym.evaluation.pictures import FRAMES_PER_STROKE, draw_traces, film
from seastar_gym.evaluation.results import COLUMNS, in_words, write_csv
from seastar_gym.evaluation.swim import TIME_LIMIT, Swim, decisions_in, swim
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_number, shown
from seastar_gym.scene.numerics import Fidelity


def evaluate(
    agents: Mapping[str, Policy],
    path: Any = "pentagon",
    *,
    seed: int | None = 0,
    reset_options: dict[str, Any] | None = None,
    max_strokes: int | None = None,
    waypoint_radius: float = 0.01,
    scene: Scene | None = None,
    decision_period: float | None = None,
    out: Path | str | None = None,
    video: bool = True,
    report: Remarks | None = None,
    console: Console | None = None,
    **environment: Any,
) -> list[Swim]:
    """Let every agent swim the path and print the table; returns the swims in the order of the agents.

    agents: Policies by name, see `Policy`.
    path: Name of a path, or waypoints [m], shape (n, 2).
    seed, reset_options: Seed and options of every agent's `reset`.
    max_strokes: Time limit [decisions]; by default that of 400 s. waypoint_radius: Radius of the waypoints [m].
    scene: Robot, actuators, fluid and numerics; by default the chapter's robot in water.
    decision_period: Time between decisions [s]. None means a stroke.
    out: Folder for evaluation.csv, traces.png and, with `video`, an MP4 of every agent; nothing is written if None.
    report: Remarks for report.html, a page with the results and playbacks of the swims; it is not written if None.
    environment: Further arguments of `SeastarSwimEnv`, such as fidelity and random_heading.
    """
    if not agents:
        raise ValueError("There is nothing to evaluate: name at least one agent.")
    max_strokes = decisions_in(TIME_LIMIT, decision_period) if max_strokes is None else max_strokes
    if max_strokes < 1:
        raise ValueError(f"max_strokes must be at least 1, not {shown(max_strokes)}.")
    console = Console() if console is None else console
    folder = None if out is None else Path(out)
    videos = {} if folder is None or not video else _video_files(agents, folder)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    environment |= {
        "path": path, "waypoint_radius": waypoint_radius, "scene": scene, "decision_period": decision_period
    }  # fmt: skip
    episode = {"seed": seed, "reset_options": reset_options, "max_strokes": max_strokes}
    swims, playbacks = [], []
    for name, policy in agents.items():
        with console.status(Text(f"{name} swims")):
            swum, playback = _swim_once(name, policy, environment, episode, videos.get(name), report is not None)
        swims.append(swum)
        if playback is not None:
            playbacks.append(playback)
    console.print(results_table(swims))
    for done in swims:
        if done.solver_message is not None:
            console.print(Text(f"{done.agent}: {done.solver_message}"))
    for name, policy in agents.items():
        swum_in = scene or make_scene(None, None, decision_period)
        if isinstance(policy, learned.LearnedPolicy) and (differences := policy.differences(swum_in)):
            console.print(Text(f"{name}: {differences}"))
    if folder is not None:
        write_csv(swims, folder / "evaluation.csv")
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
    """Swim of an agent, filmed if there is a file for the video, and its playback if `record` asks for one."""
    scene = make_scene(environment["scene"], None, environment["decision_period"])
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
        ResultsTable("Results", COLUMNS, in_words(swims)),
        swims,
        playbacks,
        waypoint_radius,
        baselines if isinstance(path, str) and path == "pentagon" else {},
        remarks,
    )


@dataclass(frozen=True)
class Options:
    """Compare agents on a path: print a table and write it as CSV, with a picture of the traces and a video of each."""

    agents: Annotated[tuple[str, ...] | None, tyro.conf.arg(help=f"{HELP} {DEFAULTS}")] = None
    path: Annotated[str, tyro.conf.arg(help=PATH_HELP)] = "pentagon"
    fidelity: Fidelity = "balanced"
    """Accuracy of the simulation. A scene that names its numerics is swum with those."""
    scene: Path | None = None
    """File of the robot's scene: JSON, or Python that defines `scene`, which is executed; by default the chapter's."""
    out: Path = Path("runs/evaluate")
    """Folder of the results."""
    seed: int = 0
    """Seed of the random path, the random heading and the random agent. All agents get the same path and heading."""
    decision_period: float | None = None
    """Time between decisions [s]; by default a stroke of 1 s. With another, the robot has wires."""
    max_strokes: int | None = None
    """Time limit [decisions]; by default that of 400 s."""
    waypoint_radius: float = 0.01
    """Distance of the hub within which a waypoint is reached [m]."""
    random_heading: bool = False
    """Turn the robot at random at the start; otherwise limb 1 points along +x."""
    video: bool = True
    """Write a video of every agent."""
    report: bool = False
    """Write report.html, one page with all results and with playbacks of the swims."""
    runs: tuple[Path, ...] = ()
    """Folders of trainings whose learning curves the report shows, instead of those of the learned agents."""
    trials: Path | None = None
    """File of results of agents.trials (.csv) that the report shows, too."""
    bound: Path = Path("docs/bound.json")
    """File of results of studies.learning.bound that the report shows, too, if it exists."""

    def __post_init__(self) -> None:
        if self.decision_period is not None:
            require_number("decision_period", self.decision_period, "s")
        if self.max_strokes is not None and self.max_strokes < 1:
            raise ValueError(f"max_strokes must be at least 1, not {self.max_strokes}.")
        require_number("waypoint_radius", self.waypoint_radius, "m")


def _remarks(agents: Mapping[str, Policy], options: Options, arguments: Sequence[str]) -> Remarks:
    """Remarks of the report: how the agents were trained, and how the report was made."""
    trainings = {name: one.training for name, one in agents.items() if isinstance(one, learned.LearnedPolicy)}
    progress = {name: how["progress"] for name, how in trainings.items() if "progress" in how}
    if options.runs:
        progress = {folder.name: read_progress(folder) for folder in options.runs}
    commands = dict.fromkeys(command for how in trainings.values() for command in how.get("commands", ()))
    return Remarks(
        title=f"Evaluation: {options.path}",
        sentences=[
            f'Computed at fidelity "{options.fidelity}".' if options.scene is None else f"Swum in {options.scene}."
        ],
        commands=[*commands, shlex.join(["python", "-m", "agents.evaluate", *arguments])],
        curves=[Curve.of(name, rows) for name, rows in progress.items()],
        tables=[] if options.trials is None else [read_trials(options.trials)],
        bound=read_bound(options.bound) if options.bound.exists() else None,
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    options = tyro.cli(Options, prog="python -m agents.evaluate", args=arguments)
    try:
        path, own = load_path(options.path), scene_at(options.scene, options.fidelity)
        agents, left_out = fitting_agents(options.agents, options.seed, options.fidelity, options.decision_period, own)
        print("".join(f"{sentence}\n" for sentence in left_out), end="", file=sys.stderr)
        remarks = _remarks(agents, options, arguments) if options.report else None
    except (ValueError, OSError) as bad_input:
        print(bad_input, file=sys.stderr)
        return 2
    evaluate(
        agents,
        path,
        seed=options.seed,
        max_strokes=options.max_strokes,
        decision_period=options.decision_period,
        waypoint_radius=options.waypoint_radius,
        out=options.out,
        video=options.video,
        report=remarks,
        scene=own,
        fidelity=options.fidelity if own is None else None,
        random_heading=options.random_heading,
    )
    return 0


if __name__ == "__main__":
    run_command(main)
