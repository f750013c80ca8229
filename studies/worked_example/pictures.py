"""Picture of the worked example: the numbers that were fitted, and the times of the policies."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.evaluation.many import mean_with_interval
from studies.style import FAINT, INK, subplots
from studies.worked_example.robots import DEVIATIONS, nominal_values
from studies.worked_example.tables import WORDS, of_seeds

COLOURS = {"nominal": "#cc7a00", "fitted": "#3366aa", "drawn": "#118855"}
LABELS = {
    "robot.body.drag_coefficient": "drag of the body",
    "fluid.drag_coefficient": "drag of the limbs",
    "robot.youngs_modulus": "Young's modulus",
    "actuator.peak_angle": "peak angle",
    "actuator.rise": "heat of a pulse",
    "actuator.time_constant": "cooling time",
}


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Draw numbers over those of the robot as it was built, and times on that robot."""
    figure, (numbers, random, pentagon) = subplots(
        1, 3, figsize=(10.0, 3.8), gridspec_kw={"width_ratios": (1.5, 1.0, 1.0)}
    )
    _draw_numbers(numbers, results["fit"])
    for axes, what, title in ((random, "random", "held-out random paths"), (pentagon, "pentagon", "pentagon")):
        _draw_times(axes, results["runs"], what)
        axes.set_title(title)
    handles, labels = numbers.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=2, fontsize=9)
    figure.savefig(file)


def _draw_numbers(axes: Any, found: Mapping[str, Any]) -> None:
    as_built = np.array([each.built for each in DEVIATIONS])
    places = np.arange(len(DEVIATIONS))
    low, value, high = (np.array(found[name]) / as_built for name in ("lower", "values", "upper"))
    axes.axvline(1.0, color=INK, linewidth=1.0)
    axes.plot(nominal_values() / as_built, places, "x", color=COLOURS["nominal"], label="written down")
    axes.errorbar(
        value, places, xerr=(value - low, high - value), fmt="o", markersize=4, capsize=3, color=COLOURS["fitted"],
        label="fitted, with 95 % interval",
    )  # fmt: skip
    axes.set_yticks(places, [LABELS[each.name] for each in DEVIATIONS])
    axes.set_ylim(len(DEVIATIONS) - 0.5, -0.5)
    axes.set(xlabel="over that of the robot as it was built", xscale="log")
    ticks = (0.5, 0.7, 1.0, 1.4, 2.0)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_title("numbers of the robot")


def _draw_times(axes: Any, runs: Mapping[str, Any], what: str) -> None:
    """Every training a dot, with their mean and its interval."""
    for place, (name, some) in enumerate(runs.items()):
        times = of_seeds(some, what)
        axes.plot(np.full(len(times), place), times, "o", color=FAINT, markersize=3, alpha=0.6)
        mean, low, high = mean_with_interval(times)
        bar = [[mean - low], [high - mean]]
        axes.errorbar(place + 0.25, mean, yerr=bar, fmt="o", capsize=4, color=COLOURS[name], markersize=6)
    labels = [f"trained on\n{WORDS[name]}".replace(" from", "\nfrom") for name in runs]
    axes.set_xticks(range(len(runs)), labels, fontsize=8)
    axes.set_xlim(-0.4, len(runs) - 0.4)
    axes.set_ylabel("time on the robot as it was built [s]")
