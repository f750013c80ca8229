"""Tables of the worked example, in Markdown."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.evaluation.many import Interval, mean_with_interval
from studies.worked_example.robots import DEVIATIONS, nominal_values

Floats = NDArray[np.float64]
WORDS = {"nominal": "what was written down", "fitted": "the fit", "drawn": "draws from its intervals"}
"""What policies are trained on, in words."""


def of_seeds(runs: Mapping[str, Any], what: str) -> Floats:
    """A time of every training, by seed [s]: the mean over paths, where there are several."""
    return np.array([np.mean(runs[seed][what]) for seed in sorted(runs, key=int)])


def saved(runs: Mapping[str, Any], name: str, what: str) -> Floats:
    """By how much policies of a name are faster than the nominal one of the same seed [s]."""
    both = sorted(runs["nominal"].keys() & runs[name].keys(), key=int)
    one, other = ({seed: runs[each][seed] for seed in both} for each in ("nominal", name))
    return of_seeds(one, what) - of_seeds(other, what)


def shown(interval: Interval) -> str:
    """A mean with its interval."""
    mean, low, high = interval
    return f"{mean:.1f} [{low:.1f}, {high:.1f}]"


def of_numbers(results: Mapping[str, Any]) -> str:
    """Table of the numbers: written down, fitted, as built."""
    found = results["fit"]
    lines = ["| number | written down | fitted [95 %] | as built | why |", "|---|---:|---:|---:|---|"]
    for each, nominal, value, low, high in zip(
        DEVIATIONS, nominal_values(), found["values"], found["lower"], found["upper"], strict=True
    ):
        unit = "" if each.unit == "1" else f" [{each.unit}]"
        fitted = f"{value:.3g} [{low:.3g}, {high:.3g}]"
        lines.append(f"| `{each.name}`{unit} | {nominal:.3g} | {fitted} | {each.built:.3g} | {each.why} |")
    return "\n".join(lines)


def of_policies(results: Mapping[str, Any]) -> str:
    """Table of the policies' times on the robot as it was built."""
    lines = [
        "| trained on | random paths [s] | faster than nominal [s] | pentagon [s] | faster than nominal [s] | "
        "random paths, expected [s] |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for name, runs in results["runs"].items():
        cells = []
        for what in ("random", "pentagon"):
            gain = "" if name == "nominal" else shown(mean_with_interval(saved(results["runs"], name, what)))
            cells += [shown(mean_with_interval(of_seeds(runs, what))), gain]
        cells.append(shown(mean_with_interval(of_seeds(runs, "expected"))))
        lines.append(f"| {WORDS[name]} | {' | '.join(cells)} |")
    return "\n".join(lines)


def as_markdown(results: Mapping[str, Any]) -> str:
    """Both tables, and what stands between them."""
    found, certificate = results["fit"], results["certificate"]
    seeds = len(results["runs"].get("drawn", {}))
    return "\n\n".join(
        [
            of_numbers(results),
            f"Residuals: {1e3 * found['root_mean_square_m']:.3g} mm root mean square.",
            f"Trained at {certificate['setting']}: an error of {100.0 * certificate['error']:.2g} %.",
            of_policies(results),
            f"Means of {seeds} seeds with 95 % intervals.",
        ]
    )
