"""Laws of one constant, v = a f^p dk^q, fitted to the same four speeds and with the same inputs as the model.

dk is the change of curvature that was measured at that material and frequency. All exponents of a small grid are
tried, so that none is picked. Mean thrust of about f dk^2 against drag of about v^2 gives p = 1/2, q = 1.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from studies.frame import Floats
from studies.pages import markdown
from studies.style import PERCENT
from studies.validation.speeds import Condition
from studies.validation.swimmer import measured_curve

POWERS_OF_FREQUENCY, POWERS_OF_CHANGE = (0.0, 0.5, 1.0), (0.0, 0.5, 1.0, 2.0)
ERRORS = "error of 33 speeds [%]", "with other fours [%]: median (5 to 95)"
"""Columns of the tables."""
LARGEST = 0.25
"""Error over other fours of what the page still shows."""
ADDED = {
    "as above": "the model",
    "strips": "strips instead of discs",
    "pairs in turn": "rear pair half a period after the front one",
    "measured curves": "measured curves instead of their fits",
    "all three": "all three",
}
"""Models that the page shows beside swimmers whose limbs follow, and their names there."""


def law_error(shape: Floats, measured: Floats, chosen: list[int]) -> float:
    """Mean error of a times `shape` on the conditions that were not chosen; log a is the mean over those that were."""
    others = np.setdiff1d(np.arange(len(measured)), chosen)
    a = np.exp(np.log(measured[chosen] / shape[chosen]).mean())
    return float(np.abs(a * shape[others] / measured[others] - 1.0).mean())


def logarithms(conditions: list[Condition], curve: Callable[[Condition], tuple[Floats, Floats]]) -> Floats:
    """1, log f and log dk of every condition, shape (n_conditions, 3). curve: Gives times and curvatures."""
    f = np.array([condition.frequency for condition in conditions])
    dk = np.array([np.ptp(curve(condition)[1]) for condition in conditions])
    return np.stack([np.ones_like(f), np.log(f), np.log(dk)], axis=1)


def powers(
    conditions: list[Condition], v: Floats, curve: Callable[[Condition], tuple[Floats, Floats]] = measured_curve
) -> tuple[list[float], list[float]]:
    """Powers of f and dk to which speeds go, and their standard errors: the least squares of all logarithms."""
    terms = logarithms(conditions, curve)
    found, squares, _, _ = np.linalg.lstsq(terms, np.log(v), rcond=None)
    variance = np.linalg.inv(terms.T @ terms) * squares / (len(v) - terms.shape[1])
    return found[1:].tolist(), np.sqrt(np.diag(variance)[1:]).tolist()


def law_scores(conditions: list[Condition], chosen: list[int], fours: list[list[int]]) -> list[dict[str, Any]]:
    """Errors of every law: with the chosen four, and quantiles 5, 50 and 95 % over other fours.

    The last one is told all speeds: its exponents are those of the least squares of all logarithms.
    """
    f, dk = np.exp(logarithms(conditions, measured_curve)[:, 1:].T)
    v = np.array([condition.speed for condition in conditions])
    fitted, errors = powers(conditions, v)
    told_all = tuple(fitted)
    return [
        {
            "powers": [p, q],
            "error": law_error(f**p * dk**q, v, chosen),
            "fours": np.percentile([law_error(f**p * dk**q, v, four) for four in fours], [5.0, 50.0, 95.0]).tolist(),
            "told_all": (p, q) == told_all,
        }
        | ({"standard_errors": errors} if (p, q) == told_all else {})
        for p, q in [*itertools.product(POWERS_OF_FREQUENCY, POWERS_OF_CHANGE), told_all]
    ]


def table(results: dict[str, Any]) -> str:
    """The laws, the model and the mean of four speeds side by side in Markdown, by their error over other fours."""
    full = results["models"]["full"]
    rows = [("**the model**", full["score"]["error"], full["fours"]["error"])]
    rows += [(_name(law), law["error"], law["fours"]) for law in results["laws"]]
    rows = sorted((row for row in rows if row[2][1] < LARGEST or "one speed" in row[0]), key=lambda row: row[2][1])
    return markdown(["prediction", *ERRORS], [_row(*row) for row in rows])


def tried(results: dict[str, Any]) -> str:
    """Models with what the full one lacks, and swimmers whose limbs follow their curves, in Markdown."""
    told_all = next(law for law in results["laws"] if law["told_all"])
    (p, q), (more, most) = told_all["powers"], told_all["standard_errors"]
    rows = [["measured", "", "", f"f^({p:.2f} ± {more:.2f}) dk^({q:.2f} ± {most:.2f})"]]
    shown = [(shown_as, results["models"][name]) for name, shown_as in ADDED.items() if name in results["models"]]
    for name, one in (*shown, *results["followers"].items()):
        p, q = one["powers"]
        rows.append([*_row(name, one["score"]["error"], one["fours"]["error"]), f"f^{p:.2f} dk^{q:.2f}"])
    return markdown(["model", *ERRORS, "speeds go with"], rows, (0, 3))


def tell(one: dict[str, Any]) -> str:
    """Errors of a model in a line."""
    error, middle = PERCENT * one["score"]["error"], PERCENT * one["fours"]["error"][1]
    return f"{error:.1f} %, {middle:.1f} % with other fours, powers {one['powers']}"


def _name(law: dict[str, Any]) -> str:
    p, q = law["powers"]
    if law["told_all"]:
        return f"a f^{p:.2f} dk^{q:.2f}, exponents fitted to all 37 speeds"
    shown = [{0.0: "", 0.5: f"sqrt({name})", 1.0: name}.get(power, f"{name}^{power:g}")
             for name, power in (("f", p), ("dk", q))]  # fmt: skip
    return " ".join(["a", *filter(None, shown)]) + (", one speed for all" if not any(shown) else "")


def _row(name: str, error: float, fours: Sequence[float]) -> list[str]:
    low, middle, high = (PERCENT * each for each in fours)
    return [name, f"{PERCENT * error:.1f}", f"{middle:.1f} ({low:.1f} to {high:.1f})"]
