"""Fit a model of a measured swimmer to four of its 37 speeds, and predict the others with 90 % intervals.

Robots with many samples of the unknowns swim in every condition, side by side in batches. The four speeds weigh the
samples, and the weighted samples predict the other speeds. So no fit can end in the wrong minimum, and what the speeds
do not tell of the unknowns is in the intervals. Then parts of the model are left out, one at a time, and laws of one
constant are fitted to the same four speeds.

Speeds are kept in the folder RUNS, so the study goes on where it was interrupted. It prints its tables and writes
`validation.json` and `validation.png`.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from studies.frame import Results, Study
from studies.validation import laws
from studies.validation.inference import MODEL, SCATTER, Score, effective, hindsight, one_speed, predict, score, weights
from studies.validation.luck import other_fours, scores
from studies.validation.pictures import draw
from studies.validation.priors import UNKNOWNS, samples
from studies.validation.separation import best_known, sweeps_told, told
from studies.validation.simulate import all_speeds, speeds
from studies.validation.speeds import Condition, read_speeds, training
from studies.validation.swimmer import Variant

Floats = NDArray[np.float64]

VARIANTS: tuple[Variant, ...] = get_args(Variant)[1:]
SAMPLES, OF_VARIANTS, FOURS = 512, 128, 100
"""Samples of the full model, and of models with a part left out: the first of the same sequence. Other fours."""
SAME_SAMPLES = "full, as many samples"
CHECKED, SLOW = 64, 0.01
"""Samples that swim on a finer mesh, too, and the speed [m/s] below which a difference says nothing."""


def simulate(conditions: list[Condition], variant: Variant, n: int, folder: Path, console: Console) -> Floats:
    """Speeds of n samples [m/s], shape (n, n_conditions)."""
    found = []
    for condition, swum in all_speeds(conditions, samples(n), variant, folder):
        found.append(swum)
        console.print(f"{variant}: {condition.name}, median {1e3 * np.nanmedian(swum):.1f} mm/s", style="dim")
    return np.stack(found, axis=1)


def analyse(simulated: Floats, conditions: list[Condition]) -> dict[str, Any]:
    """Predictions from the four runs, their score, and the scores of other fours."""
    measured, chosen = np.array([condition.speed for condition in conditions]), training(conditions)
    weight = weights(simulated, measured, chosen)
    prediction = predict(simulated, weight)
    blind = predict(simulated, np.full(len(simulated), 1.0 / len(simulated)))
    lucky = scores(simulated, measured, other_fours(conditions, FOURS))
    return {
        "weight": weight,
        "prediction": prediction,
        "chosen": chosen,
        "score": score(prediction, measured, chosen),
        "blind": score(blind, measured, chosen),
        "effective": effective(weight),
        "hindsight": hindsight(simulated, measured, chosen),
        "one speed": one_speed(measured, chosen),
        "fours": {
            name: np.percentile([getattr(one, name) for one in lucky], [5.0, 50.0, 95.0]).tolist()
            for name in ("error", "covered", "ratio")
        },
    }


def discretisation(simulated: Floats, conditions: list[Condition], folder: Path) -> float:
    """Mean difference of speeds with twice as many edges and steps, over the speed, of samples that swim forward."""
    few, off = samples(CHECKED), []
    for k in training(conditions):
        file = folder / f"finer-{CHECKED}-{conditions[k].name}.npy"
        if not file.is_file():
            np.save(file, speeds(conditions[k], few, "full", finer=2))
        finer, coarse = np.load(file), simulated[:CHECKED, k]
        forward = finer > SLOW
        off.append(np.abs(coarse[forward] / finer[forward] - 1.0))
    return float(np.concatenate(off).mean())


def score_row(name: str, one: Score, fours: dict[str, list[float]]) -> list[str]:
    low, middle, high = (100.0 * error for error in fours["error"])
    return [
        name, f"{100 * one.error:.1f} %", f"{100 * one.bias:+.1f} %", f"{100 * one.worst:.0f} %",
        f"{100 * one.covered:.0f} %", f"{one.ratio:.2f}", f"{middle:.1f} % ({low:.1f} to {high:.1f})",
    ]  # fmt: skip


def print_tables(console: Console, analyses: dict[str, dict[str, Any]], values: dict[str, Floats]) -> None:
    table = Table(title="Predictions of the speeds that were not fitted to")
    for header in ("model", "error", "bias", "worst", "within 90 %", "high/low", "other fours: error"):
        table.add_column(header)
    full = analyses["full"]
    table.add_row(*score_row("before any speed", full["blind"], full["fours"])[:-1], "")
    for name, one in analyses.items():
        table.add_row(*score_row(name, one["score"], one["fours"]))
    console.print(table)
    known = Table(title=f"Unknowns ({full['effective']:.0f} effective samples)")
    for header in ("unknown", "unit", "before", "after", "narrower"):
        known.add_column(header)
    for unknown, after_all in zip(UNKNOWNS, told(values, full["weight"]), strict=True):
        after = f"{after_all.middle:.3g} ({after_all.low:.3g} to {after_all.high:.3g})"
        known.add_row(
            after_all.name, unknown.unit, f"{unknown.low:g} to {unknown.high:g}", after, f"x {after_all.narrower:.2f}"
        )
    console.print(known)


def as_json(
    analyses: dict[str, dict[str, Any]], conditions: list[Condition], values: dict[str, Floats]
) -> dict[str, Any]:
    full = analyses["full"]
    powers, narrower = best_known(values, full["weight"])
    prediction = full["prediction"]
    return {
        "scatter": SCATTER,
        "model_error": MODEL,
        "samples": len(full["weight"]),
        "models": {
            name: {"score": asdict(one["score"]), "fours": one["fours"], "effective_samples": one["effective"],
                   "hindsight": one["hindsight"]}
            for name, one in analyses.items()
        },
        "before": asdict(full["blind"]),
        "one_speed_for_all": full["one speed"],
        "laws": laws.law_scores(conditions, full["chosen"], other_fours(conditions, FOURS)),
        "unknowns": [one._asdict() for one in told(values, full["weight"])],
        "sweeps": dict(zip(("0", "25", "50", "75"), sweeps_told(full["weight"]), strict=True)),
        "best_known": {"powers": powers, "narrower": narrower},
        "speeds_mm_per_s": [
            {
                "liquid_metal": condition.liquid_metal, "frequency": condition.frequency,
                "measured": round(1e3 * condition.speed, 2), "predicted": round(1e3 * prediction.middle[k], 2),
                "low": round(1e3 * prediction.low[k], 2), "high": round(1e3 * prediction.high[k], 2),
                "identified_from": k in full["chosen"],
            }
            for k, condition in enumerate(conditions)
        ],
    }  # fmt: skip


@dataclass(frozen=True)
class Options:
    """Unknowns from four speeds, and predictions of the others."""

    samples: int = SAMPLES
    """Samples of the unknowns."""
    variants: tuple[Variant, ...] = VARIANTS
    """Parts to leave out."""
    only_laws: bool = False
    """Add the laws of one constant to the results that are there."""
    runs: Path = Path("runs/validation")
    """Folder of speeds."""
    out: Path = Path("docs")
    """Folder of the files, or the file of the numbers."""


def run(options: Options, results: Results) -> None:
    """Simulate, weigh, predict, and leave parts out."""
    console, conditions, values = Console(), read_speeds(), samples(options.samples)
    if options.only_laws:
        results.read()
        results["laws"] = laws.law_scores(conditions, training(conditions), other_fours(conditions, FOURS))
        return
    simulated = simulate(conditions, "full", options.samples, options.runs, console)
    analyses = {"full": analyse(simulated, conditions)}
    fewer = min(OF_VARIANTS, options.samples)
    if options.variants:
        analyses[SAME_SAMPLES] = analyse(simulated[:fewer], conditions)
    for variant in options.variants:
        of_variant = simulate(conditions, variant, fewer, options.runs, console)
        analyses[variant] = analyse(of_variant, conditions)
    print_tables(console, analyses, values)
    results.update(as_json(analyses, conditions, values))
    off = results["discretisation"] = discretisation(simulated, conditions, options.runs)
    console.print(f"Twice as many edges and steps change speeds by {100 * off:.1f} % on average.")
    console.print(f"Half the predictions are within {100 * analyses['full']['score'].median:.1f} %.")
    console.print(f"The mean of the four speeds is {100 * analyses['full']['one speed']:.1f} % off.")
    console.print(f"Best of all samples, if told all speeds: {100 * analyses['full']['hindsight']:.1f} % off.")
    console.print(f"Best known: {results['best_known']}, sweeps: {results['sweeps']}")


STUDY = Study(
    "validation",
    run,
    Options,
    "validation.json",
    pictures={"validation.png": draw},
    tables={"validation": laws.table},
    packages=("scipy",),
)
