"""Fit a model of a measured swimmer to four of its 37 speeds, and predict the others with 90 % intervals.

Robots with many samples of the unknowns swim in every condition, side by side in batches. The four speeds weigh the
samples, and the weighted samples predict the other speeds. So no fit can end in the wrong minimum, and what the speeds
do not tell of the unknowns is in the intervals. Then parts of the model are left out or added, one at a time, swimmers
whose limbs follow their curves swim by other laws of drag, laws of one constant are fitted to the same four speeds, and
turns of two tracked swims are predicted.

Speeds are kept in runs/validation, so the study goes on where it was interrupted. It writes
`validation.json` and `validation.png`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.files import save_figure
from studies.frame import Floats, Results, Study
from studies.style import CYCLE, INK, subplots
from studies.validation import follow, laws, turns
from studies.validation.inference import (
    MODEL,
    SCATTER,
    best_known,
    effective,
    hindsight,
    one_speed,
    other_fours,
    predict,
    score,
    scores,
    sweeps_told,
    told,
    weights,
)
from studies.validation.priors import samples
from studies.validation.speeds import Condition, read_speeds, training
from studies.validation.swimmer import ADDED, FULL, LEFT_OUT, VARIANTS, kept_speeds

SAMPLES, OF_VARIANTS, OF_ADDED, FOURS = 512, 128, 64, 100
"""Samples of the full model, of those with parts left out, of those with others: the first of one sequence. Fours."""
SAME_SAMPLES = "full, as many samples"
CHECKED, SLOW = 64, 0.01
"""Samples that swim on a finer mesh, too, and the speed [m/s] below which a difference says nothing."""


def simulate(conditions: list[Condition], name: str, n: int, folder: Path) -> Floats:
    """Speeds of n samples of a model [m/s], shape (n, n_conditions)."""
    place, values = folder / f"{name.replace(' ', '-')}-{n}", samples(n)
    return np.stack([kept_speeds(place / f"{one.name}.npy", one, values, VARIANTS[name]) for one in conditions], axis=1)


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
        "powers": laws.powers(conditions, prediction.middle)[0],
    }


def row(one: dict[str, Any]) -> dict[str, Any]:
    """What is kept of a model's analysis: score, other fours, and powers of f and dk to which its predictions go."""
    return {"score": asdict(one["score"]), "fours": one["fours"], "effective_samples": one["effective"],
            "hindsight": one["hindsight"], "powers": one["powers"]}  # fmt: skip


def discretisation(simulated: Floats, conditions: list[Condition], folder: Path) -> float:
    """Mean difference of speeds with twice as many edges and steps, over the speed, of samples that swim forward."""
    few, off = samples(CHECKED), []
    for k in training(conditions):
        finer = kept_speeds(folder / f"finer-{CHECKED}-{conditions[k].name}.npy", conditions[k], few, FULL, finer=2)
        coarse = simulated[:CHECKED, k]
        forward = finer > SLOW
        off.append(np.abs(coarse[forward] / finer[forward] - 1.0))
    return float(np.concatenate(off).mean())


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
        "models": {name: row(one) for name, one in analyses.items()},
        "before": asdict(full["blind"]),
        "one_speed_for_all": full["one speed"],
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


COLOURS = {0: CYCLE[0], 10: CYCLE[2], 30: CYCLE[1], 40: CYCLE[3], 50: CYCLE[4]}
AUTHORS = 0.19
"""Mean error of the authors' own simulation."""
TOP = 100.0
"""Largest predicted speed of the axes [mm/s]."""


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Scatter plot: measured speed over prediction, 90 % intervals, and the speeds that were fitted to as rings."""
    figure, axes = subplots(figsize=(6.4, 6.4))
    line = np.array([0.0, TOP])
    axes.plot(line, line, color=INK, lw=1.0, label="predicted as measured")
    axes.fill_between(line, (1.0 - AUTHORS) * line, (1.0 + AUTHORS) * line, color="0.93", zorder=0,
                      label=f"±{100 * AUTHORS:.0f} %: mean error of the\nauthors' own simulation")  # fmt: skip
    for one in results["speeds_mm_per_s"]:
        x, y = one["predicted"], one["measured"]
        colour, used = COLOURS[one["liquid_metal"]], one["identified_from"]
        axes.errorbar(x, y, xerr=[[x - one["low"]], [one["high"] - x]], color=colour, lw=0.7, alpha=0.35)
        axes.plot(x, y, "o", ms=8 if used else 5, mfc="white" if used else colour, color=colour, mew=1.6)
    for material, colour in COLOURS.items():
        axes.plot([], [], "o", ms=5, color=colour, label=f"{material} % liquid metal in the limbs")
    axes.plot(
        [], [], "o", ms=8, mfc="white", mew=1.6, color=INK, label="one of the four speeds that\nthe model is fitted to"
    )
    off = 100.0 * results["models"]["full"]["score"]["error"]
    predicted = sum(not one["identified_from"] for one in results["speeds_mm_per_s"])
    axes.set(
        xlim=(0.0, TOP), ylim=(0.0, 92.0), xlabel="predicted speed and its 90 % interval [mm/s]",
        ylabel="measured speed [mm/s]", title=f"{predicted} predicted speeds, {off:.0f} % off on average",
    )  # fmt: skip
    axes.legend(fontsize="small", loc="upper left", ncols=2)
    save_figure(figure, file)


@dataclass(frozen=True)
class Options:
    """Unknowns from four speeds, and predictions of the others."""

    more: bool = False
    """Keep the full model that is there, and add what is missing of the others; laws of one constant are new."""


def run(
    options: Options,
    results: Results,
    n_samples: int = SAMPLES,
    variants: Sequence[str] = (*LEFT_OUT, *ADDED),
    runs: Path = Path("runs/validation"),
) -> None:
    """Simulate, weigh, predict, leave parts out, add others, and compare with laws of one constant.

    variants: Parts to leave out or to add. runs: Folder of speeds.
    """
    conditions, fewer, few = read_speeds(), min(OF_VARIANTS, n_samples), min(OF_ADDED, n_samples)
    if options.more:
        results.read()
    else:
        results.update(full_model(n_samples, fewer, runs))
    results["laws"] = laws.law_scores(conditions, training(conditions), other_fours(conditions, FOURS))
    results.save()

    def of_variant(name: str) -> dict[str, Any]:
        n = few if name in ADDED else fewer
        return row(analyse(simulate(conditions, name, n, runs), conditions))

    def of_follower(name: str) -> dict[str, Any]:
        return row(analyse(follow.speeds(conditions, samples(fewer), follow.LAWS[name]), conditions))

    def of_turns(second: str) -> dict[str, Any]:
        four = [conditions[k] for k in training(conditions)]
        measured, known = np.array([condition.speed for condition in four]), list(range(len(four)))
        weight = weights(simulate(four, "full", fewer, runs), measured, known)
        return turns.examine(second, samples(fewer), weight)

    results.fill({("turns", second): partial(of_turns, second) for second in turns.SECOND}, turns.tell)
    results.fill({("models", name): partial(of_variant, name) for name in variants}, laws.tell)
    results.fill({("followers", name): partial(of_follower, name) for name in follow.LAWS}, laws.tell)


def full_model(n_samples: int, fewer: int, runs: Path) -> dict[str, Any]:
    """Numbers of the full model, and of the first of its samples."""
    conditions, values = read_speeds(), samples(n_samples)
    simulated = simulate(conditions, "full", n_samples, runs)
    analyses = {"full": analyse(simulated, conditions), SAME_SAMPLES: analyse(simulated[:fewer], conditions)}
    found = as_json(analyses, conditions, values)
    return found | {"discretisation": discretisation(simulated, conditions, runs)}


STUDY = Study(
    "validation",
    run,
    Options,
    "validation/validation.json",
    pictures={"validation.png": draw},
    tables={"validation": laws.table, "validation tried": laws.tried, "validation turns": turns.table},
    packages=("scipy",),
)
