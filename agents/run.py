"""Folder of a training run: config.json, model.zip with its checkpoints, progress.csv and the trained policy.

Watch over a training: progress bar, logs, checkpoints, and an orderly stop.

Sample efficiency of a training: strokes and seconds until the policy rounds the pentagon in 170 s.

The robot of a run: the chapter's, or that of a file, with numbers that may be drawn anew for every episode.
"""

import fcntl
import os
import platform
import shlex
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import gymnasium
import numba
import numpy as np
import stable_baselines3
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

import seastar_gym
from agents.learner_file import save
from agents.options import CONFIG, Options, config_of, faults_of
from agents.ppo import policy_of
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers.learned import save as save_policy
from seastar_gym.envs.options import own_scene, scene_at
from seastar_gym.envs.paths import PATHS_OF_PACKAGE
from seastar_gym.envs.randomization import DomainRandomization, Uniform
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.report import ResultsTable, read_progress
from seastar_gym.evaluation.swim import Swim, swim
from seastar_gym.files import PART, is_left_behind, is_part_of, read_json, write_atomically, write_json, write_lines
from seastar_gym.identify.fit import DOUBT, UNSURE
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_number, shown
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.scene import find_modules_in, load_scene
from seastar_gym.scene.serial import has_own_kinds

TARGET = 170.0
"""Simulated time round the pentagon [s]; the greedy agent takes 199 to 201 s, trained policies 152 to 155 s."""
FILE = "efficiency.json"


@dataclass(frozen=True)
class Efficiency:
    """What a training took until now, and what it took to reach the target; None where it has not.

    seconds: Time in the simulator, the policy and the updates [s], of all sessions; saving and measuring do not count.
    """

    strokes: int = 0
    seconds: float = 0.0
    strokes_to_target: int | None = None
    seconds_to_target: float | None = None

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if value is not None or not name.endswith("_to_target"):
                require_number(name, value, "1", zero_allowed=True)

    def after(self, strokes: int, seconds: float, pentagon: Swim) -> "Efficiency":
        """Efficiency after so many strokes and seconds, with a policy that swims the pentagon so."""
        now = replace(self, strokes=strokes, seconds=seconds)
        if self.strokes_to_target is not None or not pentagon.finished or pentagon.time[-1] > TARGET:
            return now
        return replace(now, strokes_to_target=strokes, seconds_to_target=seconds)

    @property
    def progress(self) -> str:
        """How long the training was until now."""
        return f"{self.strokes} decisions, {self.seconds:.0f} s of training"

    def __str__(self) -> str:
        if self.strokes_to_target is None:
            return f"The pentagon was not rounded in {TARGET:g} s yet."
        return (
            f"The pentagon took {TARGET:g} s or less after {self.strokes_to_target} decisions and "
            f"{self.seconds_to_target:.1f} s of training."
        )

    def table(self) -> ResultsTable:
        """Figures as a table of the report."""
        columns = {
            "strokes": "decisions trained",
            "seconds": "training [s]",
            "strokes_to_target": f"decisions until the pentagon takes {TARGET:g} s",
            "seconds_to_target": f"training until the pentagon takes {TARGET:g} s [s]",
        }
        return ResultsTable("Sample efficiency", columns, [asdict(self)])


def read(folder: Path) -> Efficiency:
    """Figures in the folder of a run; those of a beginning where there are none."""
    file = folder / FILE
    if not file.exists():
        return Efficiency()
    with faults_of(file):
        return Efficiency(**read_json(file))


OWN_SCENE = "scene.py"
"""File in a run's folder of a scene with classes or a path of its own, which JSON alone does not bring."""


def write_config(options: Options, arguments: Sequence[str], folder: Path) -> None:
    """Write config.json: options, commands, versions of libraries, and machine."""
    earlier = [] if options.resume is None else config_of(folder)["commands"]
    config = {
        "commands": [*earlier, shlex.join(["python", "train.py", *arguments])],
        "options": asdict(options),
        **versions_and_machine(),
    }
    write_json(folder / CONFIG, config)


def versions_and_machine() -> dict[str, dict[str, Any]]:
    """Versions of the libraries that a training depends on, and the machine."""
    modules = (seastar_gym, gymnasium, numba, np, stable_baselines3, torch)
    return {
        "versions": {"python": platform.python_version(), **{one.__name__: one.__version__ for one in modules}},
        "machine": {"system": platform.platform(), "processors": os.cpu_count()},
    }


@contextmanager
def held(folder: Path, new: bool) -> Iterator[None]:
    """Context in which this process alone trains in a folder, whose files are its own. ValueError where it cannot.

    new: Whether the run begins. Its folder may exist if it is empty, or has only files that a killed run left.
    """
    if new:
        _make(folder)
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        _lock(descriptor, folder)
        require_empty(folder) if new else require_own_files(folder)
        for file in filter(is_left_behind, [*folder.rglob(f".*{PART}")]):
            file.unlink()
        yield
    finally:
        os.close(descriptor)


def _lock(descriptor: int, folder: Path) -> None:
    """Lock a folder until the descriptor is closed or the process ends, however it does."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ValueError(f"Another process trains in {folder}: wait for its end, or stop it.") from None


def _make(folder: Path) -> None:
    if "\0" in str(folder):
        raise ValueError(f"{str(folder)!r} is no name of a folder.")
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{folder} is no folder: give another --out.")
    folder.mkdir(parents=True, exist_ok=True)


def require_empty(folder: Path) -> None:
    """ValueError unless a folder is empty, or has only files that a killed run left."""
    if not all(is_part_of(file, CONFIG) for file in folder.iterdir()):
        raise ValueError(f"{folder} exists already: give another --out, or continue the run in it with --resume.")


def require_own_files(folder: Path) -> None:
    """ValueError where there is anything in the folder of a run but files and folders, such as links."""
    for place, folders, files in os.walk(folder):
        for name in (*folders, *files):
            file = Path(place, name)
            if file.is_symlink() or not (file.is_file() or file.is_dir()):
                raise ValueError(f"{file} is a link or a device, which no run has in its folder: take it out.")


def export(model: PPO, folder: Path) -> None:
    """Write policy.safetensors and policy.json: the trained policy without the learner."""
    config = config_of(folder)
    save_policy(
        policy_of(model),
        folder / "policy.safetensors",
        strokes=model.num_timesteps,
        seed=model.seed,
        progress=read_progress(folder),
        seconds=round(read(folder).seconds, 1),
        **{name: config[name] for name in ("commands", "options", "versions", "machine")},
    )


def recorded(folder: Path) -> list[list[int]]:
    """Rows of the run's progress.csv; none before the first checkpoint."""
    return read_progress(folder) if (folder / "progress.csv").exists() else []


def record(folder: Path, strokes: int, seconds: float, pentagon: Swim) -> Efficiency:
    """Add how a policy swims round the pentagon to progress.csv and efficiency.json; returns what the training took.

    strokes, seconds: Of training until now, see `Efficiency`.
    """
    rows = [row for row in recorded(folder) if row[0] < strokes]
    rows.append([strokes, pentagon.strokes, pentagon.waypoints_reached])
    write_lines(folder / "progress.csv", rows)
    found = read(folder).after(strokes, seconds, pentagon)
    write_json(folder / FILE, asdict(found))
    return found


def is_unbegun(folder: Path) -> bool:
    """Whether a run was stopped before its first checkpoint, so that continuing it begins anew."""
    has_learned = any(strokes > 0 for strokes, *_ in recorded(folder))
    return not has_learned and not any((folder / name).exists() for name in ("model.zip", "checkpoints"))


def resume_command(folder: Path) -> str:
    """Command that continues the run in a folder."""
    own = ["--run-scene"] if (folder / OWN_SCENE).is_file() else []
    script = sys.argv[0] if Path(sys.argv[0]).name == "train.py" else "train.py"  # wherever it is started from
    return shlex.join(["python", script, "--resume", str(folder), *own])


SCENE, INTERVALS = "scene.json", "intervals.json"
"""Files in a run's folder, so that a run that is continued has the robot that it began with."""


class Robot(NamedTuple):
    """Robot of a run.

    scene: Robot with its fluid and numerics. None means the chapter's at the run's fidelity.
    draws: Numbers of the scene that are drawn anew for every episode of the training. None means none.
    """

    scene: Scene | None = None
    draws: DomainRandomization | None = None

    def fidelity(self, options: Options) -> Fidelity | None:
        """Fidelity that an environment of this robot is made with; a scene has its numerics."""
        return options.fidelity if self.scene is None else None


def asked_for(options: Options) -> Robot:
    """Robot that the options of a new run name. ValueError where it could not be kept in the run's folder."""
    scene = scene_at(own_scene(options.scene), None, options.fidelity)
    if scene is not None:
        scene.to_dict()
    file = options.intervals
    return Robot(scene, None if file is None else read_intervals(file, options.intervals_anyway))


def read_intervals(file: Path, anyway: bool = False) -> DomainRandomization:
    """Uniform draws from intervals by name, a JSON file such as `seastar identify --intervals` writes.

    anyway: Whether those of a fit are taken, too, that is doubted.
    """
    if not file.is_file():
        raise ValueError(f"{file} is no file.")
    try:
        found = read_json(file)
        doubt, unsure = found.pop(DOUBT, None), found.pop(UNSURE, ())
        unsure = ", ".join(map(str, unsure))
        ends = {name: (low, high) for name, (low, high) in found.items()}
    except (AttributeError, TypeError, ValueError) as wrong:
        raise ValueError(f'{file} must be JSON such as {{"robot.youngs_modulus": [9e5, 1.1e6]}}.') from wrong
    if doubt is not None and not anyway:
        raise ValueError(
            f"{file} is of a fit whose residual is {shown(doubt)} times the noise of its track, so its intervals may "
            "not hold the robot: fit again, or give --intervals-anyway."
        )
    if unsure and not anyway:
        raise ValueError(
            f"{file} is of a fit that cannot tell {unsure}, so what it has of them means nothing: measure something "
            "else, fix them, or give --intervals-anyway."
        )
    return DomainRandomization({name: Uniform(low, high) for name, (low, high) in ends.items()})


def keep(robot: Robot, folder: Path, file: Path | None, path: str) -> None:
    """Write the robot, whose scene is that of a file, into the folder of its run; nothing for the chapter's.

    path: To train on, which that file may have registered.
    """
    if robot.scene is not None and file is not None:
        write_json(folder / SCENE, robot.scene.to_dict())
        if has_own_kinds(robot.scene) or path not in PATHS_OF_PACKAGE:
            write_atomically(folder / OWN_SCENE, file.read_text(encoding="utf-8"))
    if robot.draws is not None:
        write_json(folder / INTERVALS, {name: each.bounds for name, each in robot.draws.distributions.items()})


def physics(options: Options, folder: Path) -> list[str]:
    """Words of `seastar evaluate` for the robot and the decisions of the run with these options in a folder."""
    file = None if options.scene is None else scene_in(folder)
    words = [] if file is None else ["--scene", str(file)]
    if file is None or not load_scene(file).numerics.named:
        words += ["--fidelity", options.fidelity]
    period = options.ppo.decision_period
    return words if period is None else [*words, "--decision-period", str(period)]


def scene_in(folder: Path) -> Path:
    """File of the scene in a run's folder."""
    return folder / OWN_SCENE if (folder / OWN_SCENE).is_file() else folder / SCENE


def robot_of(options: Options, folder: Path) -> Robot:
    """Robot of the run with these options in a folder. ValueError for code of a run that may not be executed."""
    file = None if options.scene is None else scene_in(folder)
    if options.scene is not None and file is not None and file.name == OWN_SCENE:
        if options.resume is not None and not options.run_scene:
            raise ValueError(f"{file} is Python, which --resume executes with --run-scene only: see that it is yours.")
        find_modules_in(options.scene.parent)  # for modules that it imports
    return Robot(
        scene_at(own_scene(file), None, options.fidelity),
        None if options.intervals is None else read_intervals(folder / INTERVALS),
    )


class Watch(BaseCallback):
    """Callback for the progress bar, logs and checkpoints, which ends the training when `stop()` is true."""

    def __init__(
        self,
        options: Options,
        robot: Robot,
        folder: Path,
        learner: PPO,
        batch: BatchVecEnv,
        stop: Callable[[], bool],
    ):
        super().__init__()
        self.options, self.folder, self.learner, self.batch, self.stop = options, folder, learner, batch, stop
        self.strokes = 0  # of this process
        self.seconds = {"simulator": 0.0, "policy": 0.0, "update": 0.0}
        self.efficiency = self._before = read(folder)
        self.pentagon = SeastarSwimEnv(
            "pentagon",
            actions=options.ppo.actions,
            fidelity=robot.fidelity(options),
            scene=robot.scene,
            decision_period=options.ppo.decision_period,
        )

    def _on_training_start(self) -> None:
        self.is_untrained = self.learner.num_timesteps == 0
        # On a terminal only: elsewhere, a line at every checkpoint says how far it is.
        total, done = self.options.length, self.learner.num_timesteps
        self.bar = tqdm(total=total, initial=done, unit=" decisions", unit_scale=True, disable=None, smoothing=0.1)
        self.next_save = done + self.options.save_freq
        self.clock = time.perf_counter()

    def _on_rollout_start(self) -> None:
        self.seconds["update"] += self._lap()
        if self.learner.num_timesteps >= self.next_save:
            self.next_save += self.options.save_freq
            self.checkpoint()
            self._lap()
        self.simulator_seconds = self.batch.seconds_in_steps

    def _on_step(self) -> bool:
        self.strokes += self.batch.num_envs
        self.bar.update(self.batch.num_envs)
        return not self.stop()

    def _on_rollout_end(self) -> None:
        simulator = self.batch.seconds_in_steps - self.simulator_seconds
        self.seconds["simulator"] += simulator
        self.seconds["policy"] += self._lap() - simulator
        for name, share in self.shares().items():
            self.logger.record(f"time/share_{name}", share)
        self._begin_curve()

    def _on_training_end(self) -> None:
        self._begin_curve()  # it may have been stopped within the first rollout
        self.bar.close()

    def _begin_curve(self) -> None:
        """Measure the untrained policy, once. By now the film's process has compiled the code of a lap."""
        if self.is_untrained:
            self.is_untrained = False
            self.measure(untrained=True)
            self._lap()

    def _lap(self) -> float:
        """Seconds since the last lap."""
        before, self.clock = self.clock, time.perf_counter()
        return self.clock - before

    def shares(self) -> dict[str, float]:
        """Shares of the training's time in the simulator, the policy and the update."""
        total = sum(self.seconds.values())
        return {name: seconds / total if total else 0.0 for name, seconds in self.seconds.items()}

    def checkpoint(self) -> None:
        """Save the model, and log how it swims round the pentagon."""
        save(self.learner, self.folder / "model.zip")
        done = self.keep()
        lap = f"{done.time[-1]:.0f} s of swimming" if done.finished else f"only {done.waypoints_reached} waypoints"
        self.bar.set_postfix_str(f"pentagon: {lap}")
        if self.bar.disable:
            print(f"{self.efficiency.progress}, pentagon: {lap}", flush=True)

    def keep(self) -> Swim:
        """Copy the saved model to the checkpoints, and log how it swims round the pentagon; returns that swim."""
        copy = self.folder / "checkpoints" / f"model_{self.learner.num_timesteps:09d}.zip"
        write_atomically(copy, (self.folder / "model.zip").read_bytes())
        return self.measure()

    def measure(self, untrained: bool = False) -> Swim:
        """Log how the policy swims round the pentagon now; returns that swim. untrained: No update was made yet."""
        strokes = 0 if untrained else self.learner.num_timesteps
        seconds = 0.0 if untrained else self._before.seconds + sum(self.seconds.values())
        limit = self.options.limit(self.pentagon.scene)
        done = swim("learned", policy_of(self.learner), self.pentagon, max_strokes=limit)
        self.learner.logger.record("eval/pentagon_strokes", done.strokes)
        self.learner.logger.record("eval/pentagon_waypoints", done.waypoints_reached)
        self.efficiency = record(self.folder, strokes, seconds, done)
        return done


@contextmanager
def stoppable() -> Iterator[threading.Event]:
    """Context whose event a first Ctrl-C (or a termination) sets, for an orderly stop; a second one stops at once."""
    asked, before = threading.Event(), dict[int, Any]()

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def ask(number: int, frame: FrameType | None) -> None:
        asked.set()
        restore()

    before.update((number, signal.signal(number, ask)) for number in (signal.SIGINT, signal.SIGTERM))
    try:
        yield asked
    finally:
        restore()
