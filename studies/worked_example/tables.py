"""Tables of the worked example, in Markdown."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.evaluation.statistics import mean_with_interval
from studies.worked_example.robots import DEVIATIONS, NOISE, nominal_values

Floats = NDArray[np.float64]
WORDS = {
    "nominal": "what was written down",
    "cooling": "the same with the fitted cooling time",
    "fitted": "the fit",
    "drawn": "draws from its intervals",
}
"""What policies are trained on, in words."""


def of_seeds(runs: Mapping[str, Any], what: str) -> Floats:
    """A time of every training, by seed [s]: the mean over paths, where there are several."""
    return np.array([np.mean(runs[seed][what]) for seed in sorted(runs, key=int)])


def saved(runs: Mapping[str, Any], name: str, what: str) -> Floats:
    """By how much policies of a name are faster than the nominal one of the same seed [s]."""
    both = sorted(runs["nominal"].keys() & runs[name].keys(), key=int)
    one, other = ({seed: runs[each][seed] for seed in both} for each in ("nominal", name))
    return of_seeds(one, what) - of_seeds(other, what)


def shown(interval: tuple[float, float, float]) -> str:
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
        fitted = f"{value:.4g} [{low:.4g}, {high:.4g}]"
        lines.append(f"| `{each.name}`{unit} | {nominal:.4g} | {fitted} | {each.built:.4g} | {each.why} |")
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


def covered(results: Mapping[str, Any]) -> str:
    """Sentences on the residuals, and on the numbers as built that lie outside of their intervals."""
    found = results["fit"]
    intervals = zip(DEVIATIONS, found["lower"], found["upper"], strict=True)
    outside = [f"`{each.name}`" for each, low, high in intervals if not low <= each.built <= high]
    where = "All numbers as built lie within their intervals."
    if outside:
        where = f"Numbers as built outside their intervals: {', '.join(outside)}."
    return (
        f"{where} Residuals are {1e3 * found['root_mean_square_m']:.3g} mm root mean square, the camera's noise is "
        f"{1e3 * NOISE:g} mm. The rest comes from limbs that differ, which the fit ignores, and from the numerics."
    )


def verdict(results: Mapping[str, Any], name: str) -> str:
    """Sentence on policies of a name against nominal ones, on random paths."""
    gains, nominal = saved(results["runs"], name, "random"), of_seeds(results["runs"]["nominal"], "random")
    mean, low, high = mean_with_interval(gains)
    if low <= 0.0 <= high:
        told = "differ by no more than seeds do"
    else:
        than = "faster" if mean > 0.0 else "slower"
        share = 100.0 * abs(mean) / float(np.mean(nominal))
        told = f"are {share:.0f} % {than}, in {np.sum(gains * mean > 0.0)} of {len(gains)} seeds"
    return f"Those of {WORDS[name]} {told}."


def as_markdown(results: Mapping[str, Any]) -> str:
    """Both tables, the picture, and what they say."""
    certificate, settings = results["certificate"], results["settings"]
    seconds = [run["processor_seconds"] for runs in results["runs"].values() for run in runs.values()]
    counts = sorted({len(runs) for runs in results["runs"].values()})
    seeds = " to ".join(map(str, dict.fromkeys((counts[0], counts[-1]))))
    return "\n\n".join(
        [
            f"Machine: {results['machine']}, one core, beside other work. {settings['tracked']} strokes were tracked.",
            of_numbers(results),
            covered(results),
            f"Policies are trained for {settings['strokes']:,} strokes, in {np.mean(seconds):.0f} s of processor time, "
            f"at {certificate['setting']}, the fastest setting of the certificate below "
            f"{100.0 * settings['error']:g} %. They swim {settings['paths']} held-out random paths and the pentagon on "
            "the robot as it was built, at 2 ms with 13 nodes per limb. Means over seeds "
            f"({seeds} of each) with 95 % intervals; gains are over the nominal policy of the same seed. *Expected* is "
            "the time in the scene of the training.",
            of_policies(results),
            "On random paths, compared with policies of what was written down: "
            + " ".join(verdict(results, name) for name in results["runs"] if name != "nominal"),
            "![Numbers that were fitted, and times of the policies](worked_example/results.png)",
        ]
    )
