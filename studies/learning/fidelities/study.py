"""Does it matter at which fidelity a policy is trained? Trainings at every fidelity, swum at every other.

    python -m studies.learning.fidelities

Policies are trained at four numerics with 8, 10 and 19 nodes per limb, several seeds of each, and swum on held-out
random paths at every one of these fidelities, and in three physics that nobody is trained in: drag along limbs, added
mass, silicone; round the pentagon at the dearest one. Then a cheap training that is finished at the dearest fidelity is
compared with one there alone, in equal processor time. Scores are strokes to the last waypoint. Results are written
after every training, and a training whose result is already in the file is not repeated.
"""

import itertools
import json
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import torch
import tyro

from agents.hyperparameters import Hyperparameters
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.files import write_atomically
from seastar_gym.scene.checks import require_count
from seastar_gym.version import __version__
from studies.learning.fidelities.pictures import draw
from studies.learning.fidelities.scenes import CHEAP, DEAR, FIDELITIES, SWUM
from studies.learning.fidelities.tables import as_markdown
from studies.learning.fidelities.trainings import rounded, strokes_to_finish, train
from studies.provenance import provenance

LEARNER = Hyperparameters()
"""Hyperparameters of all trainings."""
CONTESTANTS = ("dear alone", "cheap alone", "cheap, then dear")
"""Trainings of equal processor time."""


@dataclass(frozen=True)
class Options:
    """Policies trained at every fidelity and swum on every other; cheap trainings finished dearly."""

    seeds: tuple[int, ...] = tuple(range(10))
    """Seeds of the trainings."""
    fidelities: tuple[str, ...] = tuple(FIDELITIES)
    """Fidelities to train at: numerics and nodes per limb. Every policy is swum on all of them."""
    strokes: int = 49_152
    """Length of every training [strokes]."""
    paths: int = 16
    """Number of held-out random paths."""
    budgets: tuple[float, ...] = (40.0,)
    """Processor times [s] within which a cheap training, a dear one and both in turn are compared."""
    out: Path = Path("docs/fidelities.json")
    """File of the results. The picture has the same name with the suffix .png."""

    def __post_init__(self) -> None:
        if unknown := set(self.fidelities) - set(FIDELITIES):
            raise ValueError(f"Unknown fidelity {min(unknown)!r}: choose of {', '.join(FIDELITIES)}.")
        require_count("strokes", self.strokes, 1, 10**9)
        require_count("paths", self.paths, 1, 10_000)


def scores(policy: LearnedPolicy, options: Options, names: Sequence[str]) -> dict[str, Any]:
    """Strokes of a policy on the held-out paths, by the physics that it is swum in, and round the pentagon."""
    return {
        "random": {name: strokes_to_finish(policy, SWUM[name], "random", options.paths) for name in names},
        "pentagon": strokes_to_finish(policy, SWUM[DEAR], "pentagon", 1)[0],
    }


def fill(options: Options, results: dict[str, Any]) -> None:
    """Run the trainings that are missing in the matrix, and write the results after each."""
    for seed, name in itertools.product(options.seeds, options.fidelities):
        runs = results["runs"].setdefault(name, {})
        if str(seed) in runs:
            continue
        began = time.perf_counter()
        trained = train([(FIDELITIES[name], rounded(options.strokes, LEARNER))], seed, LEARNER)
        runs[str(seed)] = {
            "strokes": trained.strokes, "seconds": trained.seconds, **scores(trained.policy, options, list(SWUM)),
        }  # fmt: skip
        write(options, results)
        found = runs[str(seed)]["random"][DEAR]
        print(
            f"{name}, seed {seed}: {sum(found) / len(found):.1f} strokes on {DEAR}, trained in {trained.seconds:.0f} s "
            f"({time.perf_counter() - began:.0f} s in all)",
            flush=True,
        )


def stages(contestant: str, budget: float, rates: dict[str, float]) -> list[tuple[str, int]]:
    """Fidelities and strokes of a contestant's training. budget, rates: Processor time [s], in all and per stroke."""

    def within(name: str, seconds: float) -> tuple[str, int]:
        return name, rounded(seconds / rates[name], LEARNER)

    match contestant:
        case "dear alone":
            return [within(DEAR, budget)]
        case "cheap alone":
            return [within(CHEAP, budget)]
    return [within(CHEAP, 0.5 * budget), within(DEAR, 0.5 * budget)]


def finish(options: Options, results: dict[str, Any]) -> None:
    """Run the trainings of equal processor time that are missing, and write the results after each."""
    known = {name: list(results["runs"].get(name, {}).values()) for name in (CHEAP, DEAR)}
    if not all(known.values()):
        print(f"Nothing is finished dearly: that needs trainings at {CHEAP} and {DEAR}, which tell their cost.")
        return
    rates = {name: min(run["seconds"] / run["strokes"] for run in runs) for name, runs in known.items()}
    for seed, budget, contestant in itertools.product(options.seeds, options.budgets, CONTESTANTS):
        runs = results["finishing"].setdefault(f"{budget:g}", {}).setdefault(contestant, {})
        if str(seed) in runs:
            continue
        parts = stages(contestant, budget, rates)
        trained = train([(FIDELITIES[name], strokes) for name, strokes in parts], seed, LEARNER)
        runs[str(seed)] = {
            "stages": parts, "seconds": trained.seconds, **scores(trained.policy, options, [DEAR]),
        }  # fmt: skip
        write(options, results)
        found = runs[str(seed)]["random"][DEAR]
        print(f"{contestant}, {budget:g} s, seed {seed}: {sum(found) / len(found):.1f} strokes on {DEAR}", flush=True)


def write(options: Options, results: dict[str, Any]) -> None:
    """Write the results so far."""
    write_atomically(options.out, (json.dumps(results) + "\n").encode())


def read_results(options: Options, command: str) -> dict[str, Any]:
    """Results in the output file, or empty ones if there is none; ValueError if the file has other settings."""
    settings = {"strokes": options.strokes, "paths": options.paths, "version": __version__}
    if not options.out.is_file():
        facts = {**provenance(command, "torch", "stable_baselines3"), "settings": settings}
        return facts | {"runs": {}, "finishing": {}}
    results: Any = json.loads(options.out.read_text(encoding="utf-8"))
    found = results.get("settings") if isinstance(results, dict) else None
    if found != settings:
        of = "something else" if found is None else found
        raise ValueError(f"{options.out} has results of {of}, not of {settings}: give another --out.")
    return cast(dict[str, Any], results)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line of the study; returns the exit code."""
    torch.set_num_threads(1)
    given = sys.argv[1:] if arguments is None else arguments
    try:
        options = tyro.cli(Options, prog="python -m studies.learning.fidelities", args=given)
        results = read_results(options, shlex.join(["python", "-m", "studies.learning.fidelities", *given]))
    except ValueError as wrong:
        print(wrong, file=sys.stderr)
        return 2
    fill(options, results)
    finish(options, results)
    draw(results, options.out.with_suffix(".png"))
    print(as_markdown(results))
    return 0
