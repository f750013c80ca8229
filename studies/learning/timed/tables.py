"""Tables of the study."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from seastar_gym.envs.paths import make_path, path_length
from seastar_gym.envs.reward import PULSE
from seastar_gym.evaluation.statistics import mean_with_interval
from seastar_gym.scene.actuators.wires import SmaWires

Runs = Mapping[str, Any]
"""Results of a training by its seed."""

JOULES = SmaWires().heating_power * PULSE
"""Heat of a pulse [J]."""
PENTAGON = float(path_length(np.zeros(2), make_path("pentagon", np.random.default_rng(0))))
"""Length of the pentagon [m], the side that leads to it included."""


def as_markdown(runs: Mapping[str, Runs]) -> str:
    """Seconds and heat round the pentagon and on held-out paths, for every training, in Markdown."""
    lines = [
        "| training | seeds | pentagon, every seed [s] | mean [s] | `balanced` [s] | `reference` [s] "
        "| held-out paths [s] | arrived | J per metre of the path | pulses per metre |",
        "|---|---:|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    return "\n".join([*lines, *(_row(name, found) for name, found in runs.items() if found)])


def _row(name: str, runs: Runs) -> str:
    pentagon = {fidelity: _all(runs, "pentagon", fidelity, "seconds") for fidelity in ("fast", "balanced", "reference")}
    cells = [
        name,
        str(len(runs)),
        ", ".join(f"{each:.1f}" for each in pentagon["fast"]),
        *(_interval(seconds) for seconds in pentagon.values()),
        _interval(_all(runs, "held_out", "seconds")),
        f"{sum(run['held_out']['arrived'] for run in runs.values()) / len(runs):.1f}",
        f"{np.mean(_all(runs, 'pentagon', 'fast', 'energy_J')) / PENTAGON:.0f}",
        f"{pulses_per_metre(_all(runs, 'pentagon', 'fast', 'energy_J')):.0f}",
    ]
    return f"| {' | '.join(cells)} |"


def summary(runs: Mapping[str, Runs]) -> str:
    """The page's part of this in Markdown: means over seeds."""
    lines = ["| training | seeds | pentagon, `fast` [s] | held-out paths [s] | J/m |", "|---|---:|---:|---:|---:|"]
    for name, found in runs.items():
        if fast := _all(found, "pentagon", "fast", "seconds"):
            heat = f"{np.mean(_all(found, 'pentagon', 'fast', 'energy_J')) / PENTAGON:.0f}"
            cells = [str(len(found)), _interval(fast), _mean(_all(found, "held_out", "seconds")), heat]
            lines.append(f"| {' | '.join([name, *cells])} |")
    return "\n".join(lines)


def _mean(values: list[float]) -> str:
    return f"{np.mean(values):.1f}" if values else ""


def pulses_per_metre(joules: Iterable[float]) -> float:
    """Mean number of pulses per metre of the pentagon [1/m] of swims that took this heat [J]."""
    return float(np.mean(list(joules))) / JOULES / PENTAGON


def _all(runs: Runs, *names: str) -> list[float]:
    """Number under these names of every seed that has it."""
    found = []
    for run in runs.values():
        for name in names:
            run = run.get(name) if run is not None else None
        if run is not None:
            found.append(float(run))
    return found


def _interval(values: list[float]) -> str:
    if len(values) < 2:
        return "".join(f"{value:.1f}" for value in values)
    mean, low, high = mean_with_interval(np.array(values))
    return f"{mean:.1f} [{low:.1f}, {high:.1f}]"
