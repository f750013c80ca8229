"""How fast, and with how much heat, do policies swim that decide every 0.5, 0.2 or 0.1 s? Trainings side by side.

    python -m studies.learning.in_time
    python -m studies.learning.in_time --trainings "0.2 s, coasting" --seeds 0 1 2

Every policy swims the pentagon at every fidelity asked for, and held-out random paths at the fidelity of the training.
Results are written after every training. A training whose result is already in the file is not repeated, nor is one
whose network is in the folder of networks. For pairs of limbs, `train.py` with the same options leaves the same file,
its model.zip.
"""

import itertools
import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
import tyro

from seastar_gym.command import run_command
from seastar_gym.controllers.contract import Policy
from seastar_gym.envs.task import make_scene
from seastar_gym.evaluation.many import HELD_OUT_SEED, swim_many
from seastar_gym.evaluation.swim import Swim
from seastar_gym.files import write_atomically
from seastar_gym.scene.checks import require_count
from seastar_gym.scene.numerics import Fidelity
from studies.learning.in_time.pictures import draw
from studies.learning.in_time.tables import as_markdown
from studies.learning.in_time.trainings import TRAININGS, learn
from studies.provenance import provenance


@dataclass(frozen=True)
class Options:
    """Policies learned for decisions of different length, by different learners, and at different prices of heat."""

    seeds: tuple[int, ...] = tuple(range(10))
    """Seeds of the trainings."""
    trainings: tuple[str, ...] = tuple(TRAININGS)
    """Names of the trainings to run."""
    decisions: int | None = None
    """Length of every training; by default its own."""
    fidelity: Fidelity = "fast"
    """Fidelity of the trainings, and of the held-out paths."""
    again: tuple[Fidelity, ...] = ("fast", "balanced", "reference")
    """Fidelities at which every policy swims the pentagon."""
    paths: int = 24
    """Number of held-out random paths."""
    networks: Path = Path("runs/in_time")
    """Folder of the trained networks."""
    out: Path = Path("docs/in_time.json")
    """File of the results. The picture has the same name with the suffix .png."""

    def __post_init__(self) -> None:
        if unknown := set(self.trainings) - set(TRAININGS):
            raise ValueError(f"Unknown training {min(unknown)!r}: choose of {', '.join(TRAININGS)}.")
        require_count("paths", self.paths, 1, 10_000)
        if self.decisions is not None:
            require_count("decisions", self.decisions, 1, 10**9)


def swims_of(policy: Policy, path: str, n_swims: int, fidelity: Fidelity, decision_period: float) -> list[Swim]:
    """Swims of a policy; path: "random" means the held-out paths."""
    return swim_many(
        "learned", policy, path, n_swims, make_scene(None, fidelity, decision_period), threads=1, seed=HELD_OUT_SEED,
        decision_period=decision_period,
    )  # fmt: skip


def measured(swims: Sequence[Swim]) -> dict[str, float]:
    """Means of swims: time [s], heat [J] and heat per metre of the hub's way [J/m]; and how many arrived.

    A swim that does not arrive counts with the time limit.
    """
    joules = [done.joules_per_metre for done in swims]
    return {
        "arrived": sum(done.finished for done in swims),
        "seconds": round(float(np.mean([done.time[-1] for done in swims])), 3),
        "energy_J": round(float(np.mean([done.energy.sum() for done in swims])), 1),
        "J_per_m": round(float(np.mean([0.0 if each is None else each for each in joules])), 1),
    }


def result(name: str, seed: int, options: Options) -> dict[str, Any]:
    """Run a training, and measure what it has learned."""
    learned = learn(name, seed, options.fidelity, options.networks, options.decisions)
    period = cast(float, TRAININGS[name].hyperparameters.decision_period)
    held_out = swims_of(learned.policy, "random", options.paths, options.fidelity, period)
    return {
        "training_s": learned.seconds,
        "held_out": measured(held_out),
        "pentagon": {each: measured(swims_of(learned.policy, "pentagon", 1, each, period)) for each in options.again},
    }


def study(options: Options, results: dict[str, Any]) -> None:
    """Run the trainings that are missing in the results, and write the results after each."""
    options.out.parent.mkdir(parents=True, exist_ok=True)
    for name, seed in itertools.product(options.trainings, options.seeds):
        runs = results["runs"].setdefault(name, {})
        if str(seed) in runs:
            continue
        found = runs[str(seed)] = result(name, seed, options)
        results["runs"][name] = runs = dict(sorted(runs.items(), key=lambda run: int(run[0])))
        write_atomically(options.out, (json.dumps(results, indent=1) + "\n").encode())
        pentagon = ", ".join(f"{one['seconds']:g} s at {fidelity}" for fidelity, one in found["pentagon"].items())
        print(f"{name}, seed {seed}: {pentagon}; held-out {found['held_out']['seconds']:.1f} s", flush=True)


def read_results(options: Options, command: str) -> dict[str, Any]:
    """Results in the output file, or empty ones if there is none; ValueError if the file has other settings."""
    settings = {name: getattr(options, name) for name in ("decisions", "fidelity", "paths")}
    if not options.out.is_file():
        return {**provenance(command, "torch", "stable_baselines3"), "settings": settings, "runs": {}}
    results: Any = json.loads(options.out.read_text(encoding="utf-8"))
    found = results.get("settings") if isinstance(results, dict) else None
    if found != settings:
        raise ValueError(f"{options.out} has results of {found}, not of {settings}: give another --out.")
    return cast(dict[str, Any], results)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line of the study; returns the exit code."""
    torch.set_num_threads(1)
    given = sys.argv[1:] if arguments is None else arguments
    try:
        options = tyro.cli(Options, prog="python -m studies.learning.in_time", args=given)
        results = read_results(options, shlex.join(["python", "-m", "studies.learning.in_time", *given]))
        study(options, results)
    except (ValueError, OSError) as wrong:
        print(wrong, file=sys.stderr)
        return 2
    draw(results["runs"], options.out.with_suffix(".png"))
    print(as_markdown(results["runs"]))
    return 0


if __name__ == "__main__":
    run_command(main)
