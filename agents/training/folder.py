"""Folder of a training run: config.json, model.zip with its checkpoints, progress.csv and the trained policy."""

import json
import os
import platform
import shlex
from collections.abc import Sequence
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
from agents.report.charts import read_progress
from agents.training import efficiency
from agents.training.options import Options
from seastar_gym.controllers.learned import save as save_policy
from seastar_gym.files import write_atomically


def write_config(options: Options, arguments: Sequence[str], folder: Path) -> None:
    """Write config.json: options, commands, versions of libraries, and machine."""
    file = folder / "config.json"
    earlier = [] if options.resume is None else json.loads(file.read_text(encoding="utf-8"))["commands"]
    config = {
        "commands": [*earlier, shlex.join(["python", "train.py", *arguments])],
        "options": asdict(options),
        **versions_and_machine(),
    }
    write_atomically(file, (json.dumps(config, indent=2, default=str) + "\n").encode())


def versions_and_machine() -> dict[str, dict[str, Any]]:
    """Versions of the libraries that a training depends on, and the machine."""
    modules = (seastar_gym, gymnasium, numba, np, stable_baselines3, torch)
    return {
        "versions": {"python": platform.python_version(), **{one.__name__: one.__version__ for one in modules}},
        "machine": {"system": platform.platform(), "processors": os.cpu_count()},
    }


def claim(folder: Path) -> None:
    """Make the folder of a new run. It may exist if it is empty, or has only a file that a killed run left."""
    if "\0" in str(folder):
        raise ValueError(f"{str(folder)!r} is no name of a folder.")
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{folder} is no folder: give another --out.")
    folder.mkdir(parents=True, exist_ok=True)
    if any(file.name != "config.json.part" for file in folder.iterdir()):
        raise ValueError(f"{folder} exists already: give another --out, or continue the run in it with --resume.")


def export(model: PPO, folder: Path) -> None:
    """Write policy.safetensors and policy.json: the trained policy without the learner."""
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
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


def is_unbegun(folder: Path) -> bool:
    """Whether a run was stopped before its first checkpoint, so that continuing it begins anew."""
    return not any((folder / name).exists() for name in ("model.zip", "checkpoints", "progress.csv"))


def resume_command(folder: Path) -> str:
    """Command that continues the run in a folder."""
    return shlex.join(["python", "train.py", "--resume", str(folder)])
