"""Do error bars cover where wires are commanded several times a second, too?

The factors of error bars were found with strokes (studies/accuracy/error_bars.py). Here robots with `SmaWires` swim ten
seconds from rest by the sequences of studies/accuracy/timed.py, drawn anew. A decision is covered where the hub's
distance from that with 73 nodes per limb and steps of 0.25 ms is at most the estimate.

Prints a table and writes it as `timed_error_bars.md`: the share of decisions that are covered, and the median of
estimate over true error.
"""

from pathlib import Path

import numpy as np
from tqdm import tqdm

from seastar_gym.accuracy.measure import swim
from seastar_gym.accuracy.setting import at
from seastar_gym.scene.numerics import Resolution
from studies.accuracy import timed
from studies.accuracy.error_bars import FIDELITIES, SETTINGS, SMALLEST, TRUE
from studies.accuracy.page import PERIODS
from studies.frame import Results, Study
from studies.pages import markdown, show
from studies.style import PERCENT

SAMPLES, SEED = 8, 7
"""Sequences of either kind for each time between decisions, and their seed; the tables of errors have seed 0."""


def measure(
    period: float, plan: timed.Plan, true: Resolution = TRUE, seed: int = SEED
) -> dict[str, tuple[float, float]]:
    """Coverage and median of estimate over true error, by preset, for a time between decisions [s]."""
    commands = timed.sequences(period, plan, np.random.default_rng([seed, round(1000 * period)]))
    exact = swim(at(timed.SCENE, true), commands, period).hub
    found = {}
    for name in FIDELITIES:
        swum = swim(at(timed.SCENE, SETTINGS[name]), commands, period, error_bars=True)
        error = np.fmax(np.linalg.norm(swum.hub - exact, axis=-1), SMALLEST)
        found[name] = float(np.mean(error <= swum.error_estimate)), float(np.median(swum.error_estimate / error))
    return found


def table(found: dict[float, dict[str, tuple[float, float]]]) -> str:
    """Coverage, and estimate over true error, by preset and time between decisions, in Markdown."""
    rows = [
        [f"`{name}`", *(f"{PERCENT * one[name][0]:.1f} %, {one[name][1]:.1f}" for one in found.values())]
        for name in FIDELITIES
    ]
    return markdown(["preset", *(f"{period:g} s" for period in found)], rows)


def run(results: Results) -> None:
    """Measure, write and print the table."""
    plan = timed.Plan(samples=SAMPLES)
    text = table({period: measure(period, plan) for period in tqdm(PERIODS, unit="period")})
    (results.folder / "timed_error_bars.md").write_text(text, encoding="utf-8")
    show(text)


STUDY = Study("accuracy.timed_error_bars", run, out=Path("runs/timed_error_bars"))
