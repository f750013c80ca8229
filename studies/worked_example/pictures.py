"""Picture of the worked example: the numbers that were fitted, and the times of the policies."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.evaluation.statistics import mean_with_interval
from studies.style import FAINT, INK, new_figure
from studies.worked_example.robots import DEVIATIONS, nominal_values
from studies.worked_example.tables import of_seeds

COLOURS = {"nominal": "#cc7a00", "cooling": "#8844aa", "fitted": "#3366aa", "drawn": "#118855"}
BELIEFS = {
    "nominal": "written down",
    "cooling": "written down,\nfitted cooling time",
    "fitted": "fitted",
    "drawn": "draws from\nintervals",
}
"""What policies are trained on, in few words."""
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
    figure = new_figure(10.0, 3.9)
    numbers, random, pentagon = figure.subplots(1, 3, gridspec_kw={"width_ratios": (1.3, 1.0, 1.0)})
    pentagon.sharey(random)
    _draw_numbers(numbers, results["fit"])
    for axes, what, title in ((random, "random", "random paths"), (pentagon, "pentagon", "pentagon")):
        _draw_times(axes, results["runs"], what)
        axes.set_title(f"policies, {title}")
    pentagon.tick_params(labelleft=False)
    dots = random.plot([], [], "o", color=FAINT, markersize=3, label="a training; coloured: means with 95 % intervals")
    handles = [*numbers.get_legend_handles_labels()[0], *dots]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=9)
    figure.savefig(file)


def _draw_numbers(axes: Any, found: Mapping[str, Any]) -> None:
    as_built = np.array([each.built for each in DEVIATIONS])
    places = np.arange(len(DEVIATIONS))
    low, value, high = (np.array(found[name]) / as_built for name in ("lower", "values", "upper"))
    axes.axvline(1.0, color=INK, linewidth=1.0)
    axes.plot(
        nominal_values() / as_built, places, "x", color=COLOURS["nominal"], markersize=7, markeredgewidth=2,
        label="written down",
    )  # fmt: skip
    axes.errorbar(
        value, places, xerr=(value - low, high - value), fmt="o", markersize=4, capsize=3, color=COLOURS["fitted"],
        label="fitted, with 95 % interval",
    )  # fmt: skip
    axes.set_yticks(places, [LABELS[each.name] for each in DEVIATIONS])
    axes.set_ylim(len(DEVIATIONS) - 0.5, -0.5)
    axes.set(xlabel="over that of the robot as built", xscale="log")
    ticks = (0.5, 0.7, 1.0, 1.4, 2.0)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_title("numbers of the robot")
    axes.grid(True, axis="x")


def _draw_times(axes: Any, runs: Mapping[str, Any], what: str) -> None:
    """Every training a dot, with their mean and its interval."""
    for place, (name, some) in enumerate(runs.items()):
        times = of_seeds(some, what)
        axes.plot(times, np.full(len(times), place + 0.15), "o", color=FAINT, markersize=3, alpha=0.6)
        mean, low, high = mean_with_interval(times)
        bar = [[mean - low], [high - mean]]
        axes.errorbar(mean, place - 0.1, xerr=bar, fmt="o", capsize=3, color=COLOURS[name], markersize=5)
    axes.set_yticks(range(len(runs)), [BELIEFS[name] for name in runs])
    axes.set_ylim(len(runs) - 0.5, -0.5)
    axes.set_xlim(0.0, 1.1 * max(float(of_seeds(some, what).max()) for some in runs.values()))
    axes.set_xlabel("time on the robot as built [s]")
    axes.grid(True, axis="x")
