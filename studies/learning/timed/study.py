"""How fast, and with how much heat, do policies swim that decide every 0.5, 0.2 or 0.1 s? Trainings side by side.

    python -m studies.learning.timed
    python -m studies.learning.timed --trainings "0.2 s, coasting" --seeds 0 1 2

Every policy swims the pentagon at every fidelity asked for, and held-out random paths at the fidelity of the training.
Results are written after every training. A training whose result is already in the file is not repeated, nor is one
whose network is in the folder of networks. For pairs of limbs, `train.py` with the same options leaves the same file,
its model.zip.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch

from seastar_gym.controllers.contract import Policy
from seastar_gym.envs.options import make_scene
from seastar_gym.evaluation.many import HELD_OUT_SEED, swim_many
from seastar_gym.evaluation.swim import Swim
from seastar_gym.scene.checks import require_count
from seastar_gym.scene.numerics import Fidelity
from studies.frame import InDocs, Results, Study, require_known
from studies.learning.timed.pictures import draw
from studies.learning.timed.tables import summary
from studies.learning.timed.trainings import TRAININGS, learn


@dataclass(frozen=True)
class Options(InDocs):
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

    def __post_init__(self) -> None:
        require_known("training", self.trainings, TRAININGS)
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


def study(options: Options, results: Results) -> None:
    """Run the trainings that are missing."""
    torch.set_num_threads(1)
    cells = {
        ("runs", name, str(seed)): partial(result, name, seed, options)
        for name, seed in itertools.product(options.trainings, options.seeds)
    }
    results.fill(cells, told)


def told(found: dict[str, Any]) -> str:
    """Times of a policy."""
    pentagon = ", ".join(f"{one['seconds']:g} s at {fidelity}" for fidelity, one in found["pentagon"].items())
    return f"{pentagon}; held-out {found['held_out']['seconds']:.1f} s"


STUDY = Study(
    "learning.timed",
    study,
    Options,
    "learning/in_time.json",
    settings=lambda options: {name: getattr(options, name) for name in ("decisions", "fidelity", "paths")},
    pictures={"in_time.png": lambda results, file: draw(results["runs"], file)},
    tables={"in_time": lambda results: summary(results["runs"])},
    packages=("torch", "stable_baselines3"),
)
