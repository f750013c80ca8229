"""Folder of a training run: config.json, model.zip with its checkpoints, progress.csv and the trained policy."""

import fcntl
import os
import platform
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import gymnasium
import numba
import numpy as np
import stable_baselines3
import torch
from stable_baselines3 import PPO

import seastar_gym
from agents.ppo import policy_of
from agents.training import efficiency
from agents.training.efficiency import Efficiency
from agents.training.options import CONFIG, Options, config_of
from seastar_gym.controllers.learned import save as save_policy
from seastar_gym.evaluation.report.charts import read_progress
from seastar_gym.evaluation.swim import Swim
from seastar_gym.files import PART, is_left_behind, is_part_of, write_json, write_lines

OWN_SCENE = "scene.py"
"""File in a run's folder of a scene with classes of its own, which JSON alone does not bring."""


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
        _clear(folder)
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


def _clear(folder: Path) -> None:
    """Remove what a process that was killed was writing."""
    for file in filter(is_left_behind, [*folder.rglob(f".*{PART}")]):
        file.unlink()


def export(model: PPO, folder: Path) -> None:
    """Write policy.safetensors and policy.json: the trained policy without the learner."""
    config = config_of(folder)
    save_policy(
        policy_of(model),
        folder / "policy.safetensors",
        strokes=model.num_timesteps,
        seed=model.seed,
        progress=read_progress(folder),
        seconds=round(efficiency.read(folder).seconds, 1),
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
    found = efficiency.read(folder).after(strokes, seconds, pentagon)
    efficiency.write(found, folder)
    return found


def is_unbegun(folder: Path) -> bool:
    """Whether a run was stopped before its first checkpoint, so that continuing it begins anew."""
    has_learned = any(strokes > 0 for strokes, *_ in recorded(folder))
    return not has_learned and not any((folder / name).exists() for name in ("model.zip", "checkpoints"))


def resume_command(folder: Path) -> str:
    """Command that continues the run in a folder."""
    own = ["--run-scene"] if (folder / OWN_SCENE).is_file() else []
    return shlex.join(["python", "train.py", "--resume", str(folder), *own])
