"""Comparison of agents on a path: a table, also as CSV, a picture of the traces, a video of each, and a report."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seastar_gym.controllers.contract import Policy, actions_of
from seastar_gym.controllers.learned import LearnedPolicy, camera_of
from seastar_gym.envs.commands import decisions_in
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.seastar_swim import OneRobotEnv, SeastarSwimEnv
from seastar_gym.evaluation.films import film
from seastar_gym.evaluation.pictures import FPS, FRAMES_PER_STROKE, draw_traces
from seastar_gym.evaluation.playback import Playback, RecordingEnv
from seastar_gym.evaluation.results import as_text, results, time_series, write_csv
from seastar_gym.evaluation.rollout import MOST_DECISIONS
from seastar_gym.evaluation.swim import TIME_LIMIT, Swim, swim
from seastar_gym.files import require_extra, require_place, write_atomically
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_count, require_kind
from seastar_gym.scene.serial import read
from seastar_gym.scene.water import AnyCurrent

if TYPE_CHECKING:
    from seastar_gym.evaluation.report import Remarks


def evaluate(
    agents: Mapping[str, Policy],
    path: Any = "pentagon",
    *,
    seed: int | None = 0,
    reset_options: dict[str, Any] | None = None,
    max_strokes: int | None = None,
    waypoint_radius: float = WAYPOINT_RADIUS,
    scene: Scene | None = None,
    decision_period: float | None = None,
    out: Path | str | None = None,
    video: bool = True,
    report: Remarks | None = None,
    trajectory: bool = False,
    say: Callable[[str], None] = print,
    filmed: Mapping[str, Callable[[], Path | None]] | None = None,
    **environment: Any,
) -> list[Swim]:
    """Let every agent swim the path and print the table; returns the swims in the order of the agents.

    One of several that fails is left out with a sentence. ValueError, with that sentence, where none is left.

    agents: Policies by name, see `Policy`. Those that were trained for a camera swim as it sees them.
    path: Name of a path, or waypoints [m], shape (n, 2).
    seed, reset_options: Seed and options of every agent's `reset`.
    max_strokes: Time limit [decisions]; by default that of 400 s. waypoint_radius: Radius of the waypoints [m].
    scene: Robot, actuators, fluid and numerics; by default the chapter's robot in water.
    decision_period: Time between decisions [s]. None means a stroke.
    out: Folder for evaluation.csv, traces.png and, with `video`, an MP4 of every agent; nothing is written if None.
    report: Remarks for report.html, a page with the results and playbacks of the swims; it is not written if None.
    trajectory: Whether trajectories.csv is written, with a row for every stroke of every swim.
    say: Function that prints a text.
    filmed: Functions by agent that return the file of a film of its swim, made meanwhile by somebody else. None from
        one of them means that there is none.
    environment: Further arguments of `SeastarSwimEnv`, such as fidelity and random_heading.
    """
    if not agents:
        raise ValueError("There is nothing to evaluate: name at least one agent.")
    if scene is not None:
        scene = read(scene, Scene)
        require_kind("scene", scene, Scene, "a Scene")
    max_strokes = decisions_in(TIME_LIMIT, decision_period, scene) if max_strokes is None else max_strokes
    require_count("max_strokes", max_strokes, 1, MOST_DECISIONS)
    folder = None if out is None else Path(out)
    videos = {} if folder is None or not video else _video_files(agents, folder)
    if folder is not None:
        require_extra("Pictures", "studies", "matplotlib")
        for name in ("evaluation.csv", "traces.png", "trajectories.csv", "report.html"):
            require_place(folder / name)
    environment |= {
        "path": path, "waypoint_radius": waypoint_radius, "scene": scene, "decision_period": decision_period
    }  # fmt: skip
    episode = {"seed": seed, "reset_options": reset_options, "max_strokes": max_strokes}
    found, failures = dict[str, tuple[Swim, Playback | None]](), list[ValueError]()
    for name, policy in agents.items():
        film_file = _without_film(videos.get(name), (filmed or {}).get(name))
        try:
            found[name] = _swim_once(name, policy, environment, episode, film_file, report is not None)
        except ValueError as wrong:
            failures.append(wrong)
    if failures and not found:
        raise failures[0]
    swims = [swum for swum, _ in found.values()]
    videos = {name: file for name, file in videos.items() if name in found}
    swum_in = scene or make_scene(None, None, decision_period)
    _tell(swims, agents, swum_in, say)
    for failed in failures:
        say(str(failed))
    if folder is not None:
        fluid = swum_in.of_robot(0).fluid
        current = None if fluid is None else fluid.current
        files = _write(folder, swims, waypoint_radius, current, trajectory)
        files += [file.name for file in videos.values()]
        if report is not None:
            from seastar_gym.evaluation.report import write_report

            films = {name: file.name for name, file in videos.items()}
            playbacks = [playback for _, playback in found.values() if playback is not None]
            write_report(
                folder / "report.html", path, swims, playbacks, waypoint_radius, report, current=current, films=films
            )
            files.append("report.html")
        say(f"Written to {folder}: {', '.join(files)}")
    return swims


def _tell(swims: list[Swim], agents: Mapping[str, Policy], scene: Scene, say: Callable[[str], None]) -> None:
    """Say how the agents swam, and why a solver gave up or how a policy's robot differs."""
    say(as_text(swims))
    for done in swims:
        policy = agents[done.agent]
        differences = policy.differences(scene) if isinstance(policy, LearnedPolicy) else None
        for remark in filter(None, (done.solver_message, differences)):
            say(f"{done.agent}: {remark}")


def _write(
    folder: Path, swims: list[Swim], waypoint_radius: float, current: AnyCurrent | None, trajectory: bool
) -> list[str]:
    """Write tables and traces into a folder; returns the files' names."""
    write_csv(results(swims), folder / "evaluation.csv")
    draw_traces(swims, waypoint_radius, folder / "traces.png", current)
    if trajectory:
        write_csv(time_series(swims), folder / "trajectories.csv")
    return ["evaluation.csv", "traces.png", *["trajectories.csv"] * trajectory]


def _swim_once(
    name: str, policy: Policy, environment: dict[str, Any], episode: dict[str, Any], video: Path | None, record: bool
) -> tuple[Swim, Playback | None]:
    """Swim of an agent, filmed if there is a file for the video, and its playback if `record` asks for one."""
    scene = make_scene(environment["scene"], None, environment["decision_period"])
    environment = {**camera_of(policy), "actions": actions_of(policy, scene.robot.n_limbs), **environment}

    def swum_by(env: OneRobotEnv, **more: Any) -> Swim:
        try:
            return swim(name, policy, env, **episode, **more)
        except ValueError as unfit:
            raise ValueError(f"{name}: {unfit}") from unfit

    if video is None and not record:
        return swum_by(SeastarSwimEnv(**environment)), None
    env = RecordingEnv(film=video is not None, frames_per_stroke=FRAMES_PER_STROKE, **environment)
    every, numbers = max(1, round(1.0 / env.decision_period)), itertools.count()
    fps = FPS / (every * env.decision_period)
    with film(video, fps) if video is not None else nullcontext(lambda picture: None) as add:

        def watch(env: OneRobotEnv) -> None:
            for picture in env.render() or ():
                if next(numbers) % every == 0:
                    add(picture)

        swum = swum_by(env, watch=watch)
    env.close()
    return swum, env.playback(name)


def _without_film(video: Path | None, filmed: Callable[[], Path | None] | None) -> Path | None:
    """File of a video that is still to be made, None for none: what is filmed already is copied there."""
    made = None if video is None or filmed is None else filmed()
    if video is None or made is None:
        return video
    write_atomically(video, made.read_bytes())
    return None


def _video_files(agents: Mapping[str, Policy], folder: Path) -> dict[str, Path]:
    files = {name: folder / (re.sub(r"[^\w.,+-]+", "_", name) + ".mp4") for name in agents}
    if len(set(files.values())) < len(files):
        raise ValueError("The names of two agents make the same file name: give them names that differ in more.")
    return files
