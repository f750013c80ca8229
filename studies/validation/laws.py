"""Laws of one constant, v = a f^p dk^q, fitted to the same four speeds and with the same inputs as the model.

dk is the change of curvature that was measured at that material and frequency. All exponents of a small grid are
tried, so that none is picked. Mean thrust of about f dk^2 against drag of about v^2 gives p = 1/2, q = 1.
"""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.validation.speeds import Condition
from studies.validation.swimmer import measured_curve

Floats = NDArray[np.float64]

POWERS_OF_FREQUENCY, POWERS_OF_CHANGE = (0.0, 0.5, 1.0), (0.0, 0.5, 1.0, 2.0)
PER_CENT = 100.0


def law_error(shape: Floats, measured: Floats, chosen: list[int]) -> float:
    """Mean error of a times `shape` on the conditions that were not chosen; log a is the mean over those that were."""
    others = np.setdiff1d(np.arange(len(measured)), chosen)
    a = np.exp(np.log(measured[chosen] / shape[chosen]).mean())
    return float(np.abs(a * shape[others] / measured[others] - 1.0).mean())


def law_scores(conditions: list[Condition], chosen: list[int], fours: list[list[int]]) -> list[dict[str, Any]]:
    """Errors of every law: with the chosen four, and quantiles 5, 50 and 95 % over other fours.

    The last one is told all speeds: its exponents are those of the least squares of all logarithms.
    """
    f = np.array([condition.frequency for condition in conditions])
    dk = np.array([np.ptp(measured_curve(c.liquid_metal, c.frequency)[1]) for c in conditions])
    v = np.array([condition.speed for condition in conditions])
    terms = np.stack([np.ones_like(f), np.log(f), np.log(dk)], axis=1)
    told_all = tuple(np.linalg.lstsq(terms, np.log(v), rcond=None)[0][1:].tolist())
    powers = [*itertools.product(POWERS_OF_FREQUENCY, POWERS_OF_CHANGE), told_all]
    return [
        {
            "powers": [p, q],
            "error": law_error(f**p * dk**q, v, chosen),
            "fours": np.percentile([law_error(f**p * dk**q, v, four) for four in fours], [5.0, 50.0, 95.0]).tolist(),
            "told_all": (p, q) == told_all,
        }
        for p, q in powers
    ]


def table(results: dict[str, Any]) -> str:
    """The laws, the model and the mean of four speeds side by side in Markdown, by their error over other fours."""
    full = results["models"]["full"]
    rows = [("**the model**", full["score"]["error"], full["fours"]["error"])]
    rows += [(_name(law), law["error"], law["fours"]) for law in results["laws"]]
    rows.sort(key=lambda row: row[2][1])
    lines = ["| prediction | error of 33 speeds | with other fours: median (5 to 95 %) |", "|---|---:|---:|"]
    return "\n".join([*lines, *(_row(*row) for row in rows)])


def _name(law: dict[str, Any]) -> str:
    p, q = law["powers"]
    if law["told_all"]:
        return f"a f^{p:.2f} dk^{q:.2f}, exponents fitted to all 37 speeds"
    shown = [{0.0: "", 0.5: f"sqrt({name})", 1.0: name}.get(power, f"{name}^{power:g}")
             for name, power in (("f", p), ("dk", q))]  # fmt: skip
    return " ".join(["a", *filter(None, shown)]) + (", one speed for all" if not any(shown) else "")


def _row(name: str, error: float, fours: Sequence[float]) -> str:
    low, middle, high = (PER_CENT * each for each in fours)
    return f"| {name} | {PER_CENT * error:.1f} % | {middle:.1f} % ({low:.1f} to {high:.1f}) |"
