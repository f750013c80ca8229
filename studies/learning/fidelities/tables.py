"""Tables of the study, and the sentence on what to train on."""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.evaluation.statistics import Estimate, estimate, rank_correlation
from studies.learning.fidelities.scenes import CHEAP, DEAR, FIDELITIES, PHYSICS, SWUM

Floats = NDArray[np.float64]
Runs = Mapping[str, Any]
"""Results of a training by its seed."""

NEAR = 0.01
"""Policies are as good as others if they need at most this share of strokes more."""


def strokes_on(runs: Runs, physics: str) -> Floats:
    """Strokes of all seeds on the held-out paths in some physics, shape (seeds, paths)."""
    return np.array([run["random"][physics] for run in runs.values()], dtype=np.float64)


def seconds(runs: Runs) -> float:
    """Mean processor time of the trainings [s]."""
    return float(np.mean([run["seconds"] for run in runs.values()]))


def trained(results: Mapping[str, Any]) -> dict[str, Runs]:
    """Trainings that have results, by fidelity, in the order of the study."""
    return {name: results["runs"][name] for name in FIDELITIES if results["runs"].get(name)}


def matrix(results: Mapping[str, Any]) -> dict[tuple[str, str], Estimate]:
    """Strokes by the fidelity of the training and the physics of the swims."""
    return {
        (name, physics): estimate(strokes_on(runs, physics))
        for name, runs in trained(results).items()
        for physics in SWUM
    }


def correlations(results: Mapping[str, Any]) -> dict[tuple[str, str], float]:
    """Rank correlation of all policies' mean strokes, for every pair of physics."""
    scores = {
        physics: [float(np.mean(row)) for runs in trained(results).values() for row in strokes_on(runs, physics)]
        for physics in SWUM
    }
    return {pair: rank_correlation(scores[pair[0]], scores[pair[1]]) for pair in itertools.combinations(SWUM, 2)}


def advice(results: Mapping[str, Any]) -> str:
    """Sentence on what to train on: the cheapest training whose policies are near those of the dearest."""
    found = trained(results)
    if DEAR not in found:
        return f"Nothing was trained at {DEAR} yet."
    best = {name: estimate(strokes_on(runs, DEAR)) for name, runs in found.items()}
    near = [name for name in found if best[name].mean <= (1.0 + NEAR) * best[DEAR].mean]
    cheapest = min(near, key=lambda name: seconds(found[name]))
    return (
        f"Train at {cheapest}: on {DEAR} its policies take {best[cheapest]} strokes, those trained there "
        f"{best[DEAR]}, in {seconds(found[cheapest]):.0f} s of processor time instead of {seconds(found[DEAR]):.0f} s."
    )


def as_markdown(results: Mapping[str, Any]) -> str:
    """All tables in Markdown."""
    return f"{matrix_table(results)}\n\n{finishing_table(results)}\n"


def matrix_table(results: Mapping[str, Any]) -> str:
    """Table of the trainings and the sentences that follow from it."""
    found = trained(results)
    lines = [
        f"| trained at | seeds | training [s] | swum there | on {DEAR} | {' | '.join(PHYSICS)} | pentagon, {DEAR} |",
        "|---|---:|---:|---:|---:|" + "---:|" * len(PHYSICS) + "---|",
    ]
    for name, runs in found.items():
        cells = [estimate(strokes_on(runs, physics)) for physics in (name, DEAR, *PHYSICS)]
        pentagon = ", ".join(str(run["pentagon"]) for run in runs.values())
        lines.append(f"| {name} | {len(runs)} | {seconds(runs):.0f} | {' | '.join(map(str, cells))} | {pentagon} |")
    ranks = {pair: value for pair, value in correlations(results).items() if not np.isnan(value)}
    lines += ["", advice(results)]
    within = [value for pair, value in ranks.items() if set(pair) <= set(FIDELITIES)]
    if within:
        lowest = min(ranks, key=lambda pair: ranks[pair])
        policies = sum(map(len, found.values()))
        lines += [
            "",
            f"Rank correlation of the mean strokes of {policies} policies: at least {min(within):.2f} between two "
            f"fidelities, {ranks.get((CHEAP, DEAR), np.nan):.2f} between {CHEAP} and {DEAR}; the lowest of all, "
            f"{ranks[lowest]:.2f}, is between {lowest[0]} and {lowest[1]}.",
        ]
    return "\n".join(lines)


def finishing_table(results: Mapping[str, Any]) -> str:
    """Table of the trainings that take the same time; empty if there is none."""
    if not results["finishing"]:
        return ""
    lines = [f"| processor time | training | strokes trained | seeds | strokes on {DEAR} | pentagon |"]
    lines.append("|---:|---|---|---:|---:|---|")
    for budget, contestants in results["finishing"].items():
        for contestant, runs in contestants.items():
            first = next(iter(runs.values()))
            stages = ", then ".join(f"{strokes:,} at {name}" for name, strokes in first["stages"])
            pentagon = ", ".join(str(run["pentagon"]) for run in runs.values())
            lines.append(
                f"| {budget} s (took {seconds(runs):.0f} s) | {contestant} | {stages} | {len(runs)} | "
                f"{estimate(strokes_on(runs, DEAR))} | {pentagon} |"
            )
    return "\n".join(lines)
