"""Turns, which were not fitted: those of two tracked swims of the swimmer under its planner.

The planner chose the limbs that heat, by letters, for two strokes each (README.md). The material of those limbs was not
recorded, so predictions are mixtures over the materials that were measured at the swims' frequency. Samples and weights
are those of the full model and its four speeds. Every letter is swum after straight strokes, and before some more.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seastar_gym.simulator import Simulator
from studies.frame import Floats, rounded
from studies.pages import markdown
from studies.style import MM, PERCENT
from studies.validation.inference import predict, score
from studies.validation.priors import SWEEPS, of_sweep
from studies.validation.speeds import Condition
from studies.validation.swimmer import FULL, SIDES, scene

FILE = Path(__file__).with_name("swimmer_turns.csv")
FREQUENCY, MATERIALS = 0.7, (0, 10, 20, 30)
"""Frequency of the strokes [Hz], and materials whose limbs were measured at it [% of liquid metal], equally likely."""
STRAIGHT = "B"
HEATED = {"B": (1, 1, 1, 1), "D": (0, 1, 1, 1), "E": (1, 1, 0, 0), "F": (0, 0, 1, 1), "H": (0, 0, 0, 1)}
"""Limbs that a letter heats: front left, back left, back right and front right, as in `swimmer.SIDES`."""
STROKES = 4
"""Straight strokes before a letter, and after it."""
SECOND = ("all four", "the same limbs")
"""What may heat in the second stroke of a letter."""


class Letters(NamedTuple):
    """Letters of two strokes, but the first of a path, which begins at rest; arrays of the shape (n,).

    turns: Of both strokes, positive where the letter should turn [rad]. first: Of the first stroke.
    ways: Along the mean heading [m].
    """

    names: list[str]
    turns: Floats
    first: Floats
    ways: Floats


def turns_left(letter: str) -> float:
    """1 for letters that heat more limbs on the right, -1 for those that heat more on the left, 0 for others."""
    return float(np.sign(np.dot(HEATED[letter], (-1, -1, 1, 1))))


def read_letters() -> Letters:
    """Letters of both paths, as tracked."""
    rows, found = np.loadtxt(FILE, delimiter=",", dtype=str), []
    for name in np.unique(rows[:, 0]):
        own = rows[rows[:, 0] == name]
        places, headings = own[:, 3:5].astype(float) / MM, own[:, 5].astype(float)
        for k in range(2, len(own) - 2, 2):
            turn, middle = headings[k + 2] - headings[k], 0.5 * (headings[k] + headings[k + 2])
            way = (places[k + 2] - places[k]) @ [np.cos(middle), np.sin(middle)]
            sign = turns_left(own[k, 2]) or 1.0
            found.append((own[k, 2], sign * turn, sign * (headings[k + 1] - headings[k]), way))
    names, *numbers = zip(*found, strict=True)
    return Letters([str(name) for name in names], *map(np.array, numbers))


def swum(letter: str, second: str, material: int, values: dict[str, Floats]) -> tuple[Floats, Floats, Floats]:
    """Turns [rad] and ways [m] of samples in a letter, and mean turns of the strokes after it, shape (n,) each."""
    found = np.empty((3, len(values["limb length"])))
    later = HEATED[letter] if second == SECOND[1] else HEATED[STRAIGHT]
    orders = [HEATED[STRAIGHT]] * STROKES + [HEATED[letter], later] + [HEATED[STRAIGHT]] * STROKES
    for number, sweep in enumerate(SWEEPS):
        own = of_sweep(values, number)
        simulator = Simulator(scene(Condition(material, FREQUENCY, np.nan), own, sweep, FULL), len(own["limb length"]))
        places, headings = [simulator.hub_position()], [simulator.orientation()]
        for order in orders:
            simulator.stroke(np.tile(np.array(order) * SIDES, (len(headings[0]), 1)))
            places.append(simulator.hub_position())
            headings.append(simulator.orientation())
        turned = np.unwrap(headings, axis=0)
        turn, middle = turned[STROKES + 2] - turned[STROKES], 0.5 * (turned[STROKES + 2] + turned[STROKES])
        x, y = (places[STROKES + 2] - places[STROKES]).T
        after = (turned[-1] - turned[STROKES + 2]) / STROKES
        numbers = np.array([turn, x * np.cos(middle) + y * np.sin(middle), after])
        found[:, number :: len(SWEEPS)] = np.where(simulator.failed, 0.0, numbers)
    turn, way, after = found
    sign = turns_left(letter) or 1.0
    return sign * turn, way, sign * after


def examine(second: str, values: dict[str, Floats], weight: Floats) -> dict[str, Any]:
    """Turns and ways as measured and as predicted, and how straight strokes go on, by samples and their weights."""
    letters, share = read_letters(), np.tile(weight / len(MATERIALS), len(MATERIALS))
    by_letter = {
        letter: np.concatenate([swum(letter, second, material, values) for material in MATERIALS], axis=1)
        for letter in sorted(set(letters.names))
    }
    turns, ways, after = np.stack([by_letter[name] for name in letters.names], axis=1)
    turning = np.array([turns_left(name) != 0.0 for name in letters.names])
    return {
        "letters": "".join(letters.names),
        "turn_rad": compared(turns[turning], letters.turns[turning], share),
        "way_mm": compared(MM * ways, MM * letters.ways, share),
        "straight_after_rad": rounded(float(share @ np.abs(after[turning]).mean(axis=0))),
        "straight_measured_rad": rounded(float(np.abs(letters.turns[~turning]).mean() / 2.0)),
        "share_of_first": rounded(float(letters.first[turning].sum() / letters.turns[turning].sum())),
    }


def compared(simulated: Floats, measured: Floats, weight: Floats) -> dict[str, Any]:
    """Measured numbers, medians and ends of 90 % intervals of samples, shape (n, n_samples), and their score."""
    found = predict(simulated.T, weight)
    columns = {"measured": measured, "predicted": found.middle, "low": found.low, "high": found.high}
    return {name: [rounded(float(each)) for each in column] for name, column in columns.items()} | {
        "score": asdict(score(found, measured, []))
    }


def tell(one: dict[str, Any]) -> str:
    """How far turns are off, in a line."""
    of_all = one["turn_rad"]["score"]
    return f"turns {PERCENT * of_all['error']:.0f} % off, {PERCENT * of_all['covered']:.0f} % within their intervals"


def table(results: dict[str, Any]) -> str:
    """Predictions of turns and ways and their scores in Markdown."""
    head = ["measured, mean", "predicted, mean (90 %)", "error", "mean error", "within 90 %"]
    rows = []
    for second, found in results["turns"].items():
        for what in ("turn_rad", "way_mm"):
            name, unit = what.split("_")
            one, of_all = found[what], found[what]["score"]
            measured, middle, low, high = (
                f"{round(float(np.mean(one[column])), 2):.3g}" for column in ("measured", "predicted", "low", "high")
            )
            rows.append([
                second, name, f"{measured} {unit}", f"{middle} {unit} ({low} to {high})",
                f"{PERCENT * of_all['error']:.0f} %", f"{PERCENT * of_all['bias']:+.0f} %",
                f"{PERCENT * of_all['covered']:.0f} % of {len(one['measured'])}",
            ])  # fmt: skip
    return markdown(["second stroke heats", "of a letter", *head], rows, (0, 1))
