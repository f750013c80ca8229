"""Equal tuning: ten draws of the same four numbers for every method of the benchmark, on one id and the split "train".

A draw is judged by 64 episodes of that split. The best of ten and a method's own numbers are then trained again with
other seeds, which did not choose. Processes with other --methods may fill one file side by side.
"""

import time
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch

from agents.methods import METHODS, UNTUNED, Draw, batch_of, new_model
from agents.tasks import FAR_SEED
from seastar_gym.evaluation.benchmark import EPISODES, swum
from seastar_gym.evaluation.results import over_trainings
from seastar_gym.scene.checks import require_count
from studies.frame import Results, Study, require_known, rounded
from studies.pages import markdown

ID = "SeastarStation-v0"
SEEDS = (1, 2, 3)
"""Seeds of the trainings that are compared; draws have seed 0."""
OWN = "own numbers"


@dataclass(frozen=True)
class Options:
    """Which methods are tuned, and how long every training is."""

    methods: tuple[str, ...] = UNTUNED
    """Methods, each in its first track."""
    decisions: int = 30_000
    """Length of every training [decisions]."""

    def __post_init__(self) -> None:
        require_known("method", self.methods, UNTUNED)
        require_count("decisions", self.decisions, 1, 10**9)


def draws(n: int = 10) -> dict[str, Draw]:
    """What is drawn, by its name: the same for every method."""
    rng = np.random.default_rng(0)
    return {
        f"draw {k}": Draw(
            rounded(10.0 ** rng.uniform(-4.0, -2.5), 2),
            rounded(1.0 - 10.0 ** rng.uniform(-2.3, -0.7), 3),
            round(2.0 ** rng.uniform(1.0, 4.0)),
            rounded(rng.uniform(), 2),
        )
        for k in range(n)
    }


def trained(name: str, draw: Draw | None, seed: int, decisions: int) -> dict[str, float]:
    """Mean measure in episodes that no training begins with, and processor time [s]."""
    torch.set_num_threads(1)
    method, track, began = METHODS[name], METHODS[name].tracks[0], time.process_time()
    model = new_model(name, track, ID, seed, draw)
    model.learn(decisions)
    model.get_env().close()
    seconds = time.process_time() - began
    found = swum(batch_of(method, track, ID, EPISODES, "train"), model, FAR_SEED)
    return {"measure": rounded(float(np.mean(found["measure"]))), "seconds": round(seconds, 1)}


def best_of(row: dict[str, Any]) -> str:
    """Name of the draw whose robots kept nearest, of those with seed 0."""
    return min(draws(), key=lambda name: row[f"{name}, seed 0"]["measure"])


def run(options: Options, results: Results) -> None:
    """Train what is missing: the draws of every method, then the best of them and its own numbers."""
    known: dict[str, Draw | None] = {OWN: None, **draws()}

    def fill(method: str, names: list[str], seeds: tuple[int, ...]) -> None:
        each = partial(trained, method, decisions=options.decisions)
        cells = {
            ("trainings", method, f"{name}, seed {seed}"): partial(each, known[name], seed)
            for name in names
            for seed in seeds
        }
        results.fill(cells, lambda cell: f"{cell['measure']:.3g} mm")

    for method in options.methods:
        fill(method, list(draws()), (0,))
        fill(method, [OWN, best_of(results["trainings"][method])], SEEDS)


def over_seeds(means: list[float]) -> str:
    """Mean over trainings, with its interval where there are enough of them."""
    found = over_trainings(means)
    return f"{found.mean:.3g}" + ("" if np.isnan(found.low) else f" [{found.low:.3g}, {found.high:.3g}]")


def tuning_table(found: Any) -> str:
    """A method's own numbers and the best of ten draws, both with other seeds, of methods that are tuned to the end."""
    lines, whole = [], len(draws()) + 2 * len(SEEDS)
    for method in UNTUNED:
        row = found.get("trainings", {}).get(method, {})
        if len(row) < whole:
            continue
        best = best_of(row)
        told = (over_seeds([row[f"{name}, seed {seed}"]["measure"] for seed in SEEDS]) for name in (OWN, best))
        seconds = sum(row[f"{name}, seed 0"]["seconds"] for name in draws())
        lines.append([method, METHODS[method].tracks[0], *told, *draws()[best], f"{seconds:.0f}"])
    head = ["method", "track", f"{OWN} [mm]", "best of ten [mm]", "learning rate", "discount", "uses"]
    return markdown([*head, "exploration", "ten draws [s]"], lines, (0, 1))


STUDY = Study(
    "tuning", run, Options, "benchmark/tuning.json",
    settings=lambda options: {"id": ID, "decisions": options.decisions,
                              "draws": {name: list(draw) for name, draw in draws().items()}},
    tables={"benchmark tuning": tuning_table},
)  # fmt: skip
